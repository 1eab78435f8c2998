"""Levels of chance and of correlation that several stages share."""

import numpy as np
from scipy.stats import chi2, norm

CHANCE = 0.001  # probability that noise is taken for more, where some thirty channels are looked at
CERTAIN = float(norm.isf(CHANCE))  # the same in standard deviations
BLOCK_TICKS = 200  # about a second, within which noise may still be correlated
LEAST_SPREAD = 0.2  # of a size over parts of the runs (standard deviation), of its mean: less is a flaw of its form


def largest_by_chance(count: int, components: int) -> float:
    """Times their median, beyond which the largest of so many distances lies by chance as rarely as CHANCE.

    Distances of so many normal components.
    """
    return float(np.sqrt(chi2.isf(CHANCE / count, components) / chi2.median(components)))
