"""``type = "reentry"``: the system of NASA TN D-1772."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from mcnav.caches.recent import Recent
from mcnav.contract.quantities import Output, Source
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import (
    AreaPerMass,
    Duration,
    Length,
    Number,
    OneOf,
    PerLength,
    Speed,
    Table,
    TimePerLength,
)
from mcnav.entries.unions import ByType
from mcnav.physics.constants import BALLISTIC_COEFFICIENT, EARTH_RADIUS
from mcnav.systems.description import ScenarioSpec, ScenarioType
from mcnav.systems.reentry.guided.description import TRUE_ALTITUDE, TRUTH_OUTPUTS, TRUTH_SOURCES, Guidance
from mcnav.systems.reentry.guided.following import Following, Gains, Weights
from mcnav.systems.reentry.outputs import DEVIATIONS, FURTHER, FurtherOutput
from mcnav.systems.reentry.scenario import SOURCES, Flight, Reentry
from mcnav.systems.reentry.speed_and_angle import SPEED_AND_ANGLE, SpeedAndAngleReentry
from mcnav.systems.reentry.table_i import TABLE_I, common_start, start_state
from mcnav.systems.reentry.vehicle import ConstantLift, LiftLaw, VariableLift, Vehicle

if TYPE_CHECKING:
    from mcnav.systems.reentry.guided.scenario import GuidedReentry

_RECENT: Final = Recent["Reentry | GuidedReentry"](most=2)
"""Scenarios of the campaigns read last, which variations of a campaign share: each has a trajectory."""


FURTHER_BY_NAME: Final = {further_output.output.name: further_output for further_output in FURTHER}


class ConstantLiftTable(Table):
    """``lift_law = { type = "constant", lift_to_drag = 0.235 }``."""

    type: Annotated[Literal["constant"], Field(description="A constant ratio.")]
    lift_to_drag: Annotated[Number, Field(ge=-10.0, le=10.0, description="Ratio of lift to drag.")]


class VariableLiftTable(Table):
    """``lift_law = { type = "variable", gain = "3.281 s/km", limit = 0.5 }``."""

    type: Annotated[Literal["variable"], Field(description="A ratio in proportion to the rate of descent.")]
    gain: Annotated[TimePerLength, Field(gt=0.0, description="Ratio of lift to drag per altitude rate.")]
    limit: Annotated[Number, Field(gt=0.0, le=10.0, description="Largest ratio of lift to drag.")]


class FirstPointTable(Table):
    """First point of the truth, NASA TN D-1772, eq. (18): ranges are r_E theta and r_E theta_dot."""

    altitude: Annotated[Length, Field(gt=0.0, description="Altitude of the first point.")]
    range: Annotated[Length, Field(description="Range angle times the earth's radius.")]
    altitude_rate: Annotated[Speed, Field(description="Altitude rate.")]
    range_rate: Annotated[Speed, Field(description="Range angle's rate times the earth's radius.")]


class GainsTable(Table):
    """``gains = { altitude = "0.2 1/km", altitude_rate = "20 s/km", range_rate = "9 s/km" }``."""

    altitude: Annotated[PerLength, Field(description="L/D per altitude above the nominal flight's.")]
    altitude_rate: Annotated[TimePerLength, Field(description="L/D per altitude rate above the nominal flight's.")]
    range_rate: Annotated[TimePerLength, Field(description="L/D per range rate above the nominal flight's.")]


class FollowingTable(Table):
    """``law = { type = "reference", limit = 0.8 }``: to the landing site of the nominal flight."""

    type: Annotated[Literal["reference"], Field(description="A law that follows the nominal flight.")]
    limit: Annotated[
        Number, Field(gt=0.0, le=10.0, description="Largest ratio of lift to drag, above the nominal flight's own.")
    ]
    gains: Annotated[
        GainsTable | None, Field(description="Gains; those of a linear quadratic regulator unless given.")
    ] = None
    miss: Annotated[
        Length | None,
        Field(gt=0.0, description="Miss of the landing site that weighs in the regulator as much as the change."),
    ] = None
    change: Annotated[
        Number | None, Field(gt=0.0, description="Change of the ratio throughout that weighs as much as the miss.")
    ] = None


class GuidanceTable(Table):
    """``[scenario.guidance]``: what the lift law is fed with, what ends the flight, what the navigator is told."""

    input: Annotated[
        Literal["indicated", "true"], Field(description="Altitude rate that the lift law is fed with.")
    ] = "indicated"
    final: Annotated[
        Literal["true", "indicated"], Field(description="Altitude whose fall to the final altitude ends the flight.")
    ] = "true"
    navigator_start: Annotated[
        Literal["truth", "nominal"],
        Field(description="State that the navigator is told, before its errors: its own true one or the nominal one."),
    ] = "truth"
    law: Annotated[
        FollowingTable | None, Field(description="Lift law that closes the loop; that of the trajectory unless given.")
    ] = None


class ReentryTable(Table):
    """``[scenario]`` of type reentry."""

    type: Annotated[Literal["reentry"], Field(description="The system of NASA TN D-1772.")]
    trajectory: Annotated[int, Field(ge=1, le=7, description="Row of Table I of NASA TN D-1772.")] | None = None
    first_point: Annotated[
        FirstPointTable | None, Field(description="First point of the truth; that of NASA TN D-1772 unless given.")
    ] = None
    lift_law: Annotated[
        Annotated[ConstantLiftTable | VariableLiftTable, ByType()] | None,
        Field(description="Ratio of lift to drag; needed without a trajectory of Table I."),
    ] = None
    ballistic: Annotated[
        AreaPerMass, Field(ge=0.0, le=100.0, description="Drag coefficient times area over mass, C_D A / m.")
    ] | None = None  # fmt: skip
    final_altitude: Annotated[
        Length | None, Field(description="Altitude at which it ends; needed without a trajectory of Table I.")
    ] = None
    start: Annotated[Duration | None, Field(description="Start of navigation, from reentry: negative before it.")] = (
        None
    )
    axes: Annotated[
        Literal["start", "trajectory"],
        Field(description="Where the platform is aligned: at the start of navigation, or at the first point."),
    ] = "start"
    accelerometers_off_above: Annotated[
        Length, Field(gt=0.0, description="Altitude above which the accelerometers' outputs are taken as zero.")
    ] | None = None  # fmt: skip
    further_outputs: Annotated[
        list[Annotated[str, OneOf(tuple(FURTHER_BY_NAME))]],
        Field(description="Outputs besides the errors of the polar state."),
    ] = []  # noqa: RUF012  # pydantic copies defaults
    guidance: Annotated[
        GuidanceTable | None, Field(description="The lift law fed by the navigator: each sample has its own truth.")
    ] = None


def _lift_law(table: ConstantLiftTable | VariableLiftTable) -> LiftLaw:
    if isinstance(table, ConstantLiftTable):
        return ConstantLift(table.lift_to_drag)
    return VariableLift(table.gain, table.limit)


def _read_flight(table: ReentryTable, context: FileContext) -> Flight | None:
    """Read the flight: a row of Table I, whose entries the table may replace; mistakes are added to the context."""
    row = None if table.trajectory is None else TABLE_I[table.trajectory]
    law = row.lift_law if row is not None else None
    if table.lift_law is not None:
        law = _lift_law(table.lift_law)
    final_altitude = table.final_altitude
    if final_altitude is None and row is not None:
        final_altitude = row.final_altitude
    for key, value in (("lift_law", law), ("final_altitude", final_altitude)):
        if value is None:
            context.problem(f"scenario.{key}", "is missing; give it, or a trajectory of Table I by its number")
    at = table.first_point
    if at is not None and table.trajectory is not None:
        context.problem("scenario.first_point", "got with a trajectory of Table I, which has its own; keep one")
    if law is None or final_altitude is None:
        return None
    if at is not None:
        angle, angular_rate = at.range / EARTH_RADIUS, at.range_rate / EARTH_RADIUS
        first: tuple[float, ...] = (EARTH_RADIUS + at.altitude, angle, at.altitude_rate, angular_rate)
    else:
        first = start_state(table.trajectory) if table.trajectory else tuple(common_start())
    return Flight(
        first_point=first,
        vehicle=Vehicle(law, BALLISTIC_COEFFICIENT if table.ballistic is None else table.ballistic),
        final_altitude=final_altitude,
        start=table.start,
        axes=table.axes,
        accelerometers_off_above=table.accelerometers_off_above,
    )


def _named(content: Mapping[str, Any], sources: Sequence[Source]) -> list[str]:
    """List those of some sources that a file has in ``[errors]``."""
    errors = content.get("errors")
    return [source.name for source in sources if isinstance(errors, Mapping) and source.name in errors]


def _has_own_truths(content: Mapping[str, Any]) -> bool:
    """Return whether each sample of a file has a truth of its own: with guidance, or a source that disperses it."""
    scenario = content.get("scenario")
    return bool(_named(content, TRUTH_SOURCES)) or (isinstance(scenario, Mapping) and "guidance" in scenario)


def _read_guidance(table: ReentryTable, context: FileContext) -> Guidance | None:
    """Read how the loop is closed; none where all samples have one truth."""
    if table.guidance is not None:
        return Guidance(table.guidance.input, table.guidance.final, table.guidance.navigator_start)
    return Guidance("true", "true", "truth") if _has_own_truths(context.content) else None


def _read_following(table: ReentryTable, context: FileContext) -> Following | None:
    """Read the law that follows the nominal flight; none where the trajectory's own is flown."""
    law = None if table.guidance is None else table.guidance.law
    if law is None:
        return None
    if law.gains is None:
        default = Weights()
        weights = Weights(
            default.miss if law.miss is None else law.miss, default.change if law.change is None else law.change
        )
        return Following(law.limit, weights)
    for key in ("miss", "change"):
        if getattr(law, key) is not None:
            context.problem(f"scenario.guidance.law.{key}", "got with gains, which it would decide about; keep one")
    return Following(law.limit, Gains(law.gains.altitude, law.gains.altitude_rate, law.gains.range_rate))


def _choose_outputs(content: Mapping[str, Any]) -> Sequence[Output]:
    """Return the outputs of the reentry of a file."""
    scenario = content["scenario"]
    asked = scenario.get("further_outputs", [])
    errors = (
        *DEVIATIONS,
        *(further_output.output for name, further_output in FURTHER_BY_NAME.items() if name in asked),
    )
    if not _has_own_truths(content):
        return errors
    guidance = scenario.get("guidance")
    indicated = isinstance(guidance, Mapping) and guidance.get("final") == "indicated"
    return (*errors, *((TRUE_ALTITUDE,) if indicated else ()), *TRUTH_OUTPUTS)


def read_scenario(table: ReentryTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec | None:
    """Build the scenario; mistakes are added to the context."""
    flight = _read_flight(table, context)
    further = tuple(further_output for name, further_output in FURTHER_BY_NAME.items() if name in table.further_outputs)
    if flight is None:
        return None
    guidance, following = _read_guidance(table, context), _read_following(table, context)
    converted = _named(context.content, SPEED_AND_ANGLE)
    if converted and guidance is not None:
        for name in converted:
            context.problem(f"errors.{name}", "is for samples that share one truth; give altitude_rate and range_rate")
        return None
    unguided = SpeedAndAngleReentry if converted else Reentry
    law = flight.vehicle.lift_law
    lift: Mapping[str, object] = (
        {"type": "constant", "lift_to_drag": law.lift_to_drag}
        if isinstance(law, ConstantLift)
        else {"type": "variable", "gain": f"{law.gain!r} s/m", "limit": law.limit}
    )
    resolved = {
        "lift_law": lift,
        "ballistic": f"{flight.vehicle.ballistic_coefficient!r} m^2/kg",
        "final_altitude": f"{flight.final_altitude!r} m",
        "axes": flight.axes,
        **entries,
    }
    scenario = _RECENT.get(
        repr((flight, guidance, following, further, converted != [])),
        lambda: unguided(flight, further) if guidance is None else _guided(flight, guidance, following, further),
    )
    if table.guidance is not None:
        resolved["guidance"] = table.guidance.model_dump(exclude_none=True) | dict(entries["guidance"])
    return ScenarioSpec(scenario, resolved)


def _guided(
    flight: Flight, guidance: Guidance, following: Following | None, further: tuple[FurtherOutput, ...]
) -> GuidedReentry:
    """Make a guided reentry, whose engines are imported for it alone."""
    from mcnav.systems.reentry.guided.scenario import GuidedReentry

    return GuidedReentry(flight, guidance, following, further)


ALL_SOURCES: Final = (*SOURCES, *SPEED_AND_ANGLE, *TRUTH_SOURCES)
ALL_OUTPUTS: Final = (
    *DEVIATIONS,
    *(further_output.output for further_output in FURTHER),
    TRUE_ALTITUDE,
    *TRUTH_OUTPUTS,
)
"""Keys of reentries with and without guidance."""

REENTRY: Final = ScenarioType(ReentryTable, read_scenario, ALL_SOURCES, ALL_OUTPUTS, choose_outputs=_choose_outputs)
