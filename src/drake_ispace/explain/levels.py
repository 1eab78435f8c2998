"""Levels of chance and of correlation that several stages share."""

CHANCE = 0.001  # probability that noise is taken for more, where some thirty channels are looked at
CERTAIN = 3.0  # standard deviations, beyond which nothing is chance
BLOCK_TICKS = 200  # about a second, within which noise may still be correlated
