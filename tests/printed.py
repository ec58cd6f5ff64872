"""Pages of the documentation as scripts: their files are written, their commands run, and their output is compared.

In a page, a block of `sh` has commands, a block of `console` commands after `$` with their output, and one of `pycon`
lines of Python after `>>>` with theirs. A line `…` stands for any lines, `…` at the end of a line for the rest of it. A
block of another language is written to the file that its first line names, as in `# mine.toml`, if it does so.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from mcnav.execution.progress import COMPILATION
from tests.commands import invoke
from tests.sentences import printed_sentences

INTEGRATED = 1e-10
"""Share of a number that its integration may miss: ten times the coarsest tolerance of all truths."""

NUMBER = re.compile(r"[-−+]?\d+(?:,\d+)*(?:\.\d+)?(?:e[-+]?\d+)?")
REST = "…"


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str


def blocks(text: str) -> list[Block]:
    """List the fenced blocks of a page, in order."""
    found = re.findall(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [Block(language, content) for language, content in found]


def same_text(shown: str, printed: str) -> bool:
    """Compare a line of a page with one of output, without regard to spaces.

    Numbers may differ by one unit of the last digit shown, because another processor may round a sum differently, and
    by `INTEGRATED` of them, because it may then choose other steps.
    """
    if shown.rstrip().endswith(REST):
        shown = shown.rstrip().removesuffix(REST)
        words = len(shown.split())
        printed = " ".join(printed.split()[:words])
    shown, printed = " ".join(shown.split()), " ".join(printed.split())
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    return all(_same_number(*pair) for pair in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True))


def _same_number(shown: str, printed: str) -> bool:
    mantissa, _, exponent = shown.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    first, second = (float(each.replace("−", "-").replace(",", "")) for each in (shown, printed))
    return abs(first - second) <= max(1.01 * unit, INTEGRATED * abs(second))


EXAMINED: Final = "Linear analysis"
"""Beginning of the line of `lincov` on its examination, which is made where the simulator is compiled already."""


def missing_line(shown: str, printed: str) -> str | None:
    """Return the first line of a page that is not in the output where it should be; none if all are."""
    lines = [line for line in printed.splitlines() if line.strip()]
    if not any(line.startswith(EXAMINED) for line in shown.splitlines()):
        lines = [line for line in lines if not line.startswith(EXAMINED)]
    anywhere = False
    for line in filter(str.strip, shown.splitlines()):
        if line.strip() == REST:
            anywhere = True
            continue
        places = range(len(lines)) if anywhere else range(min(1, len(lines)))
        found = next((i for i in places if same_text(line, lines[i])), None)
        if found is None:
            return line
        lines, anywhere = lines[found + 1 :], False
    return None if anywhere or not lines else f"{REST} (in place of {lines[0]!r})"


def entries(block: Block) -> Iterator[tuple[str, str | None]]:
    """Yield the commands of a block of `sh` or `console`, and the output shown for each."""
    if block.language == "sh":
        yield from ((line, None) for line in block.text.splitlines() if line)
        return
    for entry in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
        command, _, shown = entry.partition("\n")
        yield command, shown


@dataclass
class Session:
    """A reader who follows a page in a folder.

    Attributes
    ----------
    place : Path
        Folder in which everything runs.
    names : dict
        What the lines of Python have defined.
    done : int
        Commands and lines of Python that have been run.
    """

    place: Path
    names: dict[str, Any] = field(default_factory=dict)
    done: int = 0

    def follow(self, block: Block) -> None:
        """Do what a block says, and compare what is printed; `AssertionError` names the command."""
        if block.language in ("sh", "console"):
            for command, shown in entries(block):
                self.run(command, shown)
        elif block.language == "pycon":
            for example in doctest.DocTestParser().get_examples(block.text):
                self.execute(example.source, example.want)
        elif named := re.match(r"# ([\w/]+\.(?:toml|py))\n", block.text):
            (self.place / named[1]).write_text(block.text, encoding="utf-8")

    def run(self, command: str, shown: str | None) -> None:
        """Run a command of mcnav; the files that it says it has written must exist, and its sentences be short.

        An exit status other than 0 is shown as ``exit status N``, the last line.
        """
        program, *arguments = shlex.split(command, comments=True)
        assert program == "mcnav", command
        with patch.object(COMPILATION, "refusing", contextlib.nullcontext):  # as where code is compiled already
            finished = invoke(*arguments, cwd=self.place, columns=160)
        self.done += 1
        output = finished.stdout + finished.stderr
        if "--format" not in arguments:
            assert printed_sentences(finished.stdout) == [], command
        output += f"exit status {finished.returncode}\n" if finished.returncode else ""
        for written in re.findall(r"^(?:written|report|summary): (.*)$", finished.stdout, re.MULTILINE):
            assert (self.place / written).exists(), f"{command}: {written}"
        if shown is None or "exit status" not in shown:
            assert finished.returncode == 0, f"{command}\n{output}"
        if shown is None:
            return
        missing = missing_line(shown, output)
        assert missing is None, f"{command}\nshown:   {missing}\nprinted:\n{output}"

    def execute(self, source: str, shown: str) -> None:
        """Execute a line of Python, as an interpreter does."""
        with contextlib.chdir(self.place), contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(source, "<page>", "single"), self.names)
        self.done += 1
        missing = missing_line(shown, printed.getvalue())
        assert missing is None, f"{source}\nshown:   {missing}\nprinted:\n{printed.getvalue()}"


def follow(text: str, place: Path) -> Session:
    """Follow a page from its first block to its last."""
    session = Session(place)
    for block in blocks(text):
        session.follow(block)
    return session


def count_scripts(page: str) -> int:
    """Count the scripts of a page that a browser executes: data that a script reads are none."""
    return page.count("<script") - page.count('<script type="application/json">')
