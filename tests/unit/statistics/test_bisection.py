"""Root searches: roots to the width asked for, and none where the values contradict one another."""

import math

import pytest

from mcnav.errors import NumericalError
from mcnav.statistics.bisection import root_between, smallest_reaching


@pytest.mark.parametrize("root", [1e-9, 0.3, 0.999])
@pytest.mark.parametrize("width", [1e-3, 1e-16, 1e-18])
def test_the_last_bracket_is_as_narrow_as_asked_or_to_the_last_bit(root, width):
    """Also far from zero, where a quarter of the width is less than a bit: it used to end at the first guess."""
    for shift in (0.0, 4_500.0):
        place = shift + root

        def function(x, place=place):
            return math.atan(3.0 * (x - place))

        ends = root_between(function, (shift, function(shift)), (shift + 1.0, function(shift + 1.0)), width)
        assert ends[0] <= place <= ends[1]
        assert ends[1] - ends[0] <= width or ends[1] == math.nextafter(ends[0], math.inf)


@pytest.mark.parametrize("values", [(1.0, 2.0), (-2.0, -1.0), (math.nan, 1.0), (-1.0, math.nan)])
def test_ends_that_enclose_no_root_are_refused(values):
    with pytest.raises(NumericalError, match="do not enclose a root"):
        root_between(lambda x: x, (0.0, values[0]), (1.0, values[1]), 1e-6)


def test_values_that_are_none_or_out_of_order_are_refused():
    with pytest.raises(NumericalError, match="met nan"):
        root_between(lambda x: math.nan, (0.0, -1.0), (1.0, 1.0), 1e-6)
    rising_and_falling = (0.0, -1.0), (1.0, 1.0)
    with pytest.raises(NumericalError, match="met 7 at"):
        root_between(lambda x: 7.0, *rising_and_falling, 1e-6, order=1e-9)
    low, high = root_between(lambda x: 7.0 if x > 0.25 else -7.0, *rising_and_falling, 1e-6)
    assert low <= 0.25 <= high


def test_a_value_that_is_not_reached_is_refused():
    assert smallest_reaching(lambda x: x, 1.0, 0.0, 1.0) == 1.0
    for rising in (lambda x: 0.5 * x, lambda x: -x, lambda x: math.nan):
        with pytest.raises(NumericalError, match="is not between"):
            smallest_reaching(rising, 1.0, 0.0, 1.0)
