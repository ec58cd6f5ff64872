"""What a record is named for, on flights that nothing of mcnav made; rates are those of `tests.calibration`."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import LEVEL
from mcnav.judgement.findings import OffsetVerdict, find_first
from mcnav.judgement.likelihood import log_likelihood, without_corrections, without_mean
from mcnav.judgement.naming import Naming
from mcnav.judgement.profile import DROP
from mcnav.judgement.reduction import present, with_causes, with_size, without_idle
from mcnav.judgement.scan import ABSENT, Scan
from mcnav.judgement.simulation import recorded, simulate
from mcnav.judgement.verdict import judge
from mcnav.report.pages.judged import offset_words, to_paste, verdict
from tests.calibration.named_trials import afterwards, filtered, holds, recording_of
from tests.calibration.own_records import WRONG, Flown, fly, motion
from tests.recorded_flights import scalar_record
from tests.unit.judgement.test_likelihood import with_innovations

SIGMAS = 3.29
"""An estimate is farther from the truth in one record of a thousand."""

NAMED = ("receiver's clock 200 ppm fast", "an arm of 1 m", "a correlated error of 2 m")


@pytest.mark.parametrize("name", NAMED)
def test_the_wrong_thing_is_named_and_pasted_nothing_is_left(name: str) -> None:
    """Its interval holds the true value; 5 % of seeds would not, and this one is fixed."""
    flown, expected = WRONG[name]
    recording = recording_of(fly(101, flown))
    first = find_first(filtered(recording), lambda delays: filtered(recording, delays))
    assert first is not None
    finding, _ = first
    assert expected in {number.name for number in finding.alternatives}
    assert any(holds(number, flown) for number in finding.alternatives)
    assert afterwards(recording, finding) > LEVEL


def test_the_stamps_of_a_clock_are_corrected_by_the_delay_at_the_start_as_well() -> None:
    """The receiver is 0.11 s late, and by chance the record has a growing delay as well, of twice its sigma.

    The rate alone, which was printed, leaves the delay: none of the simulated records is as unusual.
    """
    recording = recording_of(fly(275, WRONG["0.11 s late"][0]))
    first = find_first(filtered(recording), lambda delays: filtered(recording, delays))
    assert first is not None
    finding, _ = first
    assert isinstance(finding.number, OffsetVerdict)
    assert finding.number.name == "gnss_clock_rate"
    factor, moved = offset_words(finding.number).split("reading, by ")[1].split(" and subtract ")
    delays = {"gnss": (float(moved.removesuffix(" ms")) / 1e3, 1.0 - float(factor))}
    record = filtered(recording, delays)
    assert judge(record, 300, 50).probability > LEVEL
    without = filtered(recording, {"gnss": (0.0, 1.0 - float(factor))})
    assert judge(without, 300, 50).probability < LEVEL


@pytest.mark.parametrize(("late", "too_long"), [(0.11, False), (0.4, True)])
def test_a_delay_that_no_campaign_can_have_is_corrected_in_the_stamps(late: float, too_long: bool) -> None:
    """Of a longer delay nothing is pasted, and what is printed instead leaves nothing.

    At 0.4 s a campaign with the delay had none of the simulated records as unusual.
    """
    recording = recording_of(fly(8001, Flown(late=late)))
    judgement = judge(filtered(recording), 300, 50, 0, again=lambda delays: filtered(recording, delays))
    (finding,) = judgement.findings
    assert isinstance(finding.number, OffsetVerdict)
    assert (finding.number.name, finding.number.too_long) == ("gnss_delay", too_long)
    assert (to_paste(judgement) == "") == too_long
    sentences = " ".join(verdict(judgement).sentences)
    assert ("Subtract" in sentences) == too_long
    if not too_long:
        assert afterwards(recording, finding) > LEVEL
        return
    printed = float(sentences.split("Subtract ")[1].split(" ms")[0]) / 1e3
    record = filtered(recording, {"gnss": (printed, 0.0)})
    assert judge(record, 300, 50).probability > LEVEL


def test_a_late_receiver_is_no_arm_and_no_noise() -> None:
    """The delay is at least twenty times as likely as anything else, and no size stands beside it.

    With the delay changed, the interval of every other number holds what is true: the campaign's size, or nothing. A
    campaign without delay has the receiver's noise several times too small.
    """
    flown = WRONG["0.11 s late"][0]
    recording = recording_of(fly(102, flown))
    record = filtered(recording)
    first, *others = Naming(record).candidates
    assert first.name == "gnss_delay"
    assert first.stands
    assert not any(candidate.stands for candidate in others)
    named = find_first(record, lambda delays: filtered(recording, delays))
    assert named is not None
    finding, changes = named
    assert isinstance(finding.number, OffsetVerdict)
    assert finding.number.beside_arm is not None
    numbers = [
        number for number, cause in enumerate(record.causes) if cause.name.startswith("gnss") and not cause.absent
    ]
    drops = dict.fromkeys(numbers, DROP)
    assert all(factor.low < 1.0 < factor.high for factor in changes.naming.scan.factors(drops).values())
    assert any(factor.low > 1.2 for factor in Scan(record).factors(drops).values())


def test_a_delay_at_constant_speed_is_an_arm_as_well() -> None:
    """In level turns at 40 m/s an antenna 2 m behind the unit measures what a receiver does that is 0.05 s late.

    Both are named, with the values that would do; nothing was named of such records before.
    """
    recording = recording_of(fly(106, Flown(late=0.05), motion(steady=True)))
    named = find_first(filtered(recording), None)
    assert named is not None
    values = {number.name: number for number in named[0].alternatives}
    assert set(values) == {"gnss_delay", "gnss_lever_arm"}
    for name, expected in (("gnss_delay", (0.05,)), ("gnss_lever_arm", (2.0, 0.0, 0.0))):
        number = values[name]
        assert isinstance(number, OffsetVerdict)
        limits = SIGMAS * np.array(number.sigma)
        assert np.all(np.abs(np.array(number.estimate) - expected) < limits), (name, number.estimate, limits)


def test_a_wrong_model_of_the_gyros_makes_no_delay() -> None:
    """A bias instability that the campaign lacks: it is named, alone or with the white noise, and no constant error."""
    naming = Naming(filtered(recording_of(fly(103, WRONG["bias instability of 30 deg/h"][0]))))
    named = naming.foremost()
    assert named is not None
    names = {named.candidate.name, *(rival.name for rival in named.rivals)}
    assert "gyro_bias_instability" in names
    assert names <= {"gyro_bias_instability", "gyro_angle_random_walk"}


@pytest.fixture(scope="module")
def right() -> FilteredRecord:
    """Return the record of a flight as the campaign describes it."""
    return filtered(recording_of(fly(104)))


def test_of_a_right_campaign_nothing_stands(right: FilteredRecord) -> None:
    assert Naming(right).foremost() is None


def test_errors_that_stay_zero_are_left_out_of_the_filter_alone(right: FilteredRecord) -> None:
    """The likelihood is the same but for rounding; arms, delays and biases of the campaign's sensors are left out."""
    own = without_mean(with_causes(right, present(right)))
    few = without_idle(own)
    assert len(few.mean) == 15 < len(own.mean)
    given, factors = without_corrections(own, simulate(own, 3, np.random.default_rng(0))), [{}, {0: 3.0}, {4: 0.2}]
    expected = log_likelihood(own, given, factors)
    np.testing.assert_allclose(log_likelihood(few, given, factors), expected, rtol=1e-12)


def record_with(q: float, r: float) -> FilteredRecord:
    """Return the record of a walk and noise of other variances than the campaign's, which are one."""
    given = simulate(scalar_record(200, 0.618033989, q, r), 1, np.random.default_rng(1))
    return with_innovations(scalar_record(200, 0.618033989), given)


def test_a_size_at_the_end_of_its_search_is_no_verdict() -> None:
    """A noise 100 times as large as the campaign's lies beyond the largest factor."""
    naming = Naming(record_with(1.0, 1e4))
    noise = next(each for each in naming.candidates if each.name == "noise")
    assert noise.at_end
    assert not noise.stands


@pytest.mark.parametrize(
    ("seed", "flown", "expected"),
    [(105, Flown(late=0.05, position=3.0), "gnss_delay"), (118, Flown(position=1.5), "gnss_position_noise")],
)
def test_a_certain_delay_comes_before_a_likelier_size(seed: int, flown: Flown, expected: str) -> None:
    """The noise of a receiver that is late, too, was named first. In the other record a false delay stands."""
    naming = Naming(filtered(recording_of(fly(seed, flown))))
    likeliest, named = naming.candidates[0], naming.foremost()
    assert likeliest.name == "gnss_position_noise"
    assert next(candidate for candidate in naming.candidates if candidate.name == "gnss_delay").stands
    assert named is not None
    assert named.candidate.name == expected


def test_a_process_beyond_the_factors_is_looked_for_further() -> None:
    """The likeliest size of an instability lies between the largest two factors, and is likelier at the larger one.

    This one was the end of the search and not named; the angle random walk was, alone.
    """
    first, *_ = Naming(filtered(recording_of(fly(308, WRONG["bias instability of 30 deg/h"][0])))).candidates
    assert first.name == "gyro_bias_instability"
    assert ABSENT[-2] < first.factor < ABSENT[-1]
    assert first.stands


def test_causes_that_a_campaign_lacks_leave_no_trace_in_what_it_has(right: FilteredRecord) -> None:
    """Without them the record has the states and simulated innovations of the campaign's own errors alone."""
    record = right
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
