"""Sizes that were not fitted to the run that they are judged on, where no run is held out.

Each run is left out in turn. A single run is cut into blocks, which take the place of runs. At the best fit the
deviance is nearly quadratic, so that one Gauss-Newton step without the rows of a run gives the sizes without it.
"""

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.fit.likelihood import Point, root_of
from drake_ispace.explain.predict.prediction import Prediction, predict
from drake_ispace.explain.predict.stretches import equal_parts
from drake_ispace.explain.prove.errors.free_run import HORIZONS_S

MOST_BLOCKS = 4  # of a single run


def sizes_without(decision: Decision, groups: np.ndarray) -> list[tuple[Point, np.ndarray]]:
    """For every group of whitened numbers the sizes of the named effects without it, and the root of their covariance.

    groups: (rows,) the group of each whitened number, from 0 on; -1: in none. The root (k, k) is in natural sizes.
    """
    likelihood, best = decision.end.likelihood, decision.named
    vectors = np.vstack([likelihood.slopes(best.point, best.order, best.w), best.w])
    found = []
    for group in range(int(groups.max()) + 1):
        products = likelihood.products(np.where(groups == group, 0.0, vectors))
        step = -np.linalg.lstsq(products[:-1, :-1], products[:-1, -1], rcond=None)[0]
        found.append((likelihood.moved(best.point, best.order, step), root_of(products[:-1, :-1])))
    return found


def groups_of(decision: Decision, blocks: int) -> np.ndarray:
    """(rows,) the run of each whitened number; of a single run the block in time, of `blocks` equal ones."""
    groups, start = [], decision.end
    for i, run in enumerate(start.residuals):
        for name, noise in start.likelihood.whitening.noise.items():
            rows, columns = noise.rows(run[name]), run[name].shape[1]
            by_time = np.repeat(np.arange(rows) * blocks // max(rows, 1), columns)
            groups.append(by_time if len(start.residuals) == 1 else np.full(rows * columns, i))
    return np.concatenate(groups)


def blocks_in(prediction: Prediction) -> int:
    """Into how many blocks a single run is cut, each about as long as the longest horizon at least."""
    return max(min(MOST_BLOCKS, round(prediction.tracks[0].ticks * TICK_S / max(HORIZONS_S))), 1)


def cut(prediction: Prediction, blocks: int) -> Prediction:
    """The model against equal blocks of the only run."""
    parts = equal_parts(prediction.tracks[0], blocks, prediction.replay.settling_ticks)
    return predict(prediction.replay, parts, tune=False)


def in_parts(prediction: Prediction) -> Prediction:
    """The model against runs of which each may be left out: all of them, or blocks of the only one."""
    return prediction if len(prediction.tracks) > 1 else cut(prediction, blocks_in(prediction))
