"""Arguments and options that several commands have, and what their values mean."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from mcnav.cli import shell_completion as completion
from mcnav.cli.printing import Format
from mcnav.cli.program import BAD_INPUT, failure
from mcnav.errors import CampaignError
from mcnav.execution.shell import quote_word
from mcnav.systems.templates import templates

Axes = Literal["start", "trajectory"]
TemplateType = Literal[tuple(templates())]  # type: ignore[valid-type]
Platform = Literal["strapdown", "inertial", "level"]
CampaignFile = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN",
        help="Campaign file (TOML).",
        autocompletion=completion.campaigns,
    ),
]
Folder = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", autocompletion=completion.runs)]
Folders = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.", autocompletion=completion.runs)]
PerhapsFolders = Annotated[
    list[Path] | None, typer.Argument(metavar="[RUN...]", help="Run folders.", autocompletion=completion.runs)
]
FormatOption = Annotated[
    Format, typer.Option("--format", help="Print a table, or only CSV or JSON in full precision on stdout.")
]
UnitsOption = Annotated[Literal["shown", "SI"], typer.Option(help="Units: those shown in reports, or SI.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel jobs.")]
Examine = Annotated[
    bool | None,
    typer.Option(
        "--examine/--no-examine",
        help="Simulate some flights to see where linear analysis holds [default: where that is quick].",
    ),
]
ChosenAxes = Annotated[Axes | None, typer.Option(help="Where the reference axes are aligned [default: start].")]
Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the files: letters, digits and _.")]
Into = Annotated[Path, typer.Option("--out", "-o", "--in", metavar="FOLDER", help="Output folder.")]
Engine = Annotated[
    str | None,
    typer.Option(
        help="Simulation engine: ensemble, reference or map [default: the scenario's first].",
        autocompletion=completion.engines,
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Simulate on a dask cluster, such as tcp://host:8786; see mcnav docs scaling."
    ),
]
NamedColumns = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=COLUMN", help="Column of a trajectory file, such as 'lat=latitude [rad]'; repeat."),
]


def out_folder(default: str) -> Any:
    """Return the option that names the folder of several files."""
    return typer.Option("--out", "-o", help=f"Output folder [default: {default}].")


def run_folder(campaign: Path) -> Path:
    """Return ``reports/`` with the campaign file's stem; for the copy in a run folder, that folder."""
    if campaign.name == "campaign.toml" and (campaign.parent / "manifest.json").exists():
        return campaign.parent
    return Path("reports") / campaign.stem


def pairs_of(given: Sequence[str] | None, option: str, example: str) -> dict[str, str]:
    """Read options of the form NAME=VALUE."""
    pairs = dict[str, str]()
    for pair in given or []:
        name, equals, value = pair.partition("=")
        if not equals or not value:
            raise failure(f"--{option}: got {pair!r}; expected NAME=VALUE such as {example}", BAD_INPUT)
        pairs[name.strip()] = value.strip()
    return pairs


def columns_of(
    named: Sequence[str] | None, option: str = "--column", expected: str = "NAME=COLUMN such as 'lat=latitude [rad]'"
) -> dict[str, str]:
    """Read options of the form NAME=COLUMN."""
    columns = dict[str, str]()
    for pair in named or []:
        name, equals, written = pair.partition("=")
        if not equals:
            raise failure(f"{option}: got {pair!r}; expected {expected}", BAD_INPUT)
        columns[name.strip()] = written.strip()
    return columns


@contextmanager
def options_in_messages() -> Iterator[None]:
    """Write columns and units to paste as options of the command, where a message has them as a table of a campaign."""
    try:
        yield
    except CampaignError as wrong:
        raise CampaignError(
            [replace(problem, message=as_options(problem.message)) for problem in wrong.problems]
        ) from None


def as_options(message: str) -> str:
    """Write the tables of columns and units in a message as options.

    >>> as_options('say which: columns = { gyro_x = "w x" }, units = { gyro = "rad/s" }')
    "say which: --column 'gyro_x=w x' --unit gyro=rad/s"
    """

    def options(table: re.Match[str]) -> str:
        pairs = re.findall(r'(\w+) = "([^"]*)"', table[2])
        return " ".join(f"--{table[1]} {quote_word(f'{name}={written}')}" for name, written in pairs)

    text = re.sub(r"\b(column|unit)s = \{ (.*?) \}", options, message)
    return text.replace(", --unit", " --unit") if text != message else message
