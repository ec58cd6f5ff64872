"""Navigation on the moon and on Mars: both engines, and what is of the earth alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.errors import CampaignError
from mcnav.systems.ins.earth import BODIES
from mcnav.systems.ins.scenario import Ins

PLACE = {"latitude": "-45 deg", "longitude": "10 deg", "altitude": "15 km"}


def campaign(body: str, **entries: object) -> dict[str, Any]:
    """Return a flight of four minutes at 300 m/s, with a turn."""
    flight = {
        "start": {**PLACE, "course": "80 deg", "speed": "300 m/s"},
        "segments": [{"hold": "20 s"}, {"turn": "30 deg", "rate": "1 deg/s"}, {"hold": "180 s"}],
    }
    errors = {"position": "100 m", "velocity": "0.5 m/s", "tilt": "1 mrad", "heading": "1 mrad"}
    scenario = {"type": "ins", "earth": body, "trajectory": entries.pop("trajectory", flight)}
    return {"samples": 10, "seed": 1, "scenario": scenario, "imu": {"grade": "navigation"}, "errors": errors, **entries}


@pytest.mark.parametrize("body", ["moon", "mars"])
def test_both_engines_and_linear_analysis_agree(body: str) -> None:
    """Of errors of a sigma, products are 1e-3 at most; of the engines, a ten-thousandth of them is left."""
    scenario = parse_campaign(campaign(body), "mine.toml", "mine").scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.truth.earth is BODIES[body]
    errors = np.zeros((1, len(scenario.sources)))
    errors[0, :9] = np.repeat([100.0, 0.5, 1e-3], 3)
    batch = Batch(np.zeros(1, dtype=np.int64), errors, 1)
    values = [scenario.engine(name, errors).simulate(batch, noise=False).values for name in ("ensemble", "reference")]
    linear = scenario.linear().partials[-1] @ errors[0]
    sizes = np.repeat([np.abs(linear[:3]).max(), np.abs(linear[3:6]).max(), 1e-3], 3)
    assert np.abs((values[0] - values[1]) / sizes).max() < 1e-7
    assert np.abs((values[0] - linear) / sizes).max() < 1e-2


@pytest.mark.parametrize(
    ("body", "entries", "message"),
    [
        ("moon", {"trajectory": {"reentry": 4}}, "scenario.trajectory.reentry: is one on the earth, and the scenario"),
        ("mars", {"aiding": [{"type": "magnetometer", "interval": "9 s", "field": "100 nT"}]},
         "aiding #1: measures the magnetic field of the earth, and the scenario is on mars"),
        ("moon", {"aiding": [{"type": "altimeter", "interval": "9 s", "altitude": "3 m"}]},
         'aiding #1.kind: is barometric, and the moon has no air; expected kind = "radar"'),
        ("venus", {}, "scenario.earth: got 'venus'; expected"),
    ],
)  # fmt: skip
def test_what_does_not_hold_there_is_refused(body: str, entries: dict[str, Any], message: str) -> None:
    if "aiding" in entries:
        entries = {**entries, "filter": {"estimates": ["position", "velocity", "attitude"]}}
    with pytest.raises(CampaignError) as refusal:
        parse_campaign(campaign(body, **entries), "mine.toml", "mine")
    assert message in str(refusal.value)
