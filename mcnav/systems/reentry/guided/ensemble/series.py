"""Taylor series of truth, navigator and lift law about the begin of a step, by recurrences of their coefficients.

In cartesian inertial axes, X horizontal and Y up at the reference axes, position x and velocity v obey

    v' = -mu x / r^3 + f,  f = h (-a + Lambda e x a),  h = rho C_D A V / (2 m),  a = v - Omega x r,  V = |a|,

with the lift-to-drag ratio Lambda and ``e x a = (-a_Y, a_X)`` (NASA TN D-1772, eqs. 1-4). The navigator has the same
equation with the indicated force (eqs. 5-9): of the platform turned by ``m + d t`` the axes feel ``f_X cos - f_Y sin``
and, down, ``-f_X sin - f_Y cos``. A product has the coefficients ``(u w)_n = sum u_k w_(n-k)``; all other functions
obey differential equations in products:

    r^2 = x . x,    r w' = -3 r' w  for  w = r^-3,    E rho' = A r_0^2 r' rho  with  E = c d,

d = r_0 + altitude, c = d (1 + B (H - H_b)) and H = r_0 - r_0^2 / d the geopotential altitude: c is linear in r.
B = L / T_b, A = -(L + g_0 M_0 / R*) / T_b with the lapse L of the layer.

Each row of the array of series holds the coefficients of one quantity, of `PART` samples: shape (ROWS, ORDER + 2,
PART).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import PART, Vector, load_part, store_part
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.atmosphere import GEOPOTENTIAL_RADIUS, HYDROSTATIC_GRADIENT, layer_density
from mcnav.systems.reentry.guided.description import GuidedError
from mcnav.systems.reentry.guided.ensemble.tables import (
    FOLLOWING,
    GAIN_POWERS,
    POWERS,
    PROPORTIONAL,
    Flags,
    Tables,
)
from mcnav.systems.reentry.instruments import Error

ORDER: Final = 22
"""Terms of a series beyond the first."""

X, Y, VX, VY, S, R, RR, W, GROWTH, INVERSE = range(10)
"""Position, velocity, square of the radius, radius, its rate, radius^-3, what `quotient` takes for it, the inverse of
the first coefficient of the radius; of the truth."""
INDICATED: Final = 10
"""First row of the same of the navigator."""
E, RHO, RHO_GROWTH, AX, AY, SPEED_2, SPEED, HALF, LIFT, FX, FY, GX, GY, COSINE, SINE = range(20, 35)
"""c d; rho C_D A / (2 m), and what `quotient` takes for it; velocity in the air; its square and size; h; Lambda; f;
h a; cosine and sine of the platform's turn."""
COMMAND: Final = 35
"""L/D before the limit."""
ANGLE, ANGLE_RATE, SHARES = 36, 37, 38
"""Range angle since the last knot, its rate; from `SHARES` on the nested sums of the polynomials, 4 times POWERS."""
ROWS: Final = SHARES + 4 * POWERS

TURNS: Final = 6
"""Terms of the platform's turn that matter: a step is so short that it turns by a hundredth at most."""

MOST_TURN: Final = 0.01
"""rad."""

OFFSET: Final = GEOPOTENTIAL_RADIUS - EARTH_RADIUS

BETA, SLOPE, DECAY, ON, SHARE, FIXED, PER_E, PER_SPEED = range(8)
"""Rows of constants of a step: ``E = beta d^2 - slope d``; A r_0^2; accelerometers' switch; Lambda is ``SHARE`` times
the command plus ``FIXED``; inverses of the first coefficients of E and V."""
CONSTANTS: Final = 8


@allocation_free_part
def product(series: Array, one: int, other: int, n: int) -> Vector:
    """Return coefficient n of a product; two sums at a time, since each addition waits for the one before."""
    even = load_part(series, (one, 0)) * load_part(series, (other, n))
    odd = 0.0 * even
    for k in range(1, n, 2):
        odd = odd + load_part(series, (one, k)) * load_part(series, (other, n - k))
        even = even + load_part(series, (one, k + 1)) * load_part(series, (other, n - k - 1))
    if n % 2 == 1:
        odd = odd + load_part(series, (one, n)) * load_part(series, (other, 0))
    return even + odd


@allocation_free_part
def products(series: Array, one: int, first: int, second: int, n: int) -> tuple[Vector, Vector]:
    """Return coefficient n of the products of one row with two."""
    factor = load_part(series, (one, 0))
    even_1, even_2 = factor * load_part(series, (first, n)), factor * load_part(series, (second, n))
    odd_1, odd_2 = 0.0 * even_1, 0.0 * even_2
    for k in range(1, n, 2):
        factor = load_part(series, (one, k))
        odd_1 = odd_1 + factor * load_part(series, (first, n - k))
        odd_2 = odd_2 + factor * load_part(series, (second, n - k))
        factor = load_part(series, (one, k + 1))
        even_1 = even_1 + factor * load_part(series, (first, n - k - 1))
        even_2 = even_2 + factor * load_part(series, (second, n - k - 1))
    if n % 2 == 1:
        factor = load_part(series, (one, n))
        odd_1 = odd_1 + factor * load_part(series, (first, 0))
        odd_2 = odd_2 + factor * load_part(series, (second, 0))
    return even_1 + odd_1, even_2 + odd_2


@allocation_free_part
def squares(series: Array, one: int, other: int, n: int) -> Vector:
    """Return coefficient n of the sum of two squares: twice the products of unlike terms, and a square."""
    first = 0.0 * load_part(series, (one, 0))
    second = first
    for k in range((n + 1) // 2):
        first = first + load_part(series, (one, k)) * load_part(series, (one, n - k))
        second = second + load_part(series, (other, k)) * load_part(series, (other, n - k))
    total = 2.0 * (first + second)
    if n % 2 == 0:
        first, second = load_part(series, (one, n // 2)), load_part(series, (other, n // 2))
        total = total + first * first + second * second
    return total


@allocation_free_part
def inner(series: Array, one: int, other: int, n: int) -> Vector:
    """Return coefficient n of a product without its first and last terms; n is at least 1."""
    odd = 0.0 * load_part(series, (one, 0))
    even = odd
    for k in range(1, n - 1, 2):
        odd = odd + load_part(series, (one, k)) * load_part(series, (other, n - k))
        even = even + load_part(series, (one, k + 1)) * load_part(series, (other, n - k - 1))
    if n % 2 == 0:
        odd = odd + load_part(series, (one, n - 1)) * load_part(series, (other, 1))
    return even + odd


@allocation_free_part
def inner_square(series: Array, row: int, n: int) -> Vector:
    """Return coefficient n of a square without its first and last terms; n is at least 1."""
    total = 0.0 * load_part(series, (row, 0))
    for k in range(1, (n + 1) // 2):
        total = total + load_part(series, (row, k)) * load_part(series, (row, n - k))
    total = 2.0 * total
    if n % 2 == 0:
        middle = load_part(series, (row, n // 2))
        total = total + middle * middle
    return total


@allocation_free_part
def quotient(series: Array, one: int, other: int, of: int, n: int) -> Vector:
    """Return the sum of ``(other_k - n one_k) of_(n-k)`` over k from 1 to n: n ``one_0 of_n`` where it solves

    ``one of' = growth of``, with ``other_k = growth_(k-1) + k one_k``.
    """
    factor = load_part(series, (of, n - 1))
    growth, rest = load_part(series, (other, 1)) * factor, load_part(series, (one, 1)) * factor
    for k in range(2, n + 1):
        factor = load_part(series, (of, n - k))
        growth = growth + load_part(series, (other, k)) * factor
        rest = rest + load_part(series, (one, k)) * factor
    return growth - float(n) * rest


@allocation_free_part
def turned(series: Array, n: int) -> tuple[Vector, Vector]:
    """Return coefficient n of the force along the platform's axes, of whose turn `TURNS` terms matter."""
    cosine, sine = load_part(series, (COSINE, 0)), load_part(series, (SINE, 0))
    force_x, force_y = load_part(series, (FX, n)), load_part(series, (FY, n))
    along_x, along_z = cosine * force_x - sine * force_y, sine * force_x + cosine * force_y
    for k in range(1, min(n, TURNS - 1) + 1):
        cosine, sine = load_part(series, (COSINE, k)), load_part(series, (SINE, k))
        force_x, force_y = load_part(series, (FX, n - k)), load_part(series, (FY, n - k))
        along_x = along_x + cosine * force_x - sine * force_y
        along_z = along_z + sine * force_x + cosine * force_y
    return along_x, -along_z


@allocation_free_part
def begin_radius(series: Array, of: int) -> None:
    """Write the first coefficients of radius and radius^-3."""
    x, y = load_part(series, (of + X, 0)), load_part(series, (of + Y, 0))
    square = x * x + y * y
    radius = np.sqrt(square)
    store_part(series, (of + S, 0), square)
    store_part(series, (of + R, 0), radius)
    store_part(series, (of + W, 0), 1.0 / (square * radius))
    store_part(series, (of + INVERSE, 0), 1.0 / radius)


@allocation_free_part
def extend_radius(series: Array, of: int, n: int) -> None:
    """Write coefficient n + 1 of position, r^2 and r, and n of r', from coefficient n of the velocity."""
    share = 1.0 / (n + 1.0)
    store_part(series, (of + X, n + 1), share * load_part(series, (of + VX, n)))
    store_part(series, (of + Y, n + 1), share * load_part(series, (of + VY, n)))
    # r^2 = x^2 + y^2, and 2 r_0 r_n = (r^2)_n - the inner terms of r r
    square = squares(series, of + X, of + Y, n + 1)
    inverse = load_part(series, (of + INVERSE, 0))
    radius = 0.5 * (square - inner_square(series, of + R, n + 1)) * inverse
    store_part(series, (of + S, n + 1), square)
    store_part(series, (of + R, n + 1), radius)
    store_part(series, (of + RR, n), (n + 1.0) * radius)
    store_part(series, (of + GROWTH, n + 1), (-2.0 * (n + 1.0)) * radius)


@allocation_free_part
def extend_gravity(series: Array, of: int, n: int) -> tuple[Vector, Vector]:
    """Write coefficient n of w = r^-3, and return that of the gravity, -mu x w."""
    if n > 0:
        # r w' = -3 r' w
        times = quotient(series, of + R, of + GROWTH, of + W, n) * load_part(series, (of + INVERSE, 0))
        store_part(series, (of + W, n), (1.0 / n) * times)
    along_x, along_y = products(series, of + W, of + X, of + Y, n)
    return -GRAVITATIONAL_PARAMETER * along_x, -GRAVITATIONAL_PARAMETER * along_y


@allocation_free_part
def begin_air(series: Array, constants: Array, errors: Array, modes: Flags, tables: Tables) -> None:
    """Write the layer's constants, and the first coefficient of rho C_D A / (2 m) with density and drag errors."""
    for lane in range(PART):
        band = modes[0, lane]
        base, temperature, lapse, density = tables.layers[band]
        growth = lapse / temperature
        constants[BETA, lane] = 1.0 + growth * (GEOPOTENTIAL_RADIUS - base)
        constants[SLOPE, lane] = growth * GEOPOTENTIAL_RADIUS * GEOPOTENTIAL_RADIUS
        constants[DECAY, lane] = (
            -(lapse + HYDROSTATIC_GRADIENT) / temperature * GEOPOTENTIAL_RADIUS * GEOPOTENTIAL_RADIUS
        )
        constants[ON, lane] = tables.on[band]
        air = layer_density(series[R, 0, lane] - EARTH_RADIUS, base, temperature, lapse, density)
        factor = (1.0 + errors[GuidedError.DENSITY, lane]) * (1.0 + errors[GuidedError.DRAG, lane])
        series[RHO, 0, lane] = 0.5 * tables.ballistic * factor * air
    distance = load_part(series, (R, 0)) + OFFSET
    beta, slope = load_part(constants, (BETA,)), load_part(constants, (SLOPE,))
    first = distance * (beta * distance - slope)
    store_part(series, (E, 0), first)
    store_part(constants, (PER_E,), 1.0 / first)


@allocation_free_part
def extend_air(series: Array, constants: Array, n: int) -> None:
    """Write coefficient n of E, rho C_D A / (2 m), the velocity in the air and its size, and h."""
    if n > 0:
        # E = beta d^2 - slope d with d^2 = r^2 + 2 OFFSET r + ...
        beta, slope = load_part(constants, (BETA,)), load_part(constants, (SLOPE,))
        radius = load_part(series, (R, n))
        square = load_part(series, (S, n)) + (2.0 * OFFSET) * radius
        first = beta * square - slope * radius
        store_part(series, (E, n), first)
        # E rho' = A r_0^2 r' rho
        growth = load_part(constants, (DECAY,)) * load_part(series, (RR, n - 1))
        store_part(series, (RHO_GROWTH, n), growth + float(n) * first)
        times = quotient(series, E, RHO_GROWTH, RHO, n) * load_part(constants, (PER_E,))
        store_part(series, (RHO, n), (1.0 / n) * times)
    # a = v - Omega x r, V^2 = a . a
    store_part(series, (AX, n), load_part(series, (VX, n)) - EARTH_RATE * load_part(series, (Y, n)))
    store_part(series, (AY, n), load_part(series, (VY, n)) + EARTH_RATE * load_part(series, (X, n)))
    square = squares(series, AX, AY, n)
    store_part(series, (SPEED_2, n), square)
    if n == 0:
        speed = np.sqrt(square)
        store_part(series, (SPEED, 0), speed)
        store_part(constants, (PER_SPEED,), 1.0 / speed)
    else:
        rest = square - inner_square(series, SPEED, n)
        store_part(series, (SPEED, n), 0.5 * rest * load_part(constants, (PER_SPEED,)))
    store_part(series, (HALF, n), product(series, RHO, SPEED, n))


@allocation_free_part
def begin_command(series: Array, modes: Flags, tables: Tables) -> None:
    """Write the range angle since the last knot, which a law that follows the nominal needs; see `extend_command`."""
    of = INDICATED if tables.input_indicated else 0
    for lane in range(PART):
        angle = np.arctan2(series[of + X, 0, lane], series[of + Y, 0, lane])
        angle += 2.0 * np.pi * modes[4 if tables.input_indicated else 3, lane]
        number = max(0, modes[5, lane])
        series[ANGLE, 0, lane] = angle - tables.knots[min(number, len(tables.knots) - 1)]


@allocation_free_part
def extend_command(series: Array, modes: Flags, tables: Tables, n: int) -> None:
    """Write coefficient n of L/D before the limit."""
    of = INDICATED if tables.input_indicated else 0
    if tables.law == PROPORTIONAL:
        # -k r'
        store_part(series, (COMMAND, n), tables.gain * load_part(series, (of + RR, n)))
    elif tables.law == FOLLOWING:
        _extend_following(series, of, modes, tables, n)
    else:
        store_part(series, (COMMAND, n), 0.0 * load_part(series, (of + RR, n)))


@allocation_free_part
def _extend_following(series: Array, of: int, modes: Flags, tables: Tables, n: int) -> None:
    """Write coefficient n of ``p_0(s) + p_1(s) r + p_2(s) r' + p_3(s) r_E theta'``; see `FollowingLaw`."""
    # r^2 theta' = v_X Y - v_Y X
    turning = product(series, of + VX, of + Y, n) - product(series, of + VY, of + X, n)
    rate = turning
    if n > 0:
        rate = (
            turning
            - inner(series, of + S, ANGLE_RATE, n)
            - load_part(series, (of + S, n)) * load_part(series, (ANGLE_RATE, 0))
        )
    inverse = load_part(series, (of + INVERSE, 0))
    rate = rate * inverse * inverse
    store_part(series, (ANGLE_RATE, n), rate)
    store_part(series, (ANGLE, n + 1), (1.0 / (n + 1.0)) * rate)
    # nested sums ((c_3 s + c_2) s + c_1) s + c_0 of each polynomial, held at the last knot
    count, last = len(tables.polynomials), len(tables.knots) - 1
    for one in range(4):
        terms = POWERS if one == 0 else GAIN_POWERS
        for power in range(terms - 1, -1, -1):
            row = SHARES + one * POWERS + power
            if power < terms - 1:
                store_part(series, (row, n), product(series, row + 1, ANGLE, n))
            else:
                store_part(series, (row, n), 0.0 * rate)
            for lane in range(PART):
                number = modes[5, lane]
                if number < 0 or number >= count:
                    if power == 0 and n == 0:
                        series[row, 0, lane] = tables.lift if number < 0 else _at_last(tables, one, last)
                        series[row, 0, lane] *= 1.0 if number >= 0 or one == 0 else 0.0
                    else:
                        series[row, n, lane] = 0.0
                elif n == 0:
                    series[row, 0, lane] += tables.polynomials[number, one, power]
    command = load_part(series, (SHARES, n))
    command = command + product(series, SHARES + POWERS, of + R, n)
    command = command + product(series, SHARES + 2 * POWERS, of + RR, n)
    command = command + EARTH_RADIUS * product(series, SHARES + 3 * POWERS, ANGLE_RATE, n)
    store_part(series, (COMMAND, n), command)


@allocation_free_part
def _at_last(tables: Tables, one: int, last: int) -> float:
    """Evaluate a polynomial of the last interval at the last knot."""
    step = tables.knots[last] - tables.knots[last - 1]
    value = 0.0
    for power in range(POWERS - 1, -1, -1):
        value = value * step + tables.polynomials[last - 1, one, power]
    return value


@allocation_free_part
def extend_force(series: Array, constants: Array, n: int) -> None:
    """Write coefficient n of Lambda and of the specific force: ``f = -h a + Lambda e x (h a)``."""
    lift = load_part(constants, (SHARE,)) * load_part(series, (COMMAND, n))
    if n == 0:
        lift = lift + load_part(constants, (FIXED,))
    store_part(series, (LIFT, n), lift)
    drag_x, drag_y = products(series, HALF, AX, AY, n)
    store_part(series, (GX, n), drag_x)
    store_part(series, (GY, n), drag_y)
    turned_x, turned_y = products(series, LIFT, GX, GY, n)
    store_part(series, (FX, n), -drag_x - turned_y)
    store_part(series, (FY, n), turned_x - drag_y)


@allocation_free_part
def indicated_force(series: Array, constants: Array, errors: Array, n: int) -> tuple[Vector, Vector]:
    """Return coefficient n of the indicated force along X and Y (NASA TN D-1772, eqs. 6-9)."""
    on = load_part(constants, (ON,))
    scale_x, scale_z = load_part(errors, (Error.SCALE_FACTOR_X,)), load_part(errors, (Error.SCALE_FACTOR_Z,))
    # along the platform's axes; the second one points down
    along_x, along_z = turned(series, n)
    measured_x = (1.0 + scale_x) * along_x + load_part(errors, (Error.CROSS_AXIS_X,)) * along_z
    measured_z = (1.0 + scale_z) * along_z + load_part(errors, (Error.CROSS_AXIS_Z,)) * along_x
    if n == 0:
        measured_x = measured_x + load_part(errors, (Error.BIAS_X,)) * (1.0 + scale_x)
        measured_z = measured_z + load_part(errors, (Error.BIAS_Z,)) * (1.0 + scale_z)
    return on * measured_x, -on * measured_z


@allocation_free_part
def extend(series: Array, constants: Array, errors: Array, modes: Flags, tables: Tables) -> None:
    """Write all coefficients from the first ones of positions and velocities, in the bands and regimes of the lanes."""
    begin_radius(series, 0)
    begin_radius(series, INDICATED)
    begin_air(series, constants, errors, modes, tables)
    if tables.law == FOLLOWING:
        begin_command(series, modes, tables)
    drift = load_part(errors, (Error.GYRO_DRIFT,))
    for n in range(ORDER + 1):
        share = 1.0 / (n + 1.0)
        extend_radius(series, 0, n)
        extend_radius(series, INDICATED, n)
        extend_air(series, constants, n)
        extend_command(series, modes, tables, n)
        extend_force(series, constants, n)
        gravity_x, gravity_y = extend_gravity(series, 0, n)
        store_part(series, (VX, n + 1), share * (gravity_x + load_part(series, (FX, n))))
        store_part(series, (VY, n + 1), share * (gravity_y + load_part(series, (FY, n))))
        force_x, force_y = indicated_force(series, constants, errors, n)
        gravity_x, gravity_y = extend_gravity(series, INDICATED, n)
        store_part(series, (INDICATED + VX, n + 1), share * (gravity_x + force_x))
        store_part(series, (INDICATED + VY, n + 1), share * (gravity_y + force_y))
        # cos' = -d sin, sin' = d cos
        if n + 1 < TURNS:
            cosine, sine = load_part(series, (COSINE, n)), load_part(series, (SINE, n))
            store_part(series, (COSINE, n + 1), -share * drift * sine)
            store_part(series, (SINE, n + 1), share * drift * cosine)
