"""What a record is named for, on flights that nothing of mcnav made; rates are those of `tests.calibration`."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.findings import OffsetVerdict, find_first
from mcnav.judgement.naming import Naming
from mcnav.judgement.reduction import present, with_causes, with_size
from mcnav.judgement.scan import NOTHING, Scan
from mcnav.judgement.simulation import recorded, simulate
from tests.calibration.named_trials import filtered, holds, recording_of
from tests.calibration.own_records import WRONG, fly
from tests.recorded_flights import scalar_record

NAMED = ("readings 0.06 s late", "jitter of 60 ms", "an arm of 1 m", "a correlated error of 2 m")


@pytest.mark.parametrize("name", NAMED)
def test_the_wrong_thing_is_named_and_nothing_in_its_place(name: str) -> None:
    """Its interval holds the true value; 5 % of seeds would not, and this one is fixed."""
    flown, expected = WRONG[name]
    recording = recording_of(fly(101, flown))
    finding = find_first(filtered(recording), lambda delays: filtered(recording, delays))
    assert finding is not None
    assert expected in (finding.number.name, *finding.rivals)
    assert holds(finding, flown)


def test_a_late_receiver_is_no_arm_and_no_noise() -> None:
    """The delay is at least twenty times as likely as anything else, and no size stands beside it."""
    recording = recording_of(fly(102, WRONG["0.11 s late"][0]))
    naming = Naming(filtered(recording))
    first, *others = naming.candidates
    assert first.name == "gnss_delay"
    assert first.stands
    assert not any(each.stands for each in others)
    finding = find_first(naming.record, lambda delays: filtered(recording, delays))
    assert finding is not None
    assert isinstance(finding.number, OffsetVerdict)
    assert finding.number.beside_arm is not None


def test_a_wrong_model_of_the_gyros_makes_no_delay() -> None:
    """A bias instability that the campaign lacks: it is named, alone or with the white noise, and no constant error."""
    naming = Naming(filtered(recording_of(fly(103, WRONG["bias instability of 30 deg/h"][0]))))
    named = naming.foremost()
    assert named is not None
    names = {named.candidate.name, *(rival.name for rival in named.rivals)}
    assert "gyro_bias_instability" in names
    assert names <= {"gyro_bias_instability", "gyro_angle_random_walk"}


def test_of_a_right_campaign_nothing_stands() -> None:
    assert Naming(filtered(recording_of(fly(104)))).foremost() is None


def record_with(q: float, r: float) -> FilteredRecord:
    """Return the record of a walk and noise of other variances than the campaign's, which are one."""
    record = scalar_record(200, 0.618033989)
    given = simulate(scalar_record(200, 0.618033989, q, r), 1, np.random.default_rng(1))
    stages = tuple(
        type(stage)(**{**vars(stage), "innovation": value[:, 0]})
        for stage, value in zip(record.stages, given.values, strict=True)
    )
    return type(record)(**{**vars(record), "stages": stages})


def test_the_highest_likelihood_of_a_scan_is_that_of_a_fine_grid() -> None:
    record = record_with(1.0, 4.0)
    profile = Scan(record).sizes[1]
    factor, value = profile.highest(NOTHING)
    fine = Scan(record)._profiles({1: np.geomspace(1.0, 4.0, 600)})[1]
    best = int(np.argmax(fine.values(NOTHING)))
    assert factor == pytest.approx(fine.factors[best], rel=0.01)
    assert value == pytest.approx(fine.values(NOTHING)[best], abs=0.01)


def test_a_size_at_the_end_of_its_search_is_no_verdict() -> None:
    """A noise 100 times as large as the campaign's lies beyond the largest factor."""
    naming = Naming(record_with(1.0, 1e4))
    noise = next(each for each in naming.candidates if each.name == "noise")
    assert noise.at_end
    assert not noise.stands


def test_causes_that_a_campaign_lacks_leave_no_trace_in_what_it_has() -> None:
    """Without them the record has the states and simulated innovations of the campaign's own errors alone."""
    record = filtered(recording_of(fly(105)))
    own = with_causes(record, present(record))
    assert all(not cause.absent for cause in own.causes)
    assert len(own.mean) < len(record.mean)
    added = next(number for number, cause in enumerate(record.causes) if cause.name == "gnss_position_correlated")
    larger = with_size(record, added, 5.0)
    assert added in present(larger)
    few = [simulate(with_causes(each, present(each)), 50, np.random.default_rng(2)) for each in (record, larger)]
    spread = [float(np.std(np.array(each.values)[:, :3])) for each in few]
    assert spread[1] > 1.5 * spread[0]
    assert len(recorded(own)) == 1
