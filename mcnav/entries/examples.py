"""Example campaigns: in the package where it is installed, else in the checkout."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.files.whole import write_whole

FOLDER: Final = "campaigns"

FIRST: Final = "01_tn_d1772_trajectory_4"
"""Name of the first example."""

ENDINGS: Final = (".toml", ".py", ".csv", ".md")

_HEADER: Final = re.compile(r"\A(?:#.*\n)+")
_ANSWER: Final = re.compile(r"Expected answer(?: \((.*?)\))?:")
"""Begin of an answer; brackets hold the command that gives it, unless this is ``mcnav run``."""


def examples_folder() -> Path:
    """Return the folder of the examples.

    ``setup.py`` copies it into the package when this is built. Raises `CampaignError` when there is none.
    """
    package = Path(__file__).parents[1]
    for folder in (package / FOLDER, package.parent / FOLDER):
        if (folder / f"{FIRST}.toml").is_file():
            return folder
    raise CampaignError([Problem(str(package / FOLDER), "", "the example campaigns are missing; install mcnav again")])


def examples() -> Mapping[str, str]:
    """Return the question that each example answers, by the name of its file."""
    files = sorted(examples_folder().glob("*.toml"))
    return {path.stem: question_and_answer(path.read_text(encoding="utf-8"))[0] for path in files}


def question_and_answer(text: str) -> tuple[str, str]:
    r"""Split the comments with which an example begins.

    >>> question_and_answer("# Question: is it\n# so?\n# Expected answer (mcnav lincov): yes.\nname = 1")
    ('is it so?', 'yes.')
    """
    header = _HEADER.match(text)
    prose = " ".join(line.removeprefix("#").strip() for line in header[0].splitlines()) if header else ""
    question, *_, answer = _ANSWER.split(" ".join(prose.split()), maxsplit=1) if _ANSWER.search(prose) else (prose, "")
    return question.removeprefix("Question:").strip(), answer.strip()


def example(name: str) -> Path:
    """Return the file of an example by its name or its number.

    Raises `CampaignError` when there is no such example.
    """
    names = list(examples())
    known = example_name(name, names)
    if known is None:
        message = f"no example {name!r:.60}{suggestion(name, names)}"
        if name.isdecimal():
            message = f"no example {name!r:.60}; they are numbered from 1 to {len(names)}, and --list shows them"
        raise CampaignError([Problem("NAME", "", message)])
    return examples_folder() / f"{known}.toml"


def example_name(name: str, names: Sequence[str]) -> str | None:
    """Return the example that a name or a number stands for, if any.

    >>> example_name("2", ["01_reentry", "02_cruise"])
    '02_cruise'
    """
    return next((each for each in names if each == name or begins_with_number(each, name)), None)


def begins_with_number(stem: str, number: str) -> bool:
    """Tell whether the name of a file such as ``05_reentry`` begins with a number such as ``5``.

    >>> begins_with_number("05_reentry", "5"), begins_with_number("05_reentry", "50")
    (True, False)
    """
    first = stem.partition("_")[0]
    return all(digits.isdecimal() and len(digits) <= 4 for digits in (first, number)) and int(first) == int(number)


def copy_examples(folder: Path) -> list[Path]:
    """Copy the examples and the files that they read into a folder; return the copies.

    Raises `CampaignError` when one of them exists there with another content.
    """
    source = examples_folder()
    result = {path.name: path.read_bytes() for path in sorted(source.iterdir()) if path.suffix in ENDINGS}
    present = {folder / name: content for name, content in result.items() if (folder / name).exists()}
    other = [path for path, content in present.items() if not path.is_file() or path.read_bytes() != content]
    if other:
        message = "exists already with another content; choose another folder"
        raise CampaignError([Problem(str(path), "", message) for path in other])
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in result.items():
        write_whole(folder / name, content)
    return [folder / name for name in result]
