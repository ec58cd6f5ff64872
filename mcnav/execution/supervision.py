"""A command that executes a user's code, and the process that starts it and says how it ended.

The user's code may end its process without a word: ``os._exit``, ``STOP`` of Fortran, a crash. Such a command is
therefore a copy of a small process, its supervisor, with the same terminal, signals and exit status. It leaves notes
in memory that both share. They outlast it, and need none of its files to be open. Systems that cannot copy a process
have no supervisor.
"""

from __future__ import annotations

import atexit
import mmap
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NoReturn

ENDED_BY_CODE: Final = 2
"""Exit status of a command that its user's code has ended."""

ENDED, PASSED_ON, STORES, LATE = range(4)
"""Numbers of the notes: exit status plus one, signals that the supervisor has passed on, whether samples are stored,
and when code will be ended that does not listen to its time limit (`time.monotonic`, zero without one)."""

ENDED_LATE: Final = 1
"""Exit status of a process that `faulthandler` ends."""

PLACES: Final = 24
"""Threads whose places in the user's code are noted."""

LAST_WORDS: Final = PLACES
"""Line of the notes with what the supervisor says for the command."""

_NUMBERS, _LENGTH = 16, 1_024
"""Bytes of all numbers, and of a line."""

_LARGEST: Final = 1_000_001
"""Bytes of a file that are looked at: a campaign file has fewer."""

_OUTSIDE: Final = "while none of your functions ran (a thread or handler that they left may have ended it)"

_SIGNALS: Final = {signal.SIGINT: 130, signal.SIGTERM: 143}
"""Signals that end a command, and the exit statuses that follow."""

_CRASHES: Final = ("SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL", "SIGABRT", "SIGTRAP", "SIGSYS")


class Notes:
    """Notes of a command for its supervisor, in memory that copies of a process share."""

    SIZE: Final = _NUMBERS + (PLACES + 1) * _LENGTH

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, self.SIZE)
        self.numbers = memoryview(self._memory)[:_NUMBERS].cast("i")

    def write(self, line: int, text: str) -> None:
        """Replace a line."""
        begin = _NUMBERS + line * _LENGTH
        self._memory[begin : begin + _LENGTH] = text.encode(errors="replace")[:_LENGTH].ljust(_LENGTH, b"\0")

    def read(self, line: int) -> str:
        """Return a line, which is empty where nothing is noted."""
        begin = _NUMBERS + line * _LENGTH
        return self._memory[begin : begin + _LENGTH].rstrip(b"\0").decode(errors="ignore")


_own: list[Notes] = []


def own_notes() -> Notes | None:
    """Return the notes of this process; none without a supervisor."""
    return _own[0] if _own else None


def end(status: int) -> None:
    """End the process at once, and note for a supervisor that it is meant to end."""
    if _own:
        _own[0].numbers[ENDED] = status + 1
    os._exit(status)


def names_code(arguments: Sequence[str]) -> bool:
    """Return whether a command may execute a user's code, by its arguments and the files that these name.

    It may also be true of a campaign without code that mentions such a file, or has escapes. What ``live`` serves may
    change while it runs.
    """
    if not hasattr(os, "fork"):
        return False
    return arguments[:1] == ["live"] or any(".py" in argument or _mentions_code(argument) for argument in arguments)


def _mentions_code(argument: str) -> bool:
    path = Path(argument.partition("=")[2] if argument.startswith("-") else argument)
    with suppress(OSError, ValueError):
        if path.is_file():
            with path.open("rb") as file:
                content = file.read(_LARGEST).replace(b"\0", b"")  # of UTF-16
            return any(sign in content for sign in (b".py", rb"\u", rb"\U"))
    return False


def supervise() -> int | None:
    """Continue this program in a copy of its process, and return the exit status of the copy; in the copy, none.

    This process prints how the copy ended where it could not. Signals are passed on, though the copy may have had them
    from the terminal as well: it counts them. A second one ends it at once. What is imported so far serves both: a
    program that started once more would take a tenth of a second.
    """
    notes, received, program = Notes(), list[int](), os.getpid()

    def pass_on(number: int, frame: object) -> None:
        received.append(number)
        notes.numbers[PASSED_ON] = len(received)
        with suppress(ProcessLookupError):
            os.kill(child, number if len(received) == 1 else signal.SIGKILL)

    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)  # until both have their handlers
    child = os.fork()
    if not child:
        _attach(notes, program)
        return None
    for number in _SIGNALS:
        signal.signal(number, pass_on)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if notes.numbers[ENDED]:
        return notes.numbers[ENDED] - 1
    if sys.stderr is not None:
        cursor = "\x1b[?25h" if sys.stderr.isatty() else ""  # which progress may have hidden
        print(f"{cursor}error: {_last_words(notes, status)}", file=sys.stderr, flush=True)
    return _SIGNALS[signal.Signals(received[0])] if received else ENDED_BY_CODE


def _attach(notes: Notes, supervisor: int) -> None:
    """Attach this process to its supervisor, which it does not outlive."""
    from mcnav.execution.child_processes import follow_parent

    _own.append(notes)
    follow_parent(supervisor)


def unblock_signals() -> None:
    """Let signals come that have waited since this process was made (`supervise`)."""
    if _own:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


def give_up(words: str) -> NoReturn:
    """End the process; its supervisor says why."""
    _own[0].write(LAST_WORDS, words)
    os._exit(ENDED_BY_CODE)


def _last_words(notes: Notes, status: int) -> str:
    """Say how a command ended that has not said so itself."""
    stored = "; stored samples are kept" if notes.numbers[STORES] else ""
    if notes.numbers[PASSED_ON]:
        return f"interrupted{stored}"
    if words := notes.read(LAST_WORDS):
        return words + stored
    places = sorted(filter(None, map(notes.read, range(PLACES))))
    file, *_ = places[0].split("\t") if places else ("",)
    doing = " or ".join(place.split("\t")[1] for place in places)
    where = f"in {file} {doing}" if places else _OUTSIDE
    if status == ENDED_LATE and 0 < notes.numbers[LATE] <= time.monotonic():
        return f"the program exceeded the time limit of a sample {where}, and could not be stopped{stored}"
    remedy = "; raise an exception instead" if places and status >= 0 else ""
    if "simulated sample" in doing:
        remedy = "; with sample_timeout, samples run in processes of their own, and only those at fault fail"
    return f"the program {_how(status)} {where}{stored}{remedy}"


def _how(status: int) -> str:
    """Describe the end of a process.

    >>> _how(0), _how(-11), _how(-9)
    ('ended with exit status 0', 'crashed (SIGSEGV)', 'was ended by SIGKILL')
    """
    if status >= 0:
        return f"ended with exit status {status}"
    name = signal.Signals(-status).name if -status in set(signal.Signals) else f"signal {-status}"
    return f"crashed ({name})" if name in _CRASHES else f"was ended by {name}"


@contextmanager
def supervised() -> Iterator[None]:
    """Run a command to its end and, under a supervisor, note its exit status and end the process.

    What a user's code has left behind, such as a thread that goes on, neither holds up nor changes the end.
    """
    if not _own:
        yield
        return
    try:
        yield
        status = 0
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
        status = 1
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as failure:
        print(f"error: standard output: {failure.strerror}", file=sys.stderr)
        status = ENDED_BY_CODE
    _own[0].numbers[ENDED] = status + 1  # whatever follows, and says
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    atexit._run_exitfuncs()
    os._exit(status)
