"""Random numbers of the generator: every stream from (seed, name), coloured where the thing itself is slow."""

import zlib

import numpy as np
from numba import njit
from scipy.signal import lfilter


def stream(seed: int, name: str) -> np.random.Generator:
    """The generator of the stream `name` under `seed`."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def coloured(seed: int, name: str, rms: float, rows: int, step_s: float) -> np.ndarray:
    """(rows,) Ornstein-Uhlenbeck noise of standard deviation `rms`.

    Nine tenths of the variance forget within 30 to 80 ms (drawn), the rest within 1 s. step_s: between rows.
    """
    random = stream(seed, name)
    quick = random.uniform(0.03, 0.08)
    total = np.zeros(rows)
    for time_s, share in ((quick, 0.9), (1.0, 0.1)):
        memory = np.exp(-step_s / time_s)
        white = random.standard_normal(rows) * np.sqrt(1.0 - memory**2)
        white[0] = random.standard_normal()
        total += np.sqrt(share) * lfilter([1.0], [1.0, -memory], white)
    return rms * total


@njit(cache=True)
def between(rows, tick, share, out):
    """A row (n) of noise `share` of a tick after `tick`, linear in between, into `out`."""
    for i in range(out.shape[0]):
        out[i] = rows[tick, i] + share * (rows[tick + 1, i] - rows[tick, i])
