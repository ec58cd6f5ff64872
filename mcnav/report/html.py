"""HTML pages: tables as text, figures as SVG, one style sheet and script, nothing loaded."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mcnav.errors import shortened
from mcnav.report import format as formats
from mcnav.report.document import Page, Part
from mcnav.report.template_cache import TemplateCache

FILTERS: Final = ("number", "signed", "fixed", "with_error", "interval", "share", "percent", "probability")
"""Functions of `mcnav.report.format` that templates use."""

CONTENTS: Final = "<!-- contents -->"
"""Placeholder of the table of contents in the base template."""


def page_html(page: Page) -> str:
    """Write a page as HTML."""
    return filled("page.html", page=page)


def parts_html(parts: Sequence[Part]) -> str:
    """Write parts of a page as HTML without style and script, as notebooks show them."""
    return str(_environment().get_template("parts.html").module.shown(parts))  # type: ignore[attr-defined]


def filled(template: str, **values: Any) -> str:
    """Fill a template of this package; text is escaped, only figures are markup.

    The table of contents lists the sections that have an id and a heading. The content security policy allows the one
    script by its hash. Scrolling boxes can be focused by keyboard.
    """
    environment = _environment()
    style, script = (_source(environment, name) for name in ("style.css", "script.js"))
    script = re.sub(r"(?m)^\s*(//.*)?\n?", "", script)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = environment.get_template(template).render(
        style=Markup(style), script=Markup(script), script_hash=Markup(f"sha256-{digest}"), **values
    )
    return _focusable(_with_contents(text))


@cache
def _environment() -> Environment:
    """Return the one environment of this process, which keeps the templates that it has loaded."""
    environment = Environment(
        loader=PackageLoader("mcnav.report", "templates"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, bytecode_cache=TemplateCache(__file__),
    )  # fmt: skip
    environment.filters |= {name: getattr(formats, name) for name in FILTERS} | {"shortened": shortened}
    environment.filters["kind"] = lambda part: type(part).__name__
    return environment


def _source(environment: Environment, name: str) -> str:
    return environment.loader.get_source(environment, name)[0] if environment.loader else ""


def _with_contents(text: str) -> str:
    """Add the list of sections."""
    sections = re.findall(r'<section id="([^"]+)"[^>]*>\s*<h2[^>]*>(.*?)</h2>', text, flags=re.DOTALL)
    if len(sections) < 2:
        return text.replace(CONTENTS, "", 1)
    links = "\n".join(f'<li><a href="#{name}">{heading}</a></li>' for name, heading in sections)
    nav = f'<nav class="contents" aria-label="Contents"><p class="heading">On this page</p>\n<ul>\n{links}\n</ul></nav>'
    return text.replace(CONTENTS, nav, 1).replace('<div class="page">', '<div class="page with-contents">', 1)


def _focusable(text: str) -> str:
    """Let scrolling boxes take the keyboard's focus, name them, and wrap captions so that they do not scroll."""
    text = re.sub("<caption>(.*?)</caption>", r"<caption><span>\1</span></caption>", text, flags=re.DOTALL)
    number_of = iter(range(1, text.count('<div class="scroll">') + 1))
    return re.sub(
        '<div class="scroll">',
        lambda _: f'<div class="scroll" tabindex="0" role="group" aria-label="Table {next(number_of)}">',
        text,
    )
