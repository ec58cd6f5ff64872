"""Assessment of filters whose consistency is known, and of those of which nothing can be said."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_causes import Departure, largest_departure, neglected_errors
from mcnav.analysis.filter_consistency import Band, FilterConsistency, Finding, Honesty
from mcnav.analysis.filter_decision import combine, decide, outputs_of
from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.analysis.filter_judgement import Rates, find
from mcnav.analysis.filter_remarks import sentence
from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.quantities import Output
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.statistics.mean_square import mean_square_intervals
from tests.calibration.filter_trials import OUTPUTS, PLACES, SCHEMA, evidence

CRITERION = Criterion(tolerance=0.05, confidence=0.95)
RATES = Rates(0.95, 0.95)


def drawn(samples: int, scale: Array | None = None, seed: int = 1) -> FilterEvidence:
    """Five epochs of nine errors of a filter that states unit covariances."""
    generator = np.random.default_rng(seed)
    normals = generator.standard_normal((samples, 5, 9))
    return evidence(normals, generator.standard_normal((samples, 4, 3, 3)), np.ones(9) if scale is None else scale)


def scalar(errors: Array, variances: Array, **columns: Array) -> FilterEvidence:
    """One output with errors and stated variances of shape (n, m); columns by their place."""
    schema = FilterSchema(
        {"position": 1}, outputs=1, states=("bias",), units=(("m", "m"),), sensors={"fix": 1, "spare": 1}
    )
    records = np.zeros((*errors.shape, schema.width))
    with np.errstate(divide="ignore", invalid="ignore"):
        records[:, :, schema.places["nees"]] = (errors**2 / variances)[:, :, None]
    records[:, :, schema.places["covariance"]] = variances[:, :, None]
    for name, values in columns.items():
        records[:, :, schema.places[name.replace("sensor_", "sensor:")]] = values
    return FilterEvidence(
        "time [min]",
        np.arange(float(errors.shape[1])),
        (Output("position", "m", "m"),),
        FilterMeans.of(schema, FilterSums.of(schema, records)),
        MeanSquares.of(sum_powers_about_zero(errors[:, :, None])),
        failed=0,
    )


def assessed(given: FilterEvidence) -> FilterConsistency:
    return assess_filter(given, CRITERION)


def test_a_matched_filter_is_consistent_with_enough_samples() -> None:
    """With 10,000 samples intervals of three components are ±0.8 %, far within the tolerance."""
    found = assessed(drawn(10_000))
    assert found.verdict == Honesty.CONSISTENT
    assert {group.finding.verdict for group in found.groups} == {Honesty.CONSISTENT}
    assert found.sensors[0].finding.verdict == Honesty.CONSISTENT
    assert found.remarks == ()
    assert sentence(found).startswith("The filter is consistent")
    few = assessed(drawn(200))
    assert few.verdict == Honesty.UNDECIDED
    assert few.samples_needed is not None
    assert 5_000 < few.samples_needed < 15_000


def test_the_samples_needed_decide_with_the_stated_probability() -> None:
    """A tenth of the trials may fail, three standard errors of which are 20 %; a half as many samples decide seldom."""
    needed = assessed(drawn(2_000)).samples_needed
    assert needed is not None
    consistent = [
        sum(assessed(drawn(number, seed=seed)).verdict == Honesty.CONSISTENT for seed in range(100, 120))
        for number in (needed, needed // 2)
    ]
    assert consistent[0] >= 14
    assert consistent[1] <= 10


def test_groups_that_are_consistent_do_not_make_single_errors_so() -> None:
    """The groups' intervals of 2,000 samples are within the tolerance, those of single errors are not."""
    some = assessed(drawn(2_000))
    undecided = [output.finding for output in some.outputs if output.finding.verdict == Honesty.UNDECIDED]
    assert {group.finding.verdict for group in some.groups} == {Honesty.CONSISTENT}
    assert 0 < len(undecided) < len(some.outputs)
    assert (some.verdict, some.on_groups, some.on_outputs) == (
        Honesty.UNDECIDED, Honesty.CONSISTENT, Honesty.UNDECIDED,
    )  # fmt: skip
    needed = max(finding.samples_needed or 0 for finding in undecided)
    assert some.samples_needed == needed
    assert 6_100 <= needed <= 6_200
    assert sentence(some) == "Undecided: the filter is consistent as a whole; single errors need about 6,200 samples."
    assert some.remarks == (
        "As a whole: the mean NEES of each group of errors is within the tolerance at every epoch; "
        f"{9 - len(undecided)} of 9 outputs by themselves are.",
    )


def test_one_sigma_that_is_wrong_decides() -> None:
    """One of nine sigmas is too small by 1.2: the mean NEES of its group is 1.15 of what it should be, of all 1.05."""
    found = assessed(drawn(5_000, np.array([*[1.0] * 8, 1.2]), seed=2))
    assert (found.verdict, found.output) == (Honesty.OPTIMISTIC, "tilt_z")
    (departure,) = [each for each in found.departures if not each.size]
    assert departure.interval[0] < 1.2 < departure.interval[1]
    assert (departure.begin, departure.end) == (0.0, 4.0)
    low, high = departure.interval
    factor = f"{departure.factor:.3g} ({low:.3g} to {high:.3g})"
    assert f"In tilt z the factor is {factor} from 0 s on." in sentence(found)


def test_two_sigmas_wrong_in_opposite_directions_do_not_cancel() -> None:
    """With 1.44 and 0.56 of their variances the mean NEES of the group is as expected, and nothing else shows it."""
    wrong = np.array([*[1.0] * 6, 1.2, np.sqrt(0.56), 1.0])
    found = assessed(drawn(10_000, wrong))
    assert found.on_groups == Honesty.CONSISTENT
    assert (found.verdict, found.group, found.output) == (Honesty.OPTIMISTIC, "", "tilt_x")
    assert [(each.verdict, each.name) for each in found.departures] == [
        (Honesty.OPTIMISTIC, "tilt_x"), (Honesty.PESSIMISTIC, "tilt_y"),
    ]  # fmt: skip
    for departure, true in zip(found.departures, (1.2, np.sqrt(0.56)), strict=True):
        assert departure.interval[0] < true < departure.interval[1]
    assert sentence(found).index("optimistic") < sentence(found).index(" in tilt x") < sentence(found).index("pessimis")
    assert sentence(found).endswith(" in tilt y from 0 s on.")
    assert found.remarks == ("No group of errors shows it: in a mean NEES single errors average out.",)


def test_an_output_without_error_and_variance_decides_nothing() -> None:
    """It has no ratio at any epoch, and is not undecided for that."""
    found = assessed(drawn(10_000))
    nothing = np.full(5, np.nan)
    unknown = Band(nothing, np.full((5, 2), np.nan), np.full((5, 2), np.nan))
    still = replace(found.outputs[8], true=np.zeros(5), filter=np.zeros(5), ratio=unknown,
                    finding=find(unknown, 0.05, 10_000, RATES))  # fmt: skip
    assert still.finding.verdict == Honesty.UNDECIDED
    assert not still.claims
    decided = decide(found.groups, (*found.outputs[:8], still))
    assert (decided.verdict, decided.outputs) == (Honesty.CONSISTENT, Honesty.CONSISTENT)


def test_the_intervals_that_decide_share_the_error_rate() -> None:
    """Four groups and nine outputs at five epochs: 65 intervals; the others are a family of their own."""
    given = drawn(500)
    found = assessed(given)
    rates = Rates.of(CRITERION, 65)
    assert given.true is not None
    expected = mean_square_intervals(
        given.true.value[:, 3], given.true.standard_error[:, 3], np.full(5, 500.0), np.full(5, 500.0), rates.together
    )
    np.testing.assert_allclose(found.outputs[3].ratio.together ** 2, expected, rtol=1e-12)
    widths = {group.name: np.ptp(np.log(group.nees.together[0])) for group in found.groups}
    assert widths["navigation"] > widths["all"]  # the same NEES, of 65 and of five intervals


def test_an_optimistic_filter_is_found_where_it_is() -> None:
    """Velocity errors are 1.5 times as large as stated: 2,000 samples find the group, and the ratio within 5 %."""
    found = assessed(drawn(2_000, np.repeat([1.0, 1.5, 1.0], 3)))
    assert (found.verdict, found.group) == (Honesty.OPTIMISTIC, "velocity")
    assert found.output.startswith("velocity_")
    assert found.factor == pytest.approx(1.5, rel=0.05)  # five standard errors of 0.9 %
    assert found.interval is not None
    assert found.interval[0] < 1.5 < found.interval[1]
    assert (found.begin, found.end) == (0.0, 4.0)
    by_name = {group.name: group.finding.verdict for group in found.groups}
    assert by_name["navigation"] == Honesty.OPTIMISTIC
    assert Honesty.OPTIMISTIC not in (by_name["position"], by_name["attitude"])
    assert "optimistic by a factor of 1.5" in sentence(found)


def test_a_pessimistic_filter_and_one_that_is_both() -> None:
    found = assessed(drawn(2_000, np.repeat([1.0, 0.7, 1.0], 3)))
    assert (found.verdict, found.group) == (Honesty.PESSIMISTIC, "velocity")
    assert found.factor == pytest.approx(0.7, rel=0.05)
    both = assessed(drawn(2_000, np.repeat([1.4, 0.7, 1.0], 3)))
    assert (both.verdict, both.group) == (Honesty.OPTIMISTIC, "position")
    assert "is optimistic by a factor of 1.4" in sentence(both)
    assert "The filter is pessimistic by a factor of 1.4" in sentence(both)
    assert [(each.verdict, each.name, each.size) for each in both.departures[::2]] == [
        (Honesty.OPTIMISTIC, "position", 3), (Honesty.PESSIMISTIC, "velocity", 3),
    ]  # fmt: skip


def test_a_departure_has_a_begin_and_an_end() -> None:
    """Errors are twice as large as stated at epochs 2 and 3 of six."""
    errors = np.random.default_rng(2).standard_normal((1_000, 6))
    errors[:, 2:4] *= 2.0
    found = assessed(scalar(errors, np.ones((1_000, 6))))
    assert (found.verdict, found.begin, found.end) == (Honesty.OPTIMISTIC, 2.0, 3.0)
    assert "in position from 2 to 3 min." in sentence(found)


def test_too_few_failed_and_dependent_samples_leave_it_undecided_in_words() -> None:
    """No verdict, whatever the ratio, and no number that is not one."""
    wrong = np.full(9, 3.0)
    cases = {
        "19 samples are too few": drawn(19, wrong),
        "not independent": replace(drawn(500, wrong), design="sobol", sampling=SamplingDesign(32)),
        "heavy tails": replace(drawn(500, wrong), sampling=SamplingDesign(fewest_blocks=np.inf)),
        "every sample failed": replace(drawn(500, wrong), means=None, true=None, failed=500),
    }
    for words, given in cases.items():
        found = assessed(given)
        assert found.verdict == Honesty.UNDECIDED
        assert words in " ".join(found.remarks).lower()
        assert words in sentence(found)
    failed = assessed(replace(drawn(10_000), failed=100))
    assert failed.verdict == Honesty.UNDECIDED
    assert "Too many samples failed." in failed.remarks


def test_heavy_tails_of_one_output_withhold_what_has_it_and_no_other() -> None:
    """A filter that is right, and then one whose third position is wrong: an output that has no tail is judged."""
    given = replace(drawn(10_000), withheld=(8,))
    found = assessed(given)
    verdicts = [output.finding.verdict for output in found.outputs]
    assert verdicts == [Honesty.CONSISTENT] * 8 + [Honesty.UNDECIDED]
    holding = [group.name for group in found.groups if group.finding.verdict == Honesty.UNDECIDED]
    assert holding == [name for name in SCHEMA.groups if 8 in range(9)[PLACES.get(name, slice(None))]]
    assert "heavy tails" in found.sensors[0].finding.remark
    assert found.verdict == Honesty.UNDECIDED
    wrong = np.ones(9)
    wrong[2] = 1.3
    assert assessed(replace(drawn(10_000, wrong), withheld=(8,))).verdict == Honesty.OPTIMISTIC
    assert assessed(replace(drawn(10_000, wrong), withheld=tuple(range(9)))).verdict == Honesty.UNDECIDED


def test_sensors_that_never_update_and_those_that_reject_everything() -> None:
    """Both are told in words, and have no NIS or no verdict."""
    errors = np.random.default_rng(3).standard_normal((300, 4))
    rejected = np.zeros((300, 4, 5))
    rejected[:, :, 0], rejected[:, :, 2] = 400.0, 2.0
    found = assessed(scalar(errors, np.ones((300, 4)), sensor_fix=rejected))
    fix, spare = found.sensors
    assert fix.updates == (0.0, 8.0)
    assert fix.nis_whole == 200.0
    assert fix.finding.remark == "every measurement was rejected"
    assert spare.nis_whole is None
    assert spare.finding.remark == "never updated"
    assert {"Every measurement of fix was rejected.", "Spare never updated the filter."} <= set(found.remarks)
    assert "The filter was never updated." in assessed(scalar(errors, np.ones((300, 4)))).remarks
    rejected[:, :, 1] = 14.0
    some = assessed(scalar(errors, np.ones((300, 4)), sensor_fix=rejected)).remarks
    assert "Measurements were rejected (fix 12.5 %); linear analysis accepts all." in some


def test_variances_of_zero_are_told_in_words() -> None:
    """At epoch 0 error and variance are zero, at epoch 1 the variance alone."""
    errors = np.random.default_rng(4).standard_normal((300, 4))
    errors[:, 0] = 0.0
    variances = np.ones((300, 4))
    variances[:, :2] = 0.0
    found = assessed(scalar(errors, variances))
    assert np.isnan(found.outputs[0].ratio.value[:2]).all()
    assert np.isfinite(found.outputs[0].ratio.value[2:]).all()
    assert "The filter has no variance of position where its error is not zero." in found.remarks
    assert any("is not a number in all samples at 2 epochs" in remark for remark in found.remarks)
    assert (found.verdict, found.overlooked) == (Honesty.OPTIMISTIC, "position")
    rounding = np.where(np.arange(4) == 0, 1e-12, 1.0) * np.random.default_rng(6).standard_normal((10_000, 4))
    started = assessed(scalar(rounding, np.tile([1e-40, 1.0, 1.0, 1.0], (10_000, 1))))
    said = ("Errors up to 2e-07 m count as none: position.", "The filter was never updated.")
    assert (started.verdict, started.remarks[:2]) == (Honesty.CONSISTENT, said)
    assert np.isnan(started.groups[0].ratio.value[0])
    many = np.random.default_rng(4).standard_normal((10_000, 2))
    assert assessed(scalar(many, np.ones((10_000, 2)))).verdict == Honesty.CONSISTENT
    overlooking = assessed(scalar(many, np.tile([0.0, 1.0], (10_000, 1))))
    assert (overlooking.verdict, overlooking.factor, overlooking.output) == (Honesty.OPTIMISTIC, None, "position")
    words = "The filter is optimistic: it computes no variance of position, whose error is not zero."
    assert sentence(overlooking) == words
    small = assessed(scalar(many * [1e-3, 1.0], np.tile([0.0, 1.0], (10_000, 1))))
    assert small.verdict == Honesty.UNDECIDED
    assert "The filter believes in no error where there is one." in small.remarks
    larger = assessed(scalar(many, np.tile([0.0, 4.0], (10_000, 1))))
    assert larger.verdict == Honesty.OPTIMISTIC
    assert sentence(larger).startswith(f"{words} The filter is pessimistic by a factor of 2")
    lost = np.ones((10_000, 2))
    lost[:100, 1] = 0.0
    singular = assessed(scalar(many, lost))
    assert "The filter's covariance is singular in too many samples." in singular.remarks


def test_linear_ratio_is_the_trace_of_the_normalized_truth() -> None:
    """For P of positions with correlation and T = 4 P the ratio is two; singular P give NaN."""
    given = drawn(100)
    own = np.tile(np.eye(9), (5, 1, 1))
    own[:, 0, 1] = own[:, 1, 0] = 0.5
    true = 4.0 * own
    own[0, 2, 2] = 0.0
    linear = LinearFilter(own, np.empty((5, 0)), true, np.empty((5, 0)))
    found = assessed(replace(given, linear=linear))
    for group in found.groups:
        assert group.linear is not None
        np.testing.assert_allclose(group.linear[1:], 2.0, rtol=1e-13)  # rounding
        assert np.isnan(group.linear[0]) == (group.name in ("all", "navigation", "position"))
    assert found.outputs[0].linear is not None
    np.testing.assert_allclose(found.outputs[0].linear, 2.0, rtol=1e-13)


def test_neglected_errors_share_what_the_filter_does_not_believe() -> None:
    """True 9 = 4 + 3 + 2; believed 4 + 0.75 + 0 = 4.75: the rest of 4.25 is 2.25 and 2."""
    contributions = {name: np.full((1, 1), value) for name, value in (("walk", 3.0), ("scale", 2.0), ("noise", 4.0))}
    linear = LinearFilter(
        np.full((1, 1, 1), 4.75), np.empty((1, 0)), np.full((1, 1, 1), 9.0), np.empty((1, 0)), contributions,
        {"walk": 0.25, "scale": 0.0},
    )  # fmt: skip
    found = neglected_errors(linear, Departure(0, 0))
    assert [each.name for each in found] == ["walk", "scale"]
    assert [each.share for each in found] == pytest.approx([2.25 / 4.25, 2.0 / 4.25], rel=1e-15)
    assert sum(each.true - each.believed for each in found) == pytest.approx(9.0 - 4.75, rel=1e-15)
    assert neglected_errors(replace(linear, believed={}), Departure(0, 0)) == ()


def test_a_mean_is_a_cause_of_its_own() -> None:
    """Of a bias with mean square 1 + 8 the filter believes 3: its mean is named, with 6 of the 6 + 2 that are missing.

    A bias of which the filter believes its mean square is no cause.
    """
    one = np.ones((1, 1))
    linear = LinearFilter(
        7.0 * one[:, :, None], np.empty((1, 0)), 15.0 * one[:, :, None], np.empty((1, 0)),
        {"bias": one, "scale": 2.0 * one}, {"bias": 3.0 / 9.0, "scale": 0.0, "known": 1.0},
        {"bias": 8.0 * one, "known": 4.0 * one},
    )  # fmt: skip
    found = neglected_errors(linear, Departure(0, 0))
    assert [(each.name, each.true, each.believed) for each in found] == [
        ("mean_of_bias", 9.0, pytest.approx(3.0)), ("scale", 2.0, 0.0)
    ]  # fmt: skip
    assert [each.share for each in found] == pytest.approx([0.75, 0.25], rel=1e-15)


def test_linear_analysis_chooses_where_causes_are_named() -> None:
    """Ratios of sigmas 3 and 3.1 at two epochs: chance decides which Monte Carlo ratio is larger, linear analysis not.

    Where the filter believes in no more than rounding there is no ratio; within the tolerance there is no departure.
    """
    ratios = np.ones((5, 9))
    ratios[1, 0], ratios[3, 1], ratios[4, 5] = 3.0, 3.1, 7.0
    own = np.tile(np.eye(9), (5, 1, 1))
    own[0, 2, 2] = 1e-20
    true = own * (ratios**2)[:, :, None]
    true[0, 2, 2] = 1.0
    contributions = {f"cause_{i}": np.where(ratios > 1.0, ratios**2 - 1.0, 0.0) * (np.arange(9) == i) for i in range(9)}
    believed = dict.fromkeys(contributions, 0.0)
    linear = LinearFilter(own, np.empty((5, 0)), true, np.empty((5, 0)), contributions, believed)
    assert largest_departure(linear, (0, 1, 2), 0.05) == Departure(3, 1)
    assert largest_departure(linear, (6, 7, 8), 0.05) is None
    assert largest_departure(linear, (0, 1, 2), 2.2) is None
    assert largest_departure(replace(linear, true=None), (0,), 0.05) is None
    steady = replace(linear, true=4.0 * own * (1.0 + 1e-9 * np.arange(5)[::-1, None, None]))
    assert largest_departure(steady, (0, 1), 0.05) == Departure(4, 0)
    scale = np.repeat([3.0, 1.0, 1.0], 3)
    named = set()
    for seed in range(8):
        found = assessed(replace(drawn(100, scale, seed), linear=linear))
        assert (found.verdict, found.group) == (Honesty.OPTIMISTIC, "position")
        named.add((found.neglected_at, found.neglected_output, found.neglected[0].name, found.neglected[0].share))
    assert named == {(3.0, "position_y", "cause_1", 1.0)}
    cancelling = np.array([1.2, np.sqrt(0.56), *[1.0] * 7])  # position x alone departs: its group is looked at
    found = assessed(replace(drawn(10_000, cancelling, seed=2), linear=linear))
    assert (found.group, found.output) == ("", "position_x")
    assert (found.neglected_at, found.neglected_output, found.neglected[0].name) == (3.0, "position_y", "cause_1")


def test_considered_errors_are_known_to_correlate_innovations() -> None:
    """A common error of a sample's fixes: white by no means, and matched all the same."""
    generator = np.random.default_rng(11)
    common = generator.standard_normal((400, 1, 1, 3))
    innovations = np.sqrt(0.5) * (common + generator.standard_normal((400, 4, 3, 3)))
    given = evidence(generator.standard_normal((400, 5, 9)), innovations, np.ones(9))
    assert given.means is not None
    schema = replace(SCHEMA, considered=("gnss_lever_arm", "gyro_bias"))
    considering = replace(given, means=replace(given.means, schema=schema))
    plain, aware = (assessed(each) for each in (given, considering))
    assert "Innovations of fix are not white." in plain.remarks
    assert (
        "Innovations of fix are not white, as expected of a filter that considers errors without estimating them "
        "(gnss lever arm and gyro bias)."
    ) in aware.remarks
    assert [found.sensors[0].whiteness.expected for found in (plain, aware)] == [False, True]
    assert not aware.sensors[0].beyond


def test_bands_judge_departures_together_and_consistency_each() -> None:
    """One epoch: consistency asks the narrower interval, a departure the wider one."""

    def band(value: float, each: float, together: float) -> Band:
        return Band(*(np.array(entry) for entry in (
            [value], [[value - each, value + each]], [[value - together, value + together]],
        )))  # fmt: skip

    assert find(band(1.01, 0.03, 0.2), 0.05, 100, RATES).verdict == Honesty.CONSISTENT
    assert find(band(1.3, 0.1, 0.2), 0.05, 100, RATES).verdict == Honesty.OPTIMISTIC
    assert find(band(1.3, 0.1, 0.3), 0.05, 100, RATES).verdict == Honesty.UNDECIDED
    assert find(band(0.7, 0.1, 0.2), 0.05, 100, RATES).verdict == Honesty.PESSIMISTIC
    assert find(band(np.nan, 0.1, 0.2), 0.05, 100, RATES).verdict == Honesty.UNDECIDED
    undecided = find(band(1.02, 0.08, 0.2), 0.05, 100, RATES)  # (0.08 / 0.05)² × (1 + z_95 / z_97.5)² times as many
    assert undecided.samples_needed == math.ceil(100 * 1.6**2 * (1.0 + 1.6449 / 1.96) ** 2)


def test_the_most_optimistic_finding_decides() -> None:
    findings = [
        Finding(Honesty.CONSISTENT, 1.01),
        Finding(Honesty.PESSIMISTIC, 0.5),
        Finding(Honesty.OPTIMISTIC, 1.2),
        Finding(Honesty.OPTIMISTIC, 1.4),
        Finding(Honesty.UNDECIDED, 1.1),
    ]
    assert combine(findings) == 3
    assert combine(findings[:2]) == 1
    assert combine([findings[0], findings[4]]) == 1
    assert combine([]) is None
    assert Rates.of(Criterion(confidence=0.9, looks=2), 5) == Rates(pytest.approx(0.95), pytest.approx(0.99), 5)


def test_outputs_of_groups() -> None:
    names = [output.name for output in OUTPUTS]
    assert outputs_of("attitude", names) == (6, 7, 8)
    assert outputs_of("navigation", names) == tuple(range(9))
    assert outputs_of("sensors", ["altitude", "range"]) == (0, 1)


def test_sums_leave_out_what_is_not_finite() -> None:
    """A NEES that is no number is counted; squares of the errors of other states are kept."""
    schema = FilterSchema({"all": 1}, outputs=1, states=("bias",), units=(("m", "m"),))
    records = np.random.default_rng(5).standard_normal((50, 3, schema.width))
    records[4, 1, 0] = np.nan
    sums = FilterSums.of(schema, records)
    means = FilterMeans.of(schema, sums)
    assert means.at("nees").count[:, 0].tolist() == [50, 49, 50, 50]
    assert means.at("nees").value[1, 0] == pytest.approx(np.nanmean(records[:, 1, 0]), rel=1e-13)
    bias = records[:, :, schema.places["state_error"]][:, :, 0]
    np.testing.assert_allclose(means.squared_state_errors.value[:-1, 0], np.mean(bias**2, axis=0), rtol=1e-13)
    np.testing.assert_allclose(
        means.at("state_variance").standard_error[:-1, 0],
        records[:, :, schema.places["state_variance"]][:, :, 0].std(axis=0, ddof=1) / np.sqrt(50),
        rtol=1e-12,  # the difference of a sum of squares and the square of a sum of the same order
    )
    halves = FilterSums.of(schema, records[:20]) + FilterSums.of(schema, records[20:])
    np.testing.assert_allclose(halves.to_numbers(), sums.to_numbers(), rtol=1e-12, atol=1e-13)
    again = FilterSums.from_numbers(schema, sums.to_numbers())
    np.testing.assert_array_equal(again.to_numbers(), sums.to_numbers())
    assert SCHEMA.main_group == "navigation"
    assert schema.main_group == "all"


@pytest.mark.parametrize(
    ("design", "samples", "weight"),
    [("random", 500, 1.0), ("antithetic", 500, 0.5), ("latin-hypercube", 512, 31.0 / 32.0), ("sobol", 512, 0.0)],
)
def test_weights_of_designs(design: str, samples: int, weight: float) -> None:
    """Pairs count as one sample, a hypercube of 32 as 31, a net as nothing; intervals widen by the root."""
    plain = drawn(samples)
    given = replace(plain, design=design, sampling=SamplingDesign.of(design, samples))
    assert given.weight == weight
    if weight == 0.0:
        return
    widths = [np.ptp(np.log(assessed(each).groups[0].nees.each[0])) for each in (plain, given)]
    assert widths[1] / widths[0] == pytest.approx(weight**-0.5, rel=0.02)  # Student's quantile, and skewness


def test_sources_that_are_not_normal_have_no_chi_square_bounds() -> None:
    """Whether the NIS is beyond is then told by its own interval."""
    normal = drawn(2_000)
    found = [assessed(replace(normal, sampling=SamplingDesign(normal=each))).sensors[0] for each in (True, False)]
    assert found[0].bounds_whole == found[1].bounds_whole
    assert not any(sensor.beyond for sensor in found)
    errors = np.random.default_rng(3).standard_normal((300, 4))
    nis = np.zeros((300, 4, 5))
    nis[:, :, 0], nis[:, :, 1] = 3.0 * np.random.default_rng(4).chisquare(1, (300, 4)), 1.0
    given = replace(scalar(errors, np.ones((300, 4)), sensor_fix=nis), sampling=SamplingDesign(normal=False))
    assert assessed(given).sensors[0].beyond
