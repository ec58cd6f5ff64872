"""The program ``mcnav``: its commands' groups, their errors and exit statuses."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Final, ParamSpec, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException

from mcnav.cli.former import current
from mcnav.cli.printing import err, print_line, print_notes
from mcnav.execution.interrupts import RESUMES, interrupts
from mcnav.execution.shell import join_words
from mcnav.execution.supervision import STORES, own_notes

CHECK_FAILED, BAD_INPUT, SOME_FAILED, BUSY = 1, 2, 3, 4
"""Exit statuses; 0 is success, and those of interrupts are in `mcnav.execution.interrupts`."""

UNKNOWN_CHOICE = re.compile(r"(?:Value error, )?'(?P<name>.*)' is not one of (?P<known>'.*')\.?", re.DOTALL)
"""Message of typer about an unknown choice."""

PARSERS_WORDS: Final = {
    "Input should be a valid integer, unable to parse string as an integer": "expected a whole number",
    "Input should be a valid number, unable to parse string as a number": "expected a number",
    "Input should be greater than or equal to": "expected at least",
    "Input should be less than or equal to": "expected at most",
    "Got unexpected extra argument(s)": "unexpected words",
}
"""Our words for messages of the parser."""

LONGEST_CHOICE = 60
"""Characters of an unknown choice that are shown."""

GROUPS: Final = {
    "Start": ("demo", "new", "check", "run", "docs"),
    "Analyse": ("lincov", "sweep", "allocate", "tune", "identify", "judge", "filters"),
    "Look": ("show", "live", "report", "brief", "compare", "export", "replay"),
    "Documents": ("reproduce",),
}
"""Commands in the order and under the headings of ``mcnav --help``; those of ``mcnav dev`` are not listed."""

FIRST_STEPS: Final = (
    ("mcnav demo", "a demonstration: reentry of NASA TN D-1772"),
    ("mcnav new ins mine --aid gnss", "a campaign of your own"),
    ("mcnav lincov mine.toml", "its answer, in a second"),
)
"""Commands that the help ends with."""


class _Groups(TyperGroup):
    """Commands under the headings of `GROUPS`, one line each; former names and mistakes are answered in one line."""

    def make_context(self, info_name: Any, args: list[str], *others: Any, **options: Any) -> Any:
        """Parse the words of the program."""
        with _own_style():
            return super().make_context(info_name, args, *others, **options)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the name of today in place of a former one, and say so."""
        words = current(args)
        if words != args and not ctx.resilient_parsing:
            print_notes([f"mcnav {args[0]} is now: {join_words(['mcnav', *words])}"])
        return super().parse_args(ctx, words)

    def invoke(self, ctx: Any) -> Any:
        """Parse the words of a command and execute it."""
        with _own_style(ctx):
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find a command; suggest a near name for an unknown one."""
        known = [name for names in GROUPS.values() for name in names]
        if args and ctx.parent is None and args[0] not in self.commands and not args[0].startswith("-"):
            from mcnav.errors import did_you_mean, near_names
            from mcnav.physics.units import printable

            name = printable(args[0], LONGEST_CHOICE)
            near = did_you_mean(near_names(name, known))
            raise failure(f"mcnav has no command {name!r}{near or ';'} mcnav --help lists all")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands into the help."""
        listed = [name for names in GROUPS.values() for name in names]
        wide = max(map(len, listed))
        for heading, names in GROUPS.items():
            with formatter.section(heading):
                limit = formatter.width - 6 - wide
                formatter.write_dl(
                    [(f"{name:{wide}}", self.commands[name].get_short_help_str(limit)) for name in names]
                )
        with formatter.section("First steps"):
            formatter.write_dl(FIRST_STEPS)


@contextmanager
def _own_style(within: Any = None) -> Iterator[None]:
    """Turn what the parser refuses into a line like all others, with the command whose help says more."""
    try:
        yield
    except TyperException as wrong:
        if str(wrong).startswith("Usage:") or isinstance(
            wrong, typer.Exit | typer.Abort
        ):  # help without words, or an end
            raise
        context = getattr(wrong, "ctx", None)
        said = _said(wrong)
        command = "mcnav" if context is None else context.command_path
        if context is None and within is not None:  # an option without its value says not of which command
            command = f"{within.command_path} {within.invoked_subcommand or ''}".rstrip()
        raise failure(f"{said}{' ' if said.endswith('?') else '; '}{command} --help lists what it takes") from None


def _said(wrong: TyperException) -> str:
    """Return what the parser refuses: the option or argument, what is wrong, and the nearest option there is."""
    from mcnav.errors import did_you_mean, near_names
    from mcnav.physics.units import printable

    if (option := getattr(wrong, "option_name", None)) is not None:
        if not hasattr(wrong, "possibilities"):
            return f"{option}: {'needs a value' if 'requires' in str(wrong) else 'takes no value'}"
        near = near_names(option.lstrip("-"), [each.lstrip("-") for each in wrong.possibilities or ()])
        return f"{option}: no such option{did_you_mean([f'--{each}' for each in near])}"
    message, parameter = getattr(wrong, "message", "") or "is missing", getattr(wrong, "param", None)
    if message.startswith("Input should") and (errors := getattr(wrong.__cause__, "errors", None)) is not None:
        message = f"got {printable(str(errors()[0]['input']), LONGEST_CHOICE)!r}; {message}"
    for theirs, ours in PARSERS_WORDS.items():
        message = message.replace(theirs, ours)
    if parameter is None:
        return f"{message[:1].lower()}{message[1:]}".rstrip(".")
    argument = parameter.param_type_name == "argument"
    name = (parameter.metavar or parameter.name.upper()) if argument else max(parameter.opts, key=len)
    return f"{name.strip('[]')}: {message.rstrip('.')}"


app = typer.Typer(
    cls=_Groups, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None, add_completion=True
)

new = typer.Typer(no_args_is_help=True, help="Write a new campaign or scenario, ready to run.")

dev = typer.Typer(
    no_args_is_help=True, help="Print the schema for editors, compile beforehand, or measure error rates."
)

Parameters = ParamSpec("Parameters")

Result = TypeVar("Result")


def failure(message: str, status: int = BAD_INPUT) -> typer.Exit:
    """Print what is wrong, a line each; return the end of the program with a status."""
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False)
    return typer.Exit(status)


@contextmanager
def _reported_errors(file: Path | None, given: Path | None) -> Iterator[None]:
    """Turn errors that the user can fix into messages and an exit status.

    Those of scenarios name the campaign file, and where memory is short what was given.
    """
    from mcnav.contract.errors import ScenarioError, SimulationFailed
    from mcnav.errors import (
        CampaignError,
        ClusterError,
        NumericalError,
        Problem,
        RunFolderBusy,
        RunFolderError,
        TooManyFailures,
    )

    try:
        yield
    except RunFolderBusy as problem:
        raise failure(str(problem), BUSY) from None
    except TooManyFailures as problem:
        raise failure(f"{problem}; {RESUMES.format(' without --max-failures')}", SOME_FAILED) from None
    except MemoryError:
        place = f"{given}: " if given else ""
        remedy = f"; {RESUMES.format('')} (fewer --jobs need less)" if interrupts.resumes else ""
        raise failure(f"{place}not enough memory{remedy}") from None
    except ScenarioError as problem:
        raise failure(str(Problem(str(file or ""), f"scenario.{problem.key}", str(problem)))) from None
    except SimulationFailed as problem:
        raise failure(str(Problem(str(file or ""), "scenario", str(problem)))) from None
    except (CampaignError, ClusterError, RunFolderError) as problem:
        raise failure(str(problem)) from None
    except NumericalError as problem:
        raise failure(str(Problem(str(file or given or ""), "", str(problem)))) from None
    except OSError as problem:
        raise failure(f"{problem.filename or 'a file'}: {problem.strerror or problem}") from None
    except BaseException as problem:
        if interrupts.received or (line := _of_own_code(problem)) is None:
            raise
        raise failure(str(Problem(str(file or ""), "scenario", line))) from None


def _of_own_code(problem: BaseException) -> str | None:
    """Describe an exception that a user's code has raised; none for others."""
    if "mcnav.systems.user.code" not in sys.modules:
        return None
    from mcnav.systems.sample_loop import format_exception
    from mcnav.systems.user.code import file_that_raised

    code = file_that_raised(problem)
    return None if code is None else f"{code}: {format_exception(problem, code)}"


class SuggestingCommand(TyperCommand):
    """A command that suggests the choice that an unknown one was meant for, and the closest of a long list."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments of a command."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as wrong:
            wrong.message = _with_suggestion(str(wrong.message))
            raise


def _with_suggestion(message: str) -> str:
    """Shorten the message about an unknown choice, and suggest a near one; others are left.

    >>> _with_suggestion("Value error, 'tnd1772' is not one of 'tn-d1772', 'textbook'.")
    "'tnd1772' is unknown; did you mean 'tn-d1772'? It is one of tn-d1772, textbook"
    """
    parts = UNKNOWN_CHOICE.fullmatch(message)
    if parts is None:
        return message
    from mcnav.errors import suggestion
    from mcnav.physics.units import printable

    name, known = parts["name"], re.findall(r"'([^']*)'", parts["known"])
    return f"'{printable(name, LONGEST_CHOICE)}' is unknown{suggestion(name, known)}"


def set_resumes(resumes: bool) -> None:
    """Note whether the command that runs stores samples, and continues where it was interrupted."""
    interrupts.resumes = resumes
    if (notes := own_notes()) is not None:
        notes.numbers[STORES] = resumes


def command(
    name: str | None = None, group: typer.Typer = app, resumes: bool = False
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Add a command whose errors are reported; its parameter ``campaign``, if any, is the file that they name.

    One that ``resumes`` stores samples, and continues where it was interrupted.
    """

    def add(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        @wraps(function)
        def command(*arguments: Parameters.args, **options: Parameters.kwargs) -> Result:
            set_resumes(resumes)
            file, folder = (
                each if isinstance(each := options.get(name), Path) else None for name in ("campaign", "folder")
            )
            with _reported_errors(file, file or folder):
                return function(*arguments, **options)

        group.command(name, cls=SuggestingCommand)(command)
        return command

    return add


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print_line(f"mcnav {version('mcnav')}")
        except PackageNotFoundError:
            raise failure("mcnav is not installed here, so its version is unknown") from None
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Test the linear covariance analysis of an inertial navigation system by Monte Carlo simulation."""


app.add_typer(new, name="new")
app.add_typer(dev, name="dev", hidden=True)
