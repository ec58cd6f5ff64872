"""Records of a user's filter: numbers by hand, and what is told in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.contract.history import Epochs
from mcnav.systems.sample_loop import SampleFailed
from mcnav.systems.user.simulated import Innovations, Simulated, record_of, schema_of

EPOCHS = Epochs("time [s]", np.array([0.0, 2.0, 4.0]))
NAMES = ("x", "y", "z")
GROUPS = {"level": ("x", "y")}
ERRORS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, -7.0], [3.0, 0.0, 1.0]])
COVARIANCE = np.array([np.eye(3), np.diag([1.0, 4.0, 4.0]), [[4.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]]])


def _flown(**changes: Any) -> Simulated:
    radar = Innovations([1.0, 2.0, 2.0, 3.5], [2.0, -2.0, 4.0, 1.0], [4.0, 4.0, 4.0, 1.0], [True, True, False, True])
    pair = Innovations([4.0], [[3.0, 1.0]], [[[9.0, 0.0], [0.0, 1.0]]])
    given = {"errors": ERRORS, "covariance": COVARIANCE, "innovations": {"radar": radar, "pair": pair}}
    return Simulated(**given | changes)


def _record(flown: Simulated) -> np.ndarray:
    schema = schema_of(_flown(), NAMES, GROUPS, NAMES)
    assert schema is not None
    return record_of(flown, schema, EPOCHS, NAMES, GROUPS)


def test_a_record_by_hand() -> None:
    schema, records = schema_of(_flown(), NAMES, GROUPS, NAMES), _record(_flown())
    assert schema is not None
    assert (dict(schema.groups), dict(schema.sensors)) == ({"all": 3, "level": 2}, {"radar": 1, "pair": 2})
    assert records.shape == (3, schema.width)
    # at 4 s: [3, 0] over [[4, 2], [2, 4]] is 9 * 4 / 12 = 3
    np.testing.assert_allclose(
        records[:, schema.places["nees"]], [[0.0, 0.0], [1.0 + 1.0 + 49.0 / 4.0, 2.0], [4.0, 3.0]]
    )
    np.testing.assert_array_equal(schema.covariance(records), COVARIANCE)
    np.testing.assert_array_equal(records[:, schema.places["within_1"]], [[1, 1, 1], [1, 1, 0], [0, 1, 1]])
    np.testing.assert_array_equal(records[:, schema.places["within_3"]], [[1, 1, 1], [1, 1, 0], [1, 1, 1]])
    # whitened radar: 1, -1, 2, 1; the updates at 1 s and 2 s belong to the epoch at 2 s
    radar = [[0, 0, 0, 0, 0], [1 + 1 + 4, 2, 1, -1 - 2, 2], [1, 1, 0, 2, 1]]
    np.testing.assert_allclose(records[:, schema.places["sensor:radar"]], radar)
    np.testing.assert_allclose(records[:, schema.places["sensor:pair"]], [[0] * 5, [0] * 5, [2, 1, 0, 0, 0]])


def test_no_updates_and_times_that_differ_by_rounding() -> None:
    schema = schema_of(_flown(), NAMES, GROUPS, NAMES)
    assert schema is not None
    none = Innovations([], [], [])
    late = Innovations([4.0 + 1e-12], [[3.0, 1.0]], [[[9.0, 0.0], [0.0, 1.0]]])
    records = _record(_flown(innovations={"radar": none, "pair": late}))
    assert not records[:, schema.places["sensor:radar"]].any()
    assert records[2, schema.places["sensor:pair"]][0] == pytest.approx(2.0)


def test_a_singular_covariance_has_no_nees() -> None:
    """Nothing is known of the first epoch, whose state is given exactly; the others count."""
    covariance = COVARIANCE.copy()
    covariance[0] = 0.0
    covariance[1, :2, :2] = [[1.0, 2.0], [2.0, 4.0]]
    schema = schema_of(_flown(), NAMES, GROUPS, NAMES)
    assert schema is not None
    records = _record(_flown(covariance=covariance))
    np.testing.assert_allclose(records[:, schema.places["nees"]], [[np.nan] * 2, [np.nan] * 2, [4.0, 3.0]])
    np.testing.assert_array_equal(records[0, schema.places["within_1"]], [1, 1, 1])


def test_without_a_covariance_there_is_no_record() -> None:
    assert schema_of(Simulated(ERRORS), NAMES, {}, NAMES) is None
    with pytest.raises(ValueError, match="need the filter's covariance"):
        schema_of(_flown(covariance=None), NAMES, {}, NAMES)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"covariance": COVARIANCE * [[[1.0]], [[-1.0]], [[1.0]]]}, "not positive definite at time [s] = 2"),
        ({"covariance": COVARIANCE * [[[1.0]], [[1.0]], [[np.nan]]]}, "the filter's covariance: not finite at"),
        ({"errors": ERRORS * [[1.0], [np.inf], [1.0]]}, "errors: not finite at time [s] = 2"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_filter_that_fails_is_told_in_words(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SampleFailed) as failed:
        _record(_flown(**changes))
    assert message in str(failed.value)


@pytest.mark.parametrize(
    ("radar", "message"),
    [
        (Innovations([5.0], [1.0], [1.0]), "times must not fall, nor lie after the last epoch"),
        (Innovations([2.0, 1.0], [1.0, 1.0], [1.0, 1.0]), "times must not fall"),
        (Innovations([1.0], [[1.0, 2.0]], [np.eye(2)]), "must always have size 1; got 2"),
        (Innovations([1.0], [1.0, 2.0], [1.0]), "need shapes (k,), (k, size) and (k, size, size)"),
        ((1.0, 2.0), "must be Innovations of mcnav; got tuple"),
    ],
)
def test_innovations_of_wrong_shape(radar: Any, message: str) -> None:
    with pytest.raises(ValueError, match="innovations of 'radar'") as wrong:
        _record(_flown(innovations=_flown().innovations | {"radar": radar}))
    assert message in str(wrong.value)


def test_innovations_that_are_not_positive_or_not_finite_or_missing() -> None:
    for covariance, message in (
        (-1.0, "innovation covariance of radar is not positive"),
        (np.nan, "of radar: not"),
    ):
        with pytest.raises(SampleFailed, match=message):
            _record(_flown(innovations=_flown().innovations | {"radar": Innovations([1.0], [1.0], [covariance])}))
    with pytest.raises(ValueError, match="innovations must always be of radar, pair; got radar"):
        _record(_flown(innovations={"radar": _flown().innovations["radar"]}))


@pytest.mark.parametrize("groups", [{"all": ("x",)}, {"g": ("w",)}, {"g": "x"}, {"g": ()}, {"1": ("x",)}])
def test_groups_list_outputs(groups: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"must list outputs|is not a name"):
        schema_of(_flown(), NAMES, groups, NAMES)
