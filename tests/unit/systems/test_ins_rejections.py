"""Errors after rejected measurements, against filters that are run with these measurements left out, one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.systems.ins.ensemble.filter_system import filter_system
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.scenario import Ins

DIGITS = 1e-8
"""Of the filter's sigmas: differences of two covariances after some thirty updates, each rounded to 1e-16."""


def scenario() -> Ins:
    """Describe a minute with two sensors that have gates of their own and one without, and estimated biases."""
    content: dict[str, Any] = {
        "scenario": {"type": "ins", "trajectory": {
            "rate": "1 Hz",
            "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "1 km", "speed": "50 m/s"},
            "segments": [{"straight": "20 s"}, {"turn": "60 deg"}, {"straight": "10 s"}],
        }},
        "imu": {
            "gyro": {"bias": "1 deg/h", "angle_random_walk": "0.1 deg/sqrt(h)"},
            "accelerometer": {"bias": "1 mg", "velocity_random_walk": "1 mg/sqrt(Hz)"},
        },
        "errors": {"position": "10 m", "velocity": "0.5 m/s", "tilt": "1 mrad", "heading": "5 mrad"},
        "aiding": [
            {"type": "gnss", "interval": "5 s", "position": "3 m", "gate": 0.95},
            {"type": "altimeter", "interval": "2 s", "altitude": "2 m"},
            {"type": "gnss", "name": "velocity", "interval": "5 s", "velocity": "0.2 m/s", "gate": 0.8},
        ],
        "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
    }  # fmt: skip
    described = parse_campaign(content, "mine.toml", "mine").scenario
    assert isinstance(described, Ins)
    return described


def matrices(loop: ClosedLoop, k: int) -> tuple[Array, Array]:
    """Return F and Q of a step, dense."""
    (steps, noise), _ = filter_system(loop)
    size = 9 + steps.decay.shape[1]
    f, q = np.zeros((size, size)), np.zeros((size, size))
    f[:9], f[9:, 9:] = steps.rows[k], np.diag(steps.decay[k])
    q[:9, :9], q[:9, 9:], q[9:, :9] = noise.white[k], noise.cross[k], noise.cross[k].T
    q[9:, 9:] = np.diag(noise.driven[k])
    return f, q


def run(loop: ClosedLoop, rejected: set[int], last: int) -> tuple[Array, Array, dict[int, tuple[Array, Array]]]:
    """Run a filter that leaves updates out.

    Returns
    -------
    covariance, response : ndarray
        Of the states after the updates at a time; to the whitened innovation of the first update that is left out.
    innovations : mapping of int to (ndarray, ndarray)
        Covariance of later ones as the filter believes it, and their response.
    """
    _, updates = filter_system(loop)
    covariance, response, innovations = loop.filter.initial.copy(), np.zeros((len(loop.filter.initial), 0)), {}
    for k in range(last + 1):
        for u in range(int(updates.first[k]), int(updates.first[k + 1])):
            m = int(updates.sizes[u])
            rows = updates.rows[u, :m]
            believed = rows @ covariance @ rows.T + np.diag(loop.filter.variances[u, :m])
            gain = covariance @ rows.T @ np.linalg.inv(believed)
            innovations[u] = believed, rows @ response
            if u in rejected:
                if u == min(rejected):
                    response = gain @ np.linalg.cholesky(believed)
                continue
            covariance = covariance - gain @ believed @ gain.T
            response = response - gain @ rows @ response
        if k < last:
            f, q = matrices(loop, k)
            covariance, response = f @ covariance @ f.T + q, f @ response
    return covariance, response, innovations


@pytest.mark.parametrize("reading", [30.0, None])
def test_each_first_rejection_as_a_filter_of_its_own_has_it(reading: float | None) -> None:
    """One pass backwards has what a filter has that leaves one measurement out, or all of the gates' from then on."""
    described = scenario()
    aided, sources = described.navigation.aided, len(described.sources)
    assert aided is not None
    loop, end = aided.loop, float(described.reading_times[-1])
    time = (
        end if reading is None else float(described.reading_times[np.abs(described.reading_times - reading).argmin()])
    )
    errors = parse_errors(described)
    laws = described.rejection_laws(np.zeros(sources), errors, np.array([time]))
    assert laws is not None
    assert not laws.doubt
    (read,) = laws.readings
    last = int(np.searchsorted(loop.times, time - 1e-9))
    gated = np.flatnonzero(loop.measurements.sensors != 1)
    gated = gated[gated < loop.first_updates[last + 1]]
    assert len(read.once.excess) == len(gated) >= 10
    to_outputs = np.zeros((9, len(loop.filter.initial)))
    to_outputs[:, :9] = output_map(loop.truth, time)
    all_accepted = run(loop, set(), last)[0]
    np.testing.assert_allclose(read.variances, np.diag(to_outputs @ all_accepted @ to_outputs.T), rtol=DIGITS)
    for place, first in enumerate(gated.tolist()):
        for found, rejected in ((read.once, {first}), (read.never, {u for u in gated.tolist() if u >= first})):
            covariance, response, _ = run(loop, rejected, last)
            expected = np.diag(to_outputs @ covariance @ to_outputs.T)
            np.testing.assert_allclose(read.variances + found.excess[place], expected, rtol=DIGITS)
            # up to the root of the covariance that whitens: its own, so that products are compared
            outer = to_outputs @ response @ response.T @ to_outputs.T
            sizes = np.sqrt(expected)
            np.testing.assert_allclose(
                found.responses[place] @ found.responses[place].T / np.outer(sizes, sizes),
                outer / np.outer(sizes, sizes), atol=DIGITS,
            )  # fmt: skip


def test_correlations_with_the_next_measurement_of_the_sensor() -> None:
    """The joint normal law of two innovations of one sensor, with those of others accepted between them."""
    described = scenario()
    aided = described.navigation.aided
    assert aided is not None
    loop, sources = aided.loop, len(described.sources)
    laws = described.rejection_laws(np.zeros(sources), parse_errors(described), described.reading_times[-1:])
    assert laws is not None
    sensors = loop.measurements.sensors
    gated = np.flatnonzero(sensors != 1)
    assert set(laws.sensors) == {"gnss", "velocity"}
    assert set(laws.probabilities.round(12)) == {0.05, 0.2}
    for place, first in enumerate(gated.tolist()):
        later = [u for u in np.flatnonzero(sensors == sensors[first]).tolist() if u > first]
        if not later:
            assert np.isnan(laws.correlations[place]).all()
            continue
        _, _, innovations = run(loop, {first}, int(loop.times_of(np.array(later[:1]))[0]))
        believed, response = innovations[later[0]]
        whitened = np.linalg.solve(np.linalg.cholesky(believed), response)
        np.testing.assert_allclose(laws.correlations[place], np.linalg.svd(whitened, compute_uv=False), atol=DIGITS)


def parse_errors(described: Ins) -> Array:
    """Return the covariance of the sources that the filter believes in."""
    sigmas = described.navigation.sigmas
    return np.diag([sigmas.get(source.name, 0.0) ** 2 for source in described.sources])
