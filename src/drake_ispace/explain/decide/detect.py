"""Stage 1, detect: whether anything is missing at all, at a stated rate of false alarms.

The largest minus_log10_p over all effects is compared with what it reaches on noise alone: residuals with every trace of
the library taken out, whitened, their signs drawn anew for every instant (a wild bootstrap, which keeps their sizes as
they vary with the motion).
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.decide.signatures import Screen

FALSE_ALARM_RATE = 0.01
_REPLICATES = 400
_BATCH = 100


@dataclass(frozen=True)
class Detection:
    """The largest minus_log10_p found, the p-value of so much on noise alone, and the threshold of the false-alarm rate.

    minus_log10_p and threshold are -log10 of a p-value before correction for trying many effects.
    """

    p_value: float
    minus_log10_p: float
    threshold: float
    false_alarm_rate: float = FALSE_ALARM_RATE

    @property
    def found(self) -> bool:
        return self.p_value < self.false_alarm_rate


def trials(screen: Screen, noise: np.ndarray, instants: np.ndarray, seed: int) -> np.ndarray:
    """(400,) the largest minus_log10_p over all effects on noise alone. instants: (rows,) which instant of which run
    each row belongs to; rows of one instant keep their signs together."""
    generator = np.random.default_rng([seed, 1])
    starts = np.flatnonzero(np.diff(instants, prepend=-1))
    products = np.add.reduceat(screen.marginalised * noise, starts, axis=1)
    largest = []
    for _ in range(0, _REPLICATES, _BATCH):
        signs = 2.0 * generator.integers(0, 2, size=(len(starts), _BATCH), dtype=np.int8) - 1.0
        largest.append(screen.minus_log10_p_of(products @ signs).max(axis=0))
    return np.concatenate(largest)


def detect(minus_log10_p: float, largest: np.ndarray) -> Detection:
    """The Detection, given what trials on noise alone reached.

    On noise, P(largest minus_log10_p > e) = 1 - exp(-M 10^-e) with an effective number M of independent effects, taken from
    the upper tenth of the trials.
    """
    upper = np.quantile(largest, 0.9)
    effective = -np.log(0.9) * 10.0**upper
    p_value = float(-np.expm1(-effective * 10.0 ** (-minus_log10_p)))
    threshold = float(np.log10(effective / -np.log1p(-FALSE_ALARM_RATE)))
    return Detection(p_value, float(minus_log10_p), threshold)
