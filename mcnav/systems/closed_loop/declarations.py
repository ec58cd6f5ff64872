"""Declarations of a user: a subclass of `ClosedLoop`, and what stands in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from mcnav.systems.closed_loop.rotations import Side


@dataclass(frozen=True)
class Attitude:
    """A rotation from body to reference axes, a state of ``truth`` and ``estimate``.

    Methods see matrices, shape (n, 3, 3), and return them where they return states; ``rates`` and ``navigate`` return
    the angular rate of the body in its own axes, shape (n, 3). Errors and dispersions are rotation vectors in rad:
    ``indicated = exp([error x]) true`` with errors in reference axes, ``true exp([error x])`` in body axes.

    Attributes
    ----------
    errors : str
        Axes of errors and dispersions: ``reference`` or ``body``.
    axes : int, str or sequence of str
        Names of these three axes.

    Examples
    --------
    >>> import mcnav as mc
    >>> class Turning(mc.ClosedLoop):
    ...     truth = {"attitude": mc.Attitude(errors="body"), "rate": ("rad/s", "xyz")}
    >>> Turning.truth["attitude"].axes
    3
    """

    errors: Side = "reference"
    axes: int | str | Sequence[str] = 3


Unit = str | tuple[str, int | str | Sequence[str]] | Attitude
"""A unit for a scalar; for a vector a unit and its axes: their number, letters such as ``"xz"``, or names; an attitude.
"""


@dataclass(frozen=True)
class White:
    """A process of white noise, by the unit of its density, such as ``m/s^2/sqrt(Hz)``.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.White("m/s^2/sqrt(Hz)", "xyz").unit
    'm/s^2/sqrt(Hz)'
    """

    unit: str
    axes: int | str | Sequence[str] = ()


@dataclass(frozen=True)
class GaussMarkov:
    """A stationary first-order Gauss-Markov process, by its unit.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.GaussMarkov("m/s^2", "xz").axes
    'xz'
    """

    unit: str
    axes: int | str | Sequence[str] = ()


@dataclass(frozen=True)
class Measurement:
    """A sensor at discrete instants: ``z = truth(...) + noise``.

    Attributes
    ----------
    name : str
    unit : str
    truth : callable
        What is measured, of the arguments that it names: time, truth, parameters, noise; shape (n,) or (n, size), or
        an attitude, shape (n, 3, 3), whose noise is a rotation vector in the body axes of that attitude.
    model : callable, optional
        The same as the navigator predicts it, of time and estimate; `truth` of the estimate unless given.
    interval : float, optional
        Seconds between measurements, the first after one interval.
    instants : sequence of float, optional
        Instants in place of an interval, s.
    phases : sequence of str
        Phases in which alone it measures, from their begin on; they and those that follow them begin at times. All
        unless given.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Measurement("altimeter", "m", truth=lambda truth: truth.altitude, interval=1.0).interval
    1.0
    """

    name: str
    unit: str
    truth: Callable[..., Any]
    model: Callable[..., Any] | None = None
    interval: float | None = None
    instants: Sequence[float] | None = None
    phases: Sequence[str] = ()


@dataclass(frozen=True)
class Trigger:
    """The first instant at which a function of truth or estimate changes its sign.

    Attributes
    ----------
    function : callable
        Of the arguments that it names: time, and truth or estimate; shape (n,).
    latest : float
        Time by which it must have happened, s; a sample that has not met it has failed. One that starts beyond the
        trigger, or that an update carries over it, meets it at once.

    Examples
    --------
    >>> import mcnav as mc
    >>> low = mc.Trigger(lambda truth: truth.altitude - 100.0, latest=900.0)
    >>> low.latest
    900.0
    """

    function: Callable[..., Any]
    latest: float


@dataclass(frozen=True)
class Phase:
    """A phase of the flight; methods that name ``phase`` get its name, and are called for one phase at a time.

    Attributes
    ----------
    name : str
    begins : float or Trigger, optional
        Time, s, or where each sample meets a trigger; none of the first. Phases follow each other in their order. A
        sample that has not met the trigger by its latest time has failed.

    Examples
    --------
    >>> import mcnav as mc
    >>> phases = mc.Phase("braking"), mc.Phase("approach", begins=300.0)
    >>> phases[1].begins
    300.0
    """

    name: str
    begins: float | Trigger | None = None


@dataclass(frozen=True)
class Correction:
    """An impulsive correction that the navigator commands.

    Attributes
    ----------
    name : str
    at : float or Trigger
        Time, s; or where each sample meets a trigger, on its own noise path. A sample that has not met it by its latest
        time, or by its end, has failed.
    target : callable
        The commanded impulse, of the arguments that it names: time, estimate; shape (n,) or (n, axes).
    apply : callable or str
        New values of the states that an impulse changes, of ``truth`` (in the navigator the estimate) and ``impulse``;
        or the name of the state to which the impulse is added.
    noise : str
        Unit of the impulse and of its execution error, whose sigma an axis is sized in ``[processes]``.
    known : str
        Whether the navigator adds the impulse as ``commanded`` or as ``executed``.

    Examples
    --------
    >>> import mcnav as mc
    >>> burn = mc.Correction("burn", at=100.0, target=lambda estimate: -estimate.velocity)
    >>> burn.name, burn.at
    ('burn', 100.0)
    """

    name: str
    at: float | Trigger
    target: Callable[..., Any]
    apply: Callable[..., Any] | str = "velocity"
    noise: str = "m/s"
    known: Literal["commanded", "executed"] = "commanded"


@dataclass(frozen=True)
class Filter:
    """Error-state Kalman filter of the navigator.

    Attributes
    ----------
    estimates : sequence of str, optional
        Estimated quantities that it corrects; all unless given.
    considers : sequence of str
        Parameters and Gauss-Markov processes whose uncertainty it knows without estimating them.
    gains : str
        ``own``: each sample's covariance, along its own estimate; ``nominal``: gains planned along the nominal.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Filter(gains="nominal").gains
    'nominal'
    """

    estimates: Sequence[str] | None = None
    considers: Sequence[str] = ()
    gains: Literal["own", "nominal"] = "own"


class ClosedLoop:
    """A vehicle that is steered by what it navigates; subclasses state the pieces of the loop.

    Methods are vectorised over n samples and get the arguments that they name, out of time (n,), truth, estimate,
    command, sensed, parameters, noise. ``truth.velocity`` is (n,) for a scalar, (n, axes) for a vector.

    Attributes
    ----------
    truth, estimate : mapping of str to str or tuple
        States by name, with their units and axes; the estimate is as the truth unless given.
    parameters : mapping of str to str or tuple
        Constant errors of the truth; zero in the nominal.
    processes : mapping of str to White or GaussMarkov
    measurements : sequence of Measurement
    corrections : sequence of Correction
    phases : sequence of Phase
        At a phase's begin rates may jump; a command is held until the next one.
    filter : Filter, optional
        Or methods ``update`` and ``covariance`` in its place: ``update`` returns new values of estimate and memory, of
        the arguments that it names: time, name (of the measurement), measured, innovation, estimate, memory; and
        ``covariance``, of time, estimate, memory, what it says of all navigation errors after updates, shape (n, k, k).
    memory : mapping of str to str or tuple
        What the navigator remembers besides its estimates, by name; ``start`` may give its values, ``navigate`` its
        rates, ``update`` and ``guide`` (beside the command) new values.
    cycle : float, optional
        Time between commands, s; none for guidance that is continuous.
    step : float, optional
        Longest step of Runge-Kutta's method, s; the cycle unless given.
    end : float or Trigger
    navigator_start : str
        ``truth``: the estimate starts as the sample's truth plus its errors; ``nominal``: as the nominal plus these.
    command : str or tuple, optional
        Unit, and axes, of what ``guide`` returns.
    navigator : Strapdown, optional
        An inertial navigator, which brings states, errors and methods of its own.

    A method ``outputs`` returns further outputs with their units, ``{"miss": (values, "m")}``, of the arguments that it
    names: time, truth, estimate, command, parameters, memory. Of truth or estimate alone they are dispersions, of both
    navigation errors; ``(values, "m", of)`` says otherwise.

    Examples
    --------
    >>> import mcnav as mc
    >>> class Descent(mc.ClosedLoop):
    ...     truth = {"altitude": "m", "speed": "m/s"}
    ...     cycle, end = 1.0, 60.0
    ...     def rates(self, truth, command):
    ...         return {"altitude": truth.speed, "speed": command}
    ...     def guide(self, estimate):
    ...         return -0.05 * estimate.altitude - 0.4 * estimate.speed
    >>> draws = mc.Errors({"altitude": "100 m", "speed": 2.0}).draw(50, seed=1)
    >>> mc.simulate(Descent, draws)[["true_altitude", "true_speed"]].shape
    (50, 2)
    """

    truth: ClassVar[Mapping[str, Unit]] = {}
    estimate: ClassVar[Mapping[str, Unit] | None] = None
    parameters: ClassVar[Mapping[str, Unit]] = {}
    processes: ClassVar[Mapping[str, White | GaussMarkov]] = {}
    measurements: ClassVar[Sequence[Measurement]] = ()
    corrections: ClassVar[Sequence[Correction]] = ()
    phases: ClassVar[Sequence[Phase]] = ()
    filter: ClassVar[Filter | None] = None
    memory: ClassVar[Mapping[str, Unit]] = {}
    cycle: ClassVar[float | None] = None
    step: ClassVar[float | None] = None
    end: ClassVar[float | Trigger | None] = None
    navigator_start: ClassVar[Literal["truth", "nominal"]] = "truth"
    command: ClassVar[Unit] = "1"
    navigator: ClassVar[Any] = None
