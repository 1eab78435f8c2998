"""Detect whether the model lacks anything at all, at a stated rate of false alarms.

The largest -log10 p over all effects is compared with what it reaches on noise. The noise is the whitened residuals
without what any effect explains. A wild bootstrap draws a sign for every instant anew, so that the noise keeps its size
as that varies with the motion.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.decide.survey.screen import Screen

FALSE_ALARM_RATE = 0.01
CLEAR_MINUS_LOG10_P = 6.0  # from which on a flaw of the noise model is not enough of an explanation
_REPLICATES = 400
_BATCH = 100


@dataclass(frozen=True)
class Detection:
    """How improbable the residuals would be if nothing were missing.

    Attributes:
        p_value: probability of as large a -log10 p on noise. minus_log10_p: the largest over all effects.
        threshold: the -log10 p at which the false-alarm rate is reached. false_alarm_rate: the rate.

    minus_log10_p and threshold are of p-values that are not corrected for trying many effects; p_value is.
    """

    p_value: float
    minus_log10_p: float
    threshold: float
    false_alarm_rate: float = FALSE_ALARM_RATE

    @property
    def found(self) -> bool:
        """Whether anything is missing."""
        return self.p_value < self.false_alarm_rate

    @property
    def in_doubt(self) -> bool:
        """Whether a flaw of the noise model could have raised the alarm."""
        return self.minus_log10_p < CLEAR_MINUS_LOG10_P


def trials(screen: Screen, by_instant: np.ndarray, seed: int) -> np.ndarray:
    """(400,) the largest -log10 p over all effects, in that many draws of noise.

    Args:
        screen: tests of the effects. by_instant: (k, instants) products of each signature with whitened residuals that
            no effect explains, summed over the numbers of one instant; these share their sign.
    """
    generator = np.random.default_rng([seed, 1])
    largest = []
    for _ in range(0, _REPLICATES, _BATCH):
        signs = 2.0 * generator.integers(0, 2, size=(by_instant.shape[1], _BATCH), dtype=np.int8) - 1.0
        largest.append(screen.largest(by_instant @ signs))
    return np.concatenate(largest)


def detect(minus_log10_p: float, largest: np.ndarray) -> Detection:
    """The Detection for the largest -log10 p in the residuals.

    largest: (trials,) the largest -log10 p in draws of noise. There P(largest > e) = 1 - exp(-M 10^-e), with an
    effective number M of independent effects, which is taken from the upper tenth of the trials.
    """
    upper = np.quantile(largest, 0.9)
    log10_effective = np.log10(-np.log(0.9)) + upper
    with np.errstate(over="ignore"):  # nothing is as clear as the draws
        p_value = float(-np.expm1(-(10.0 ** (log10_effective - minus_log10_p))))
    threshold = float(log10_effective - np.log10(-np.log1p(-FALSE_ALARM_RATE)))
    return Detection(p_value, float(minus_log10_p), threshold)
