"""Output and errors of a command: in any encoding, and when nobody reads them, they never end its work.

Windows has cp1252 or cp437 in a pipe, a C locale has ASCII, and a name of a file may have bytes that are no text at
all. What an encoding lacks is replaced by letters that read alike, or by a question mark.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import sys
import unicodedata
from pathlib import Path
from typing import Any, Final

ALIKE: Final = {
    "−": "-", "–": "-", "—": "-", "‑": "-", "×": "x", "·": "*", "÷": "/", "±": "+-", "≤": "<=", "≥": ">=", "≈": "~",
    "→": "->", "√": "sqrt", "½": "1/2", "…": "...", "°": "deg", "µ": "u", "μ": "u", "′": "'", "″": '"', "‘": "'",
    "’": "'", "“": '"', "”": '"', "•": "*", "│": "|", "─": "-", "━": "-", "✓": "yes", "✗": "no",
}  # fmt: skip
"""Letters in place of signs: a minus sign that becomes a question mark would change a number."""

POWERS: Final = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
"""Raised signs in the order of those below."""

LEVEL: Final = str.maketrans(POWERS, "-0123456789")

NOBODY_READS: Final = {errno.EPIPE, errno.ESHUTDOWN} | ({errno.EINVAL} if os.name == "nt" else set())
"""Numbers of the errors of a pipe whose reader has gone."""

HANDLER: Final = "mcnav.alike"


def _replace(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace what an encoding lacks; an error handler of `codecs`.

    >>> codecs.register_error(HANDLER, _replace)
    >>> "−4.4×10⁻⁶ µg, 1σ, m², Käse".encode("ascii", HANDLER).decode()
    '-4.4x10^-6 ug, 1sigma, m^2, Kase'
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text, places = error.object, range(error.start, error.end)
    return "".join(_alike(text[at], at == 0 or text[at - 1] not in POWERS) for at in places), error.end


def _alike(sign: str, begins: bool) -> str:
    """Return letters of ASCII for a sign, a question mark where none read alike; a raised one may begin a power."""
    if sign in POWERS:
        return "^" * begins + sign.translate(LEVEL)
    if sign in ALIKE:
        return ALIKE[sign]
    if unicodedata.combining(sign):
        return ""
    letters = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode()[:1]
    greek = re.fullmatch(r"GREEK (?:SMALL|CAPITAL) LETTER (?:FINAL )?(\w+)", unicodedata.name(sign, ""))
    return letters or (greek[1].lower() if greek else "?")


class _Unread(io.RawIOBase):
    """A raw stream that takes what is written after its reader has gone, as ``mcnav show | head -1`` leaves it."""

    def __init__(self, raw: Any) -> None:
        self._raw = raw

    def write(self, content: Any) -> int | None:  # none is written where it would block
        """Write bytes; all of them count as written where nobody reads."""
        try:
            written: int | None = self._raw.write(content)
        except OSError as failure:
            if failure.errno not in NOBODY_READS:
                raise
            return len(content)
        return written

    def writable(self) -> bool:
        """Return that it can be written."""
        return True

    def fileno(self) -> int:
        """Return the descriptor."""
        return int(self._raw.fileno())

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return bool(self._raw.isatty())


def tolerate() -> None:
    """Let output and errors of this process be written in any encoding, and when they are closed."""
    codecs.register_error(HANDLER, _replace)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed before the process began
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8", errors=HANDLER))  # noqa: SIM115  # until the end
        elif type(stream) is io.TextIOWrapper and stream.errors != HANDLER:
            stream.flush()
            # without buffers, as by python -u, the buffer is the raw stream itself
            raw = getattr(stream.buffer, "raw", None)
            buffer: Any = _Unread(stream.buffer) if raw is None else io.BufferedWriter(_Unread(raw))
            own = io.TextIOWrapper(buffer, stream.encoding, HANDLER, None, stream.line_buffering, stream.write_through)
            setattr(sys, name, own)


def writes_any_text() -> bool:
    """Return whether standard output is in an encoding that has every character."""
    return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name.startswith("utf")
