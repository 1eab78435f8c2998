"""Random numbers as a pure function of (seed, stream name, tick, channel).

There is no generator state, so a draw does not depend on the order of evaluation, on the wiring or on the thread. The
hash is SplitMix64 (Steele, Lea and Flood 2014). The inverse normal distribution is algorithm AS 241 (Wichura 1988).
"""

import hashlib

import numpy as np

from drake_ispace.blocks.functions import fma, log
from drake_ispace.blocks.kernels import kernel


def stream(seed: int, name: str) -> np.ndarray:
    """Return the key (2,) of the random stream `name` under `seed`: two 32-bit integers, each exact as a float64."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return np.array([int.from_bytes(digest[:4], "big"), int.from_bytes(digest[4:8], "big")], dtype=float)


@kernel
def _splitmix(state):
    z = state + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@kernel
def uniform(key, tick, channel):
    """Return a number that is uniform in the open interval (0, 1).

    key: (2,) from `stream`; tick, channel: integers >= 0.
    """
    state = (np.uint64(key[0]) << np.uint64(32)) | np.uint64(key[1])
    state = _splitmix(state ^ (np.uint64(tick) * np.uint64(0x9E3779B97F4A7C15)))
    state = _splitmix(state ^ (np.uint64(channel) * np.uint64(0xD1B54A32D192ED03)))
    return (np.float64(state >> np.uint64(12)) + 0.5) * 2.0**-52


@kernel
def _polynomial(r, c7, c6, c5, c4, c3, c2, c1, c0):
    high = fma(fma(fma(c7, r, c6), r, c5), r, c4)
    return fma(fma(fma(fma(high, r, c3), r, c2), r, c1), r, c0)


@kernel
def normal_quantile(p):
    """Return the quantile of the standard normal distribution at 0 < p < 1 (AS 241, PPND16)."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        numerator = _polynomial(
            r, 2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4,
            4.5921953931549871457e4, 1.3731693765509461125e4, 1.9715909503065514427e3,
            1.3314166789178437745e2, 3.3871328727963666080e0,
        )
        denominator = _polynomial(
            r, 5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4,
            2.1213794301586595867e4, 5.3941960214247511077e3, 6.8718700749205790830e2,
            4.2313330701600911252e1, 1.0,
        )
        factor = q
    else:
        factor = -1.0 if q < 0.0 else 1.0
        r = np.sqrt(-log(p if q < 0.0 else 1.0 - p))
        if r <= 5.0:
            r -= 1.6
            numerator = _polynomial(
                r, 7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
                1.27045825245236838258e0, 3.64784832476320460504e0, 5.76949722146069140550e0,
                4.63033784615654529590e0, 1.42343711074968357734e0,
            )
            denominator = _polynomial(
                r, 1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
                1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940e0,
                2.05319162663775882187e0, 1.0,
            )
        else:
            r -= 5.0
            numerator = _polynomial(
                r, 2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3,
                2.65321895265761230930e-2, 2.96560571828504891230e-1, 1.78482653991729133580e0,
                5.46378491116411436990e0, 6.65790464350110377720e0,
            )
            denominator = _polynomial(
                r, 2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5,
                7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1,
                5.99832206555887937690e-1, 1.0,
            )
    return factor * numerator / denominator  # one division for all


@kernel
def normal(key, tick, channel):
    """Return a number drawn from the standard normal distribution.

    key: (2,) from `stream`; tick, channel: integers >= 0.
    """
    return normal_quantile(uniform(key, tick, channel))
