"""sin, cos, tanh, exp, log, atan2 and floor for kernels, without a branch and without a call of the system's library.

LLVM turns such functions into vector instructions, and they give the same bits on every machine that has fused
multiply-add. Polynomials are Taylor's, over ranges so narrow that they end below the last bit. Compared with exact
values the error is below one unit in the last place: sin and cos for |x| up to 1e6, where the range reduction ends
being exact; tanh everywhere; exp where its result is a normal number; log of positive normal numbers; atan2 of numbers
between 1e-300 and 1e300. NaN gives NaN, so do infinite arguments of sin, cos and atan2.
"""

import math

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from drake_ispace.blocks.kernels import kernel

_SHIFT = 1.5 * 2.0**52  # x + _SHIFT is x rounded to a whole number n, with n in its lowest bits
#: pi / 2 and ln 2 as sums of numbers, each with what the one before it does not hold.
_HALF_PI, _HALF_PI_REST, _HALF_PI_LEAST = math.pi / 2.0, 6.123233995736766e-17, -1.4973849048591833e-33
_LN2, _LN2_REST = math.log(2.0), 2.3190468138462996e-17
_SQRT2 = math.sqrt(2.0)
_F = tuple(1.0 / math.factorial(k) for k in range(18))


@intrinsic
def _fma(typing_context, a, b, c):
    def codegen(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), codegen


@intrinsic
def signed(typing_context, size, sign):
    """The number `size` with the sign of `sign`."""

    def codegen(context, builder, signature, arguments):
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double, double])
        function = builder.module.declare_intrinsic("llvm.copysign", [double], kind)
        return builder.call(function, arguments)

    return types.float64(types.float64, types.float64), codegen


@intrinsic
def _floor(typing_context, x):
    def codegen(context, builder, signature, arguments):
        function = builder.module.declare_intrinsic("llvm.floor", [ir.DoubleType()])
        return builder.call(function, arguments)

    return types.float64(types.float64), codegen


@intrinsic
def bits_of(typing_context, x):
    """The 64 bits of a float64 as an integer."""

    def codegen(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), codegen


@intrinsic
def of_bits(typing_context, bits):
    """The float64 that has these 64 bits."""

    def codegen(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), codegen


def _rounded_twice(a, b, c):
    return a * b + c


@kernel(stands_for=_rounded_twice)
def fma(a, b, c):
    """Return a * b + c, rounded once."""
    return _fma(a, b, c)


@kernel
def _circle(x):
    """Return sine and cosine of x less the nearest multiple n of pi / 2, and n as the lowest bits of an integer."""
    shifted = x * (2.0 / math.pi) + _SHIFT
    n = shifted - _SHIFT
    coarse = fma(-n, _HALF_PI, x)
    fine = n * _HALF_PI_REST
    r = coarse - fine
    back = coarse - r  # what rounding took from r is kept in `rest`, whichever of the two was larger
    rest = (coarse - (r + back)) + (back - fine) - fma(n, _HALF_PI_REST, -fine) - n * _HALF_PI_LEAST
    z = r * r
    zz = z * z
    high = fma(zz, fma(z, _F[17], -_F[15]), fma(z, _F[13], -_F[11]))
    odd = fma(zz * zz, high, fma(zz, fma(z, _F[9], -_F[7]), fma(z, _F[5], -_F[3])))
    high = fma(zz, _F[16], fma(z, -_F[14], _F[12]))
    even = fma(zz * zz, high, fma(zz, fma(z, -_F[10], _F[8]), fma(z, -_F[6], _F[4])))
    most = 1.0 - 0.5 * z
    sine = r + fma(z * r, odd, rest)
    cosine = most + (((1.0 - most) - 0.5 * z) + fma(zz, even, -r * rest))
    return sine, cosine, bits_of(shifted)


@kernel(stands_for=np.floor)
def floor(x):
    """Return the largest whole number that is not above x."""
    return _floor(x)


@kernel(stands_for=np.sin)
def sin(x):
    """Return the sine of x [rad]."""
    sine, cosine, quarter = _circle(x)
    size = cosine if quarter & 1 else sine
    return -size if quarter & 2 else size


@kernel(stands_for=np.cos)
def cos(x):
    """Return the cosine of x [rad]."""
    sine, cosine, quarter = _circle(x)
    size = sine if quarter & 1 else cosine
    return -size if (quarter + 1) & 2 else size


@kernel
def _exponential(x):
    """Return n and e^r - 1 as the sum of two numbers, the second one small, with x = n ln 2 + r; n with _SHIFT."""
    shifted = x * (1.0 / _LN2) + _SHIFT
    n = shifted - _SHIFT
    coarse = fma(-n, _LN2, x)
    r = fma(-n, _LN2_REST, coarse)
    rest = fma(-n, _LN2_REST, coarse - r)
    z = r * r
    zz = z * z
    high = fma(zz, fma(r, _F[13], _F[12]), fma(z, fma(r, _F[11], _F[10]), fma(r, _F[9], _F[8])))
    low = fma(z, fma(r, _F[7], _F[6]), fma(r, _F[5], _F[4]))
    bend = z * fma(z, fma(zz, high, low), fma(r, _F[3], _F[2]))
    sum_ = r + bend
    return shifted, sum_, ((r - sum_) + bend) + rest * (1.0 + r)


@kernel
def _two_to(shifted):
    """Return 2^n for n with _SHIFT, -1022 <= n <= 1023."""
    return of_bits((bits_of(shifted) + 1023) << 52)


@kernel(stands_for=np.exp)
def exp(x):
    """Return e^x."""
    within = min(max(x, -750.0), 710.0)
    shifted, most, rest = _exponential(within if x == x else x)
    one = 1.0 + most
    grown = one + (((1.0 - one) + most) + rest)
    half = 0.5 * (shifted - _SHIFT)  # in two steps, as 2^n itself may be no normal number
    first = half + _SHIFT
    second = (shifted - _SHIFT) - (first - _SHIFT) + _SHIFT
    return grown * _two_to(first) * _two_to(second)


@kernel(stands_for=np.tanh)
def tanh(x):
    """Return the hyperbolic tangent of x, (e^2x - 1) / (e^2x + 1)."""
    double = 2.0 * abs(x)
    shifted, most, rest = _exponential(double)
    power = _two_to(shifted)
    less = power - 1.0
    top = fma(power, most, less)
    top_rest = fma(power, most, less - top) + power * rest
    bottom = top + 2.0
    bottom_rest = (top - (bottom - 2.0)) + top_rest
    share = 1.0 / bottom
    ratio = top * share
    ratio += (fma(-ratio, bottom, top) + (top_rest - ratio * bottom_rest)) * share
    return signed(1.0 if double > 44.0 else ratio, x)


@kernel(stands_for=np.log)
def log(x):
    """Return the natural logarithm of a positive normal number; NaN of a negative one, minus infinity of zero."""
    bits = bits_of(x)
    exponent = (bits - bits_of(_SQRT2) + bits_of(2.0)) >> 52  # the mantissa lies around 1, between root 1/2 and root 2
    mantissa = of_bits(bits - ((exponent - 1023) << 52))
    n = of_bits(exponent - 1023 + bits_of(_SHIFT)) - _SHIFT
    f = mantissa - 1.0
    s = f / (2.0 + f)
    z = s * s
    zz = z * z
    high = fma(zz, fma(z, 2.0 / 23.0, 2.0 / 21.0), fma(z, 2.0 / 19.0, 2.0 / 17.0))
    middle = fma(zz, fma(z, 2.0 / 15.0, 2.0 / 13.0), fma(z, 2.0 / 11.0, 2.0 / 9.0))
    low = fma(z, fma(z, 2.0 / 7.0, 2.0 / 5.0), 2.0 / 3.0)
    half = 0.5 * f * f
    bend = s * fma(z, fma(zz * z, fma(zz * zz, high, middle), low), half)
    value = fma(n, _LN2, f - (half - fma(n, _LN2_REST, bend)))
    value = x if x == np.inf else value
    return value if x > 0.0 else (-np.inf if x == 0.0 else np.nan)


#: Arctangents of 0, 1/8 to 1, as sums of two numbers.
_ANGLES = tuple(math.atan(k / 8.0) for k in range(9))
_ANGLES_REST = (
    0.0, -3.1253241424539383e-18, 1.0698755618734451e-17, -2.4623815582638635e-17, 2.2698777452961687e-17,
    -5.4556305485916264e-18, 1.5834785051444286e-17, -2.1478388444456983e-17, 3.061616997868383e-17,
)


@kernel(stands_for=np.arctan2)
def atan2(y, x):
    """Return the angle [rad] of the point (x, y), between -pi and pi."""
    width, height = abs(x), abs(y)
    steep, behind = height > width, x < 0.0
    long, short = (height, width) if steep else (width, height)
    long = 1.0 if long == 0.0 else long
    eighth = (short * (8.0 / long) + _SHIFT) - _SHIFT
    node = 0.125 * eighth
    above, below = fma(-node, long, short), fma(node, short, long)
    below_rest = fma(node, short, long - below)
    share = 1.0 / below
    s = above * share
    s_rest = (fma(-s, below, above) - s * below_rest) * share
    z = s * s
    zz = z * z
    high = fma(z, fma(z, 1.0 / 13.0, -1.0 / 11.0), 1.0 / 9.0)
    bend = s * z * fma(zz * z, high, fma(z, fma(z, -1.0 / 7.0, 1.0 / 5.0), -1.0 / 3.0))
    angle, angle_rest = 0.0, 0.0
    for k in range(1, 9):
        angle, angle_rest = (_ANGLES[k], _ANGLES_REST[k]) if eighth == k else (angle, angle_rest)
    way = -1.0 if steep != behind else 1.0
    base = _HALF_PI if steep else (2.0 * _HALF_PI if behind else 0.0)
    coarse = fma(way, angle, base)
    fine = fma(way, angle, base - coarse)
    sum_ = fma(way, s, coarse)
    least = way * (angle_rest + bend + s_rest) + base * (_HALF_PI_REST / _HALF_PI)
    rest = fma(way, s, coarse - sum_) + (fine + least)
    return signed(sum_ + rest, y)
