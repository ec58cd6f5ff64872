"""Values of settings, and what is wrong with them."""

from __future__ import annotations

from mcnav.physics.units import printable


class SettingError(ValueError):
    """A value of the wrong type; ``entry`` is its index in a list."""

    def __init__(self, message: str, entry: int | None = None) -> None:
        super().__init__(message)
        self.entry = entry


def display(value: object) -> str:
    """Format a value as TOML writes it, shortened to fit a line."""
    if isinstance(value, (list, dict)):
        return "a list" if isinstance(value, list) else "a table"
    return printable(str(value).lower() if isinstance(value, bool) else repr(value))
