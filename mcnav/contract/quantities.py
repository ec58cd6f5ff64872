"""Quantities of a system: errors going in and errors coming out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol

Of = Literal["navigation", "truth", "control", "time"]
"""Kind of a quantity: navigation error, dispersion of the truth, control effort, or time of an event."""

TRUE, NAVIGATED = "true_", "navigated_"
"""Beginnings of the names of outputs of truth: of the vehicle itself, and of where its navigator says that it is."""

NAVIGATION_ERRORS, TRUE_DISPERSION = "Navigation errors", "True dispersion"
NAVIGATION_DISPERSION = "Navigation dispersion"
COMMANDS, TIMES = "Commands and corrections", "Times of events"
KINDS: Final = (NAVIGATION_ERRORS, TRUE_DISPERSION, NAVIGATION_DISPERSION, COMMANDS, TIMES)
"""Kinds of outputs in the order in which tables list them."""


def may_be_share(unit: str, group: str) -> bool:
    """Return whether errors of a group may be shares such as "1 %": those of an input that another axis reads."""
    return unit == "rad" and group.endswith("_misalignment")


@dataclass(frozen=True)
class Source:
    """An error that goes in.

    Attributes
    ----------
    name : str
    unit : str
        SI unit of its values.
    shown_in : str
        Unit in which tables and reports show it.
    nominal : float
        A usual size, in the SI unit: the scale of the steps that differences take.
    later : bool
        Whether the scenario had other sources before this one: see `mcnav.sampler.error_model.ErrorModel`.
    group : str
        Sources that belong together; an entry of ``[errors]`` with this name holds for each.
    of : str
        What it is of; see `Of`.

    Examples
    --------
    >>> import mcnav as mc
    >>> gyro = mc.Source("gyro_bias", "rad/s", "deg/h", 4.8e-8)
    >>> gyro.unit, gyro.shown_in
    ('rad/s', 'deg/h')
    """

    name: str
    unit: str
    shown_in: str
    nominal: float
    later: bool = False
    group: str = ""
    of: Of = "navigation"

    @property
    def shares(self) -> bool:
        """Whether an entry may be a share; see `may_be_share`."""
        return may_be_share(self.unit, self.group)


@dataclass(frozen=True)
class Output:
    """An error that comes out; name and units as those of `Source`.

    Attributes
    ----------
    limit : float, optional
        Size of the error, SI, beyond which the linear system that it belongs to has lost its meaning.
    of : str
        What it is of; see `Of`. A filter states the covariance of navigation errors alone.
    size_of : tuple of str
        Outputs in its unit whose root sum of squares it is: it is not normal, and not linear where they are zero.
    departs : bool
        True of the departure of a state from the nominal flight. The state itself is the output and what it is measured
        from, `mcnav.contract.linear.LinearSystem.origin`; requirements limit the state unless they say otherwise.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Output("range", "m", "km").shown_in
    'km'
    """

    name: str
    unit: str
    shown_in: str
    limit: float | None = None
    of: Of = "navigation"
    size_of: tuple[str, ...] = ()
    departs: bool = False


class _OfKind(Protocol):
    """Part of an output that `kind_of` reads."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def of(self) -> Of:
        """Kind of quantity."""


def kind_of(output: _OfKind) -> str:
    """Return which of `KINDS` an output is.

    >>> kind_of(Output("true_range", "m", "km", of="truth")), kind_of(Output("range", "m", "km"))
    ('True dispersion', 'Navigation errors')
    """
    if output.of == "truth":
        return NAVIGATION_DISPERSION if output.name.startswith(NAVIGATED) else TRUE_DISPERSION
    return {"navigation": NAVIGATION_ERRORS, "control": COMMANDS, "time": TIMES}[output.of]


def kinds_of(outputs: Sequence[_OfKind]) -> list[str]:
    """Return the kind of each output; empty strings where all are navigation errors, and need not be told apart."""
    kinds = [kind_of(output) for output in outputs]
    return kinds if set(kinds) - {NAVIGATION_ERRORS} else [""] * len(kinds)


@dataclass(frozen=True)
class EndWords:
    """Names of outputs at the end: one of them, many, and the heading of their column in a narrow table."""

    one: str
    many: str
    heading: str

    @property
    def title(self) -> str:
        """Many of them at the beginning of a sentence."""
        return self.many[0].upper() + self.many[1:]


FINAL_ERRORS: Final = EndWords("final error", "final errors", "final error, 1σ")
AT_END: Final = EndWords("output at the end", "outputs at the end", "at the end, 1σ")


def end_words(outputs: Iterable[_OfKind]) -> EndWords:
    """Return what outputs at the end are called: errors where all are, since dispersions, efforts and times are none.

    >>> end_words([Output("range", "m", "km")]).many, end_words([Output("final_time", "s", "s", of="time")]).title
    ('final errors', 'Outputs at the end')
    """
    return FINAL_ERRORS if {kind_of(output) for output in outputs} <= {NAVIGATION_ERRORS} else AT_END


def source_labels(sources: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Name error sources for people.

    A source that shares its name with an output is an initial error of it; it is called so, to tell them apart.

    Parameters
    ----------
    sources, outputs : sequence of str
        Names, as files have them.

    >>> source_labels(["altitude", "gyro_drift"], ["altitude", "range"])
    ['initial altitude', 'gyro drift']
    """
    taken = {*sources, *outputs}

    def label(name: str) -> str:
        if name not in outputs:
            return name
        return f"initial_{name}" if f"initial_{name}" not in taken else f"{name}_(error source)"

    return [label(name).replace("_", " ") for name in sources]
