"""Levels of chance and of correlation that several stages share."""

from scipy.stats import norm

CHANCE = 0.001  # probability that noise is taken for more, where some thirty channels are looked at
CERTAIN = float(norm.isf(CHANCE))  # the same in standard deviations
BLOCK_TICKS = 200  # about a second, within which noise may still be correlated
LEAST_SPREAD = 0.2  # of a size over parts of the runs (standard deviation), of its mean: less is a flaw of its form
