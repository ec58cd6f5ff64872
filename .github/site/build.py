"""Build the documentation as a site: python .github/site/build.py [FOLDER], by default build/site.

The pages are those that `mcnav docs` shows, the README, the changelog, the page for contributors and the benchmarks.
They are copied to build/pages, with their links turned to each other, and with the pages of this folder and those that
`generated.py` and `keys.py` make of the program itself: commands, examples, keys of campaign files. Equations become
MathML. Sphinx then builds the site; a warning is an error, and no network is needed.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sphinx.cmd.build import build_main

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parent.parent
sys.path[:0] = [str(ROOT), str(HERE)]  # of this working copy, whatever is installed

from mcnav.docs.pages import PAGES  # noqa: E402

import equations  # noqa: E402  # isort: skip
import gallery  # noqa: E402  # isort: skip
import generated  # noqa: E402  # isort: skip
import keys  # noqa: E402  # isort: skip

FROM_THE_REPOSITORY: Final = {
    "contributing": ".github/CONTRIBUTING.md",
    "changelog": "CHANGELOG.md",
    "benchmarks": "reports/benchmarks/benchmarks.md",
}
"""Pages outside of the package, which `mcnav docs` does not show."""

GENERATED: Final = {
    "gallery": gallery.page,
    "reference/commands": generated.commands,
    "reference/keys": keys.page,
    "reference/examples": generated.examples,
}

CONTENTS: Final = {
    "Tutorials": ("guide", "gallery", *(page for page in PAGES if page.startswith("tutorial-"))),
    "How to": ("questions", *(page for page in PAGES if page.startswith("howto-")), "scaling"),
    "Explanation": (
        "method", "examination", "rare-events", "theory", "report", "glossary", "notation", "tn-d1772", "story",
        "textbook", "ukfm", "other-tools",
    ),
    "Reference": (
        "commands", "reference/commands", "campaigns", "reference/keys", "reference/examples", "trajectories",
        "scenarios", "notebook", "reference/api",
    ),
    "Project": ("architecture", "decisions", "kernels", "security", "benchmarks", "contributing", "changelog"),
}  # fmt: skip
"""Every page of the site but the first, in the order of its navigation."""


@dataclass(frozen=True)
class Copied:
    """A page of the repository on the site.

    Attributes
    ----------
    name : str
        On the site, without an ending.
    file : Path
        From the root of the repository.
    """

    name: str
    file: Path


def copied_pages() -> list[Copied]:
    """List the pages that are copied; the first one is the README."""
    pages = {"index": "README.md", **{page: f"mcnav/{file}" for page, file in PAGES.items()}, **FROM_THE_REPOSITORY}
    return [Copied(name, Path(file)) for name, file in pages.items()]


def linked(text: str, page: Copied, names: dict[str, str], attached: set[str]) -> str:
    """Turn the links of a page to those of the site, and make links of what it names.

    Parameters
    ----------
    names : dict of str to str
        Names of pages by their files.
    attached : set of str
        Other files that are linked; those of this page are added.
    """

    def link(found: re.Match[str]) -> str:
        target, anchor = found["target"], found["anchor"] or ""
        file = os.path.normpath(page.file.parent / target)
        if file in names:
            return f"](/{names[file]}.md{anchor})"
        attached.add(file)
        return f"](/{file})"

    def named(found: re.Match[str]) -> str:
        text = " ".join(found[1].split())  # a line may end within it
        if text.startswith("campaigns/") and text.endswith(".toml"):
            anchor = Path(text).stem.replace("_", "-")
            return f"[`{text}`](/reference/examples.md#{anchor})" if (ROOT / text).exists() else found[0]
        name = text.removeprefix("mcnav docs ") if text.startswith("mcnav docs ") else names.get(text, "")
        # some of what mcnav docs shows is no page of the site
        return f"[`{text}`](/{name}.md)" if name in names.values() and name != page.name else found[0]

    pieces = re.split(r"(^```.*?^```\n)", text, flags=re.DOTALL | re.MULTILINE)
    for i in range(0, len(pieces), 2):  # outside of blocks
        piece = re.sub(r"\]\((?!https?:|#)(?P<target>[^)#\s]+)(?P<anchor>#[^)]*)?\)", link, pieces[i])
        pieces[i] = re.sub(r"(?<!\[)`((?:mcnav\s+docs\s+[\w-]+|[\w./-]+\.md|campaigns/\w+\.toml))`", named, piece)
    return "".join(pieces)


def contents(texts: dict[str, str]) -> str:
    """Write the navigation of the site; its captions say what the pages' titles would repeat."""
    trees = []
    for caption, pages in CONTENTS.items():
        titles = [re.findall(r"^# (?:Tutorial: |How to )?(.*)$", texts[page], re.MULTILINE)[0] for page in pages]
        entries = [f"{title[:1].upper()}{title[1:]} <{page}>" for title, page in zip(titles, pages, strict=True)]
        trees.append("\n".join(["```{toctree}", f":caption: {caption}", ":hidden:", "", *entries, "```"]))
    return "\n\n".join(trees) + "\n"


def stage(folder: Path) -> None:
    """Write the sources of the site into a new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(HERE / "static", folder / "static")
    pages = copied_pages()
    # the gallery has the questions of the campaigns' page, with pictures
    names = {str(page.file): page.name for page in pages} | {"campaigns/README.md": "gallery"}
    attached = gallery.attached()
    texts = {page.name: linked((ROOT / page.file).read_text(encoding="utf-8"), page, names, attached) for page in pages}
    texts = {name: equations.with_equations(text) for name, text in texts.items()}
    texts |= {name: make() for name, make in GENERATED.items()}
    texts |= {f"reference/{page.stem}": page.read_text(encoding="utf-8") for page in (HERE / "pages").glob("*.md")}
    texts["index"] = f"{texts['index'].partition('## Documentation')[0]}\n{contents(texts)}"
    for name, text in texts.items():
        written = folder / f"{name}.md"
        written.parent.mkdir(parents=True, exist_ok=True)
        written.write_text(text, encoding="utf-8")
    for file in attached:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, folder / file)


def build(site: Path, pages: Path) -> int:
    """Build the site from the repository; return the exit status of Sphinx, 1 if there is a warning."""
    stage(pages)
    shutil.rmtree(site, ignore_errors=True)
    options = ["-W", "--keep-going", "-n", "-q", "-E", "-d", str(pages.with_name("doctrees"))]
    return build_main([*options, "-b", "html", "-c", str(HERE), str(pages), str(site)])


if __name__ == "__main__":
    site = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "site"
    status = build(site, site.with_name("pages"))
    if status == 0:
        print(f"written: {site / 'index.html'}")
    sys.exit(status)
