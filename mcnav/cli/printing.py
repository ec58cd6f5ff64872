"""Output of commands, and pages that they open."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkstemp
from typing import Any, Literal

from mcnav.execution.streams import writes_any_text
from mcnav.report.document.fitted_table import OpenConsole

out, err = OpenConsole(highlight=False, soft_wrap=True), OpenConsole(stderr=True, highlight=False, soft_wrap=True)

Format = Literal["table", "csv", "json"]


def print_line(text: str) -> None:
    """Print a line as it is."""
    out.print(text, markup=False)


def print_notes(notes: Iterable[str]) -> None:
    """Print notes beside the output."""
    for note in notes:
        err.print(f"note: {note}", markup=False)


def print_written(paths: Iterable[Path]) -> None:
    """Print which files are written."""
    for path in paths:
        print_line(f"written: {path}")


def print_next(command: str) -> None:
    """Print the command that one would type next, below what is read by people."""
    print_line(f"\nnext: {command}")


def open_page(page: Path) -> None:
    """Show a page in the browser."""
    open_address(page.resolve().as_uri())


def open_address(address: str, what: str = "file") -> None:
    """Show an address in the browser; a note if there is none."""
    import webbrowser

    if not webbrowser.open(address):
        print_notes([f"no browser is found; open the {what} yourself"])


@contextmanager
def opened_in_secret(address: str, folder: Path) -> Iterator[None]:
    """Show an address in the browser, by a file in a folder that only this user can read, and that is deleted.

    Every user of the machine can read the command line of a browser. A browser in a sandbox of its own, such as a
    snap, may see neither the system's temporary files nor hidden ones.
    """
    folder.mkdir(parents=True, exist_ok=True)
    descriptor, name = mkstemp(prefix="open_", suffix=".html", dir=folder)  # of mode 0600
    page = Path(name).resolve()
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(
                '<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
                f'<meta http-equiv="refresh" content="0; url={address}"><title>mcnav live</title>'
            )
        open_address(page.as_uri(), "address")
        yield
    finally:
        page.unlink(missing_ok=True)


def print_rows(chosen: Format, rows: Sequence[Mapping[str, Any]], tables: Mapping[str, Any]) -> None:
    """Print rows as CSV, or tables by name as JSON."""
    from mcnav.report.exports import export

    write_data(export.as_csv(rows) if chosen == "csv" else export.as_json(tables), chosen)


def write_data(text: str, form: Format) -> None:
    """Write CSV or JSON; where the encoding lacks characters, JSON escapes them and loses nothing."""
    sys.stdout.write(text if form != "json" or writes_any_text() else escaped(text))


def escaped(text: str) -> str:
    r"""Escape the characters of a JSON text that are not in ASCII.

    >>> print(escaped('{"unit": "°"}'))
    {"unit": "\u00b0"}
    """
    return re.sub(r"[^\x00-\x7f]", lambda sign: json.dumps(sign[0])[1:-1], text)
