"""Branch-free functions beside exact values: errors below one unit in the last place, signs, limits, plain Python."""

import math

import mpmath
import numpy as np
import pytest

from drake_ispace.blocks import functions
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel, plain

_DRAWS = 2000
_QUARTERS = np.arange(1, _DRAWS + 1) * (math.pi / 2.0)  # where a reduced angle nearly vanishes


def _uniform(low, high, seed=0):
    return np.random.default_rng(seed).uniform(low, high, _DRAWS)


def _wide(low, high, seed=1):
    """Both signs, sizes alike on a logarithmic scale."""
    generator = np.random.default_rng(seed)
    return np.exp(generator.uniform(math.log(low), math.log(high), _DRAWS)) * generator.choice([-1.0, 1.0], _DRAWS)


def _apart(value, exact):
    """Units in the last place of the exact value."""
    return float(abs(mpmath.mpf(value) - exact) / math.ulp(float(exact)))


CASES = {
    "sin": [_uniform(-7, 7), _uniform(-1e6, 1e6), _wide(1e-300, 10.0), _QUARTERS],
    "cos": [_uniform(-7, 7), _uniform(-1e6, 1e6), _wide(1e-300, 10.0), _QUARTERS],
    "tanh": [_uniform(-3, 3), _uniform(-30, 30), _wide(1e-300, 1.0)],
    "exp": [_uniform(-1, 1), _uniform(-700, 709), _wide(1e-20, 1.0)],
    "log": [np.abs(_wide(1e-300, 1e300)), _uniform(0.5, 2.0), 1.0 + _wide(1e-15, 0.1)],
}


@pytest.mark.parametrize("name", CASES)
def test_errors_are_below_one_unit_in_the_last_place(name):
    function, exactly = getattr(functions, name), getattr(mpmath, name)
    with mpmath.workprec(200):
        worst = [max(_apart(function(x), exactly(mpmath.mpf(x))) for x in xs.tolist()) for xs in CASES[name]]
    assert max(worst) < 1.0


@pytest.mark.parametrize("y, x", [
    (_uniform(-1, 1), _uniform(-1, 1, 2)), (_wide(1e-5, 1e5), _wide(1e-5, 1e5, 3)),
    (_wide(1e-100, 1e100), _wide(1e-100, 1e100, 3)), (_uniform(-0.3, 0.3), -np.ones(_DRAWS)),
])
def test_the_angle_of_a_point_is_exact_but_for_its_last_bit(y, x):
    with mpmath.workprec(200):
        points = zip(y.tolist(), x.tolist(), strict=True)
        assert max(_apart(functions.atan2(b, a), mpmath.atan2(b, a)) for b, a in points) < 1.0


def test_signs_and_limits():
    minus = [functions.tanh(-0.0), functions.atan2(-0.0, 1.0)]
    assert minus == [0.0] * 2 and all(math.copysign(1.0, value) < 0.0 for value in minus)
    assert [functions.tanh(x) for x in (50.0, -1e9, math.inf, -math.inf)] == [1.0, -1.0, 1.0, -1.0]
    assert [functions.exp(x) for x in (0.0, -math.inf, -1e6, 710.0, math.inf)] == [1.0, 0.0, 0.0, math.inf, math.inf]
    assert [functions.log(x) for x in (1.0, 0.0, math.inf)] == [0.0, -math.inf, math.inf]
    assert functions.exp(-744.0) == 1e-323 and functions.exp(709.7) == pytest.approx(math.exp(709.7), rel=1e-15)
    axes = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-0.0, -1.0), (-1.0, 0.0)]
    assert [functions.atan2(*point) for point in axes] == [math.atan2(*point) for point in axes]


@pytest.mark.parametrize("function, arguments", [
    (functions.sin, (math.nan,)), (functions.cos, (math.inf,)), (functions.tanh, (math.nan,)),
    (functions.exp, (math.nan,)), (functions.log, (math.nan,)), (functions.log, (-1.0,)),
    (functions.atan2, (math.nan, 1.0)), (functions.atan2, (1.0, math.nan)), (functions.atan2, (0.0, math.nan)),
])
def test_what_is_no_number_stays_none(function, arguments):
    assert math.isnan(function(*arguments))


@kernel
def _product(x, out):
    out[0] = sin(x) * cos(x)


def test_in_plain_python_numpy_takes_their_place():
    out = np.zeros(1)
    plain(_product)(0.3, out)
    assert out[0] == np.sin(0.3) * np.cos(0.3)
