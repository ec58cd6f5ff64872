"""Figures of a filter's consistency: every series in a key is drawn, gaps are gaps, and nothing is drawn of nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import Band as Statistic
from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.contract.history import History
from mcnav.contract.linear import LinearSystem
from mcnav.report.drawing.axis_groups import same_unit
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Band, Line, Points, Span
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.filter_errors import DRAWN, errors_and_sigmas
from mcnav.report.figures.normalized_errors import nees_over_time, nis_over_time
from mcnav.report.figures.run_budget import partials_history
from mcnav.report.figures.sigma_ratios import shares_within, sigma_ratios_over_time
from mcnav.report.figures.sources import origins
from tests.filters import OUTAGE, OUTPUTS, TIMES, consistency, in_outage

HISTORY = History({"time [min]": TIMES}, outages={"gnss": (OUTAGE,)})


class Folder:
    """A run folder with histories of its first samples, of which the third failed."""

    def histories(self, samples: int, expected: list[str]) -> tuple[str, Any, dict[str, Any]]:
        drawn = np.random.default_rng(2).standard_normal((samples, len(TIMES)))
        drawn[2] = np.nan
        return "time [min]", TIMES, {f"{name} [{unit}]": drawn for name, (unit, _, _) in OUTPUTS.items()}


def errors(content: Any) -> Figure | None:
    return errors_and_sigmas(content, content.filter)


DRAWINGS: list[Callable[[Any], Figure | None]] = [
    errors, nees_over_time, nis_over_time, sigma_ratios_over_time, shares_within, estimation,
]  # fmt: skip


def content(found: FilterConsistency | None) -> Any:
    manifest = SimpleNamespace(model=SimpleNamespace(outputs=found.outputs if found else ()))
    return SimpleNamespace(several_kinds=False, filter=found, history=HISTORY, folder=Folder(), manifest=manifest)


def nowhere(statistic: Statistic | None) -> Statistic | None:
    """The same statistic, known at no epoch."""
    if statistic is None:
        return None
    return Statistic(*(np.full_like(each, np.nan) for each in (statistic.value, statistic.each, statistic.together)))


@pytest.mark.parametrize("draw", DRAWINGS)
@pytest.mark.parametrize("factor", [1.0, 3.3, 0.5, 1e4])
def test_every_figure_is_whole(draw: Callable[[Any], Figure | None], factor: float) -> None:
    """Every series of every key is drawn, no number is missing from a path, columns have a row for each epoch."""
    figure = draw(content(consistency(factor)))
    assert figure is not None
    text = "".join(figure.svgs)
    for series in (*figure.key, *(each for panel in figure.panels for each in panel.key)):
        assert re.search(rf'series-{series.name}[ "]', text), series
    assert "nan" not in text
    assert "inf" not in text
    assert {len(values) for values in figure.columns.values()} == {len(TIMES)}
    assert f"outage of gnss: {OUTAGE[0]:g} to {OUTAGE[1]:g} min" in text


def test_matplotlib_draws_them() -> None:
    """Shaded outages, gaps and logarithmic axes on as many axes as there are panels."""
    for draw in (nis_over_time, nees_over_time, sigma_ratios_over_time):
        figure = draw(content(consistency(10.0)))
        assert figure is not None
        axes = figure.figure(width=16.0).axes
        assert [each.get_title(loc="left") for each in axes] == [panel.title for panel in figure.panels]
        assert [each.get_yscale() == "log" for each in axes] == [panel.y.log for panel in figure.panels]


@pytest.mark.parametrize("draw", DRAWINGS)
def test_nothing_is_drawn_of_nothing(draw: Callable[[Any], Figure | None]) -> None:
    """Neither without a filter nor of statistics that are known at no epoch."""
    found = consistency()
    unknown = replace(
        found,
        groups=tuple(replace(each, nees=nowhere(each.nees), ratio=nowhere(each.ratio)) for each in found.groups),
        outputs=tuple(
            replace(each, true=np.full(len(TIMES), np.nan), ratio=nowhere(each.ratio), within_1=nowhere(each.within_1))
            for each in found.outputs
        ),
        states=tuple(replace(each, true=np.full(len(TIMES), np.nan)) for each in found.states),
        sensors=tuple(replace(each, nis=nowhere(each.nis)) for each in found.sensors),
    )
    empty = replace(found, groups=(), outputs=(), states=(), sensors=())
    assert draw(content(unknown)) is None
    assert draw(content(empty)) is None
    if draw is not errors:
        assert draw(content(None)) is None


def test_no_area_spans_an_outage() -> None:
    """NIS and its bounds have a gap where there were no updates; bounds hold since the epoch before."""
    figure = nis_over_time(content(consistency()))
    assert figure is not None
    silent = TIMES[in_outage() > 0.0]
    for panel in figure.panels:
        bands = [np.asarray(mark.x) for mark in panel.marks if isinstance(mark, Band)]
        assert [(band[0], band[-1]) for band in bands] == [(0.0, silent[0] - 1.0), (silent[-1], TIMES[-1])]
    shaded = [[mark for mark in panel.marks if isinstance(mark, Span)] for panel in figure.panels]
    assert [len(spans) for spans in shaded] == [1, 0]  # the altimeter has no outage of its own


def test_a_sensor_with_fewer_updates_than_epochs_has_one_curve() -> None:
    """Updates at every third epoch are joined; where one is missing there is a gap, and what is alone is a point."""
    found = consistency()
    known = np.zeros(len(TIMES), dtype=bool)
    known[3::3] = True
    known[[30, 36]] = False
    sensor = found.sensors[1]
    nis = Statistic(*(np.where(known if each.ndim == 1 else known[:, None], each, np.nan)
                      for each in (sensor.nis.value, sensor.nis.each, sensor.nis.together)))  # fmt: skip
    bounds = np.where(known[:, None], (0.9, 1.1), np.nan)
    nis = replace(nis, value=np.where(known, 1.0, np.nan))
    figure = nis_over_time(content(replace(found, sensors=(replace(sensor, nis=nis, bounds=bounds),))))
    assert figure is not None
    marks = figure.panels[0].marks
    assert [np.asarray(mark.x).tolist() for mark in marks if isinstance(mark, Line)] == [
        list(range(3, 28, 3)), [33], list(range(39, 61, 3)),
    ]  # fmt: skip
    bands = [np.asarray(mark.x) for mark in marks if isinstance(mark, Band)]
    assert [(band[0], band[-1]) for band in bands] == [(2, 27), (32, 33), (38, 60)]
    assert (figure.panels[0].x.low, figure.panels[0].x.high) == (TIMES[0], TIMES[-1])
    assert [np.asarray(mark.x).tolist() for mark in marks if isinstance(mark, Points)] == [[33]]


def test_sigmas_in_the_unit_shown() -> None:
    found = consistency(3.3)
    figure = errors(content(found))
    assert figure is not None
    tilt = next(panel for panel in figure.panels if panel.title == "tilt north")
    known = next(each for each in found.outputs if each.name == "tilt_north")
    lines = [mark for mark in tilt.marks if isinstance(mark, Line)]
    ends = {mark.series.name: np.asarray(mark.y) for mark in lines if mark.series.name in ("flown", "filter")}
    np.testing.assert_allclose(ends["flown"], 3.0 * 1e3 * known.true, rtol=1e-15)
    np.testing.assert_allclose(ends["filter"], 3.0 * 1e3 * known.filter, rtol=1e-15)
    assert sum(mark.series.name == "samples" for mark in lines) == DRAWN - 1


def test_groups_of_diagrams() -> None:
    found = consistency()
    assert [title for title, _ in same_unit(found.outputs)] == ["position", "velocity", "tilt and heading"]


def test_budget_by_origin() -> None:
    """Variances of all origins add up to the whole; nobody's errors are left out."""
    sources = [*OUTPUTS, "gyro_bias_x", "accelerometer_bias_x", "gnss_position_bias_north", "clock_drift"]
    processes = ["gyro_angle_random_walk_x", "gnss_noise_north", "altimeter_noise"]
    rng = np.random.default_rng(4)
    partials, covariance = rng.standard_normal((len(TIMES), 9, len(sources))), np.eye(len(sources))
    noise = {name: np.outer(TIMES, np.full(9, 0.01)) for name in processes}
    variables = [SimpleNamespace(name=name) for name in sources]
    filled: Any = SimpleNamespace(
        several_kinds=False, filter=consistency(), history=HISTORY,
        development=LinearSystem(TIMES, partials, processes=noise),
        manifest=SimpleNamespace(model=SimpleNamespace(
            sources=variables, outputs=[SimpleNamespace(name=name) for name in OUTPUTS])),
        model=SimpleNamespace(covariance=covariance, partials=partials[-1], processes=dict.fromkeys(processes)),
        cause_names=[name.replace("_", " ") for name in (*sources, *processes)],
        output_names=list(OUTPUTS), output_units=["m"] * 9, output_scale=np.ones(9), moving=list(range(9)),
    )  # fmt: skip
    found = origins(filled, filled.filter)
    assert [(each.label, len(each.members)) for each in found] == [
        ("initial errors", 9), ("gyros", 2), ("accelerometers", 1), ("gnss", 2), ("altimeter", 1), ("clock drift", 1),
    ]  # fmt: skip
    figure = partials_history(filled)
    assert figure is not None
    columns = {name: np.asarray(values) for name, values in figure.columns.items()}
    for output in OUTPUTS:
        parts = [columns[f"{output}, {each.label} [m]"] for each in found]
        whole = columns[f"{output}, all errors [m]"]
        np.testing.assert_allclose(np.sqrt(sum(part**2 for part in parts)), whole, rtol=1e-13)  # 20 sums, 4 roundings
