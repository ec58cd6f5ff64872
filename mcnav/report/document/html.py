"""HTML pages: tables as text, figures as SVG, one style sheet and script, nothing loaded."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from itertools import count
from typing import Final
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mcnav.report.document.glossary import hints
from mcnav.report.document.parts import Page, Part
from mcnav.report.document.template_cache import TemplateCache

CARD = "&{padding:.6rem .9rem;border:1px solid var(--line);border-radius:.6rem;background:var(--paper);max-width:72rem}"
"""Style of a card in a notebook."""

CHECK, CROSS, QUESTION = "M4.5 8.5l2.5 2.5l4.5-5.5", "M5 5l6 6M11 5l-6 6", "M5.8 6q0-2.2 2.2-2.2t2.2 2.2-2.2 3M8 12v0"
ICONS: Final = {
    "agrees": ("#0a7a55", CHECK), "differs": ("#c2350a", CROSS), "partly": ("#a87400", QUESTION),
    "undecided": ("#a87400", QUESTION),
}  # fmt: skip
"""Colour and sign of the window's icon, by tone: a tab shows no more."""

_TURNS: Final = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Bidirectional control characters (Unicode Standard Annex 9)."""

SVG: Final = "http://www.w3.org/2000/svg"
BOX: Final = "0 0 16 16"

END: Final = "})();\n"
"""End of the page's script, before which those of some parts have their place."""

ADDED: Final = {"MovedFigure": "deck", "WhatIfPart": "what_if", "LivePart": "live"}
"""Kinds of parts that have a style sheet and a script of their own, in the order of these."""


def page_html(page: Page) -> str:
    """Write a page as HTML: text is escaped, only `markupsafe.Markup` is markup.

    The table of contents lists the sections. The content security policy allows the one script by its hash, and
    that of a live page to ask the server it came from. Scrolling boxes can be focused by keyboard.
    """
    environment = _environment()
    style, script = (_source(environment, name) for name in ("style.css", "script.js"))
    parts = [*page.head, *(part for section in page.all_sections for part in section.parts)]
    kinds = {type(part).__name__ for part in parts}
    for name in (name for kind, name in ADDED.items() if kind in kinds):
        style += _source(environment, f"{name}.css")
        script = script.removesuffix(END) + _source(environment, f"{name}.js") + END
    script = re.sub(r"(?m)^\s*(//.*)?\n?", "", script)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = environment.get_template("page.html").render(
        page=page, style=Markup(style), script=Markup(script), script_hash=Markup(f"sha256-{digest}"), icon=icon,
        live="LivePart" in kinds, hints=hints(),
    )  # fmt: skip
    return _focusable(without_turns(text))


def icon(tone: str) -> Markup:
    """Return the window's icon of a tone: a sign on a disc of its colour, as an address that holds the image."""
    colour, sign = ICONS[tone]
    path = f"<path d='{sign}' fill='none' stroke='#fff' stroke-width='2.2' stroke-linecap='round'/>"
    disc = f"<circle cx='8' cy='8' r='8' fill='{colour}'/>"
    return Markup(f"data:image/svg+xml,{quote(f'<svg xmlns={SVG!r} viewBox={BOX!r}>{disc}{path}</svg>')}")


def parts_html(parts: Sequence[Part]) -> str:
    """Write parts of a page as HTML without style and script, as notebooks show them."""
    return without_turns(str(_environment().get_template("parts.html").module.shown(parts)))  # type: ignore[attr-defined]


def without_turns(text: str) -> str:
    r"""Write characters that turn the direction of text as their codes: they could make a name read as another.

    The codes stand in markup, in JSON and in scripts alike.

    >>> without_turns("nominal\u202elanimon")
    'nominal[U+202E]lanimon'
    """
    return _TURNS.sub(lambda turn: f"[U+{ord(turn[0]):04X}]", text)


def card_html(parts: Sequence[Part]) -> str:
    """Write parts of a page as HTML with their style, which applies to nothing else in a notebook, and no script.

    Names of elements are of this card alone, because a notebook shows several.
    """
    environment = _environment()
    style = re.sub(r":root\b|\b(?:html|body)(?= [{])", "&", _source(environment, "style.css"))
    text = parts_html(parts)
    own = hashlib.sha256(text.encode()).hexdigest()[:8]
    names = sorted(set(re.findall(r' id="([^"]+)"', text)), key=len, reverse=True)
    for name in names:
        text = re.sub(
            rf'(id="|labelledby="|describedby="|url\(#){re.escape(name)}(?=["\s)])', rf"\g<1>{name}-{own}", text
        )
    return f'<div class="mcnav"><style>.mcnav {{ {style} {CARD} }}</style>{text}</div>'


@cache
def _environment() -> Environment:
    """Return the one environment of this process, which keeps the templates that it has loaded."""
    environment = Environment(
        loader=PackageLoader("mcnav.report.document", "templates"), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, bytecode_cache=TemplateCache(__file__),
    )  # fmt: skip
    environment.filters["kind"] = lambda row: type(row).__name__
    return environment


def _source(environment: Environment, name: str) -> str:
    return environment.loader.get_source(environment, name)[0] if environment.loader else ""


def _focusable(text: str) -> str:
    """Let scrolling boxes take the keyboard's focus, and name them."""
    numbers = count(1)
    return re.sub(
        '<div class="scroll">',
        lambda _: f'<div class="scroll" tabindex="0" role="group" aria-label="Table {next(numbers)}">',
        text,
    )
