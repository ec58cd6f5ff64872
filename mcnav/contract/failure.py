"""Failed samples: why they failed, and how sample files and reports state it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

OK: Final = "ok"
"""Status of a sample that succeeded."""

_PREFIX: Final = "failed: "
_NUMBER: Final = re.compile(r"-?\d+(?:[.,]\d+)*(?:e[+-]?\d+)?")


class Reason(StrEnum):
    """Kind of a failure."""

    NOT_FINITE = "an output is not finite"
    PROCESS_DIED = "the worker process died while flying it"
    TIMEOUT = "the sample exceeded its time"
    DIVERGED = "the indicated trajectory cannot be continued"
    RAISED = "the scenario raised an exception"
    STATED = "the scenario stated a reason of its own"
    OTHERS = "other reasons"


@dataclass(frozen=True)
class Failure:
    """Failure of a sample: its message of one line, and the traceback of an unexpected exception."""

    reason: Reason
    message: str
    traceback: str = ""

    @classmethod
    def of(cls, given: Any) -> Failure:
        """Convert a reason, or the text that a user's scenario gives in its place."""
        if isinstance(given, Failure):
            return given
        return cls(given if isinstance(given, Reason) else Reason.STATED, str(given))

    def __str__(self) -> str:
        return self.message

    @property
    def status(self) -> str:
        """The sample's status in a sample file.

        >>> Failure.of("ran dry").status
        'failed: ran dry'
        """
        return _PREFIX + self.message


def message_of(status: str) -> str:
    """Return the message of a failed sample's status.

    >>> message_of("failed: ran dry")
    'ran dry'
    """
    return status.removeprefix(_PREFIX)


def without_numbers(status: str) -> str:
    """Replace numbers, in which many failures for one reason differ.

    >>> without_numbers("fell to 3.5 km")
    'fell to … km'
    """
    return _NUMBER.sub("…", status)
