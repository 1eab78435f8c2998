"""Does an error come again in every run of the same motion? Noise does not."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student_t

SAME_MOTION = 0.1  # share of the squared speed by which the same motion may differ, as where it begins a little later
BLOCKS = 10  # of a run, in which errors are independent of each other


def repeated_share(runs: Sequence[tuple[np.ndarray, np.ndarray]], most_blocks: int = BLOCKS) -> tuple[float, float]:
    """Share of the squared errors that runs of the same motion say of each other, and the normal deviate of that.

    Args:
        runs: (speed (k, c), errors (k, d)) of each run, at the same times; a longer run is cut. most_blocks: into
            which time may be cut; the errors of different blocks are taken as independent.
    """
    pairs, blocks = [], min(most_blocks, BLOCKS)
    for i, (speed, own) in enumerate(runs):
        others = [errors for j, (other, errors) in enumerate(runs) if j != i and _same(speed, other)]
        if others:
            n = min(len(own), *(len(errors) for errors in others))
            pairs.append((own[:n], np.mean([errors[:n] for errors in others], axis=0)))
    blocks = min([blocks, *(len(own) for own, _ in pairs)])
    if not pairs or blocks < 2:
        return 0.0, 0.0
    products = np.array([
        sum(np.sum(parts[0] * parts[1]) for parts in each) for each in zip(*(
            zip(np.array_split(own, blocks), np.array_split(said, blocks), strict=True) for own, said in pairs
        ), strict=True)
    ])
    total = products.sum()
    squares = sum(np.sum(own**2) for own, _ in pairs), sum(np.sum(said**2) for _, said in pairs)
    share = total * abs(total) / max(squares[0] * squares[1], 1e-300)
    deviate = products.mean() / max(products.std(ddof=1) / np.sqrt(blocks), 1e-300)
    return float(share), float(norm.isf(student_t.sf(deviate, blocks - 1)))


def are_one_motion(speeds: Sequence[np.ndarray]) -> bool:
    """Whether several runs repeat one motion; speeds: (k, c) of each, at the same times."""
    return len(speeds) > 1 and all(_same(speeds[0], other) for other in speeds[1:])


def _same(one, other):
    n = min(len(one), len(other))
    apart, size = np.sum((one[:n] - other[:n]) ** 2), 0.5 * (np.sum(one[:n] ** 2) + np.sum(other[:n] ** 2))
    return n > 0 and apart < SAME_MOTION * size
