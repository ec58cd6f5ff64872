"""Errors that scenarios and their simulation may raise."""

from __future__ import annotations


class ScenarioError(ValueError):
    """A scenario that cannot be simulated as described; `key` names the entry that would have to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[str, str]]:
        return type(self), (self.key, str(self))


class SimulationFailed(ArithmeticError):
    """Failure of a sample that a derivative needs."""
