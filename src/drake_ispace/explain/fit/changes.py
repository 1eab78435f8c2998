"""Changes of the residuals, whitened: long vectors that exist for one run at a time.

There are hundreds of them, each as long as all runs together. Only their scalar products are kept.
"""

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drake_ispace.explain.fit.directions import Directions, amounts_of
from drake_ispace.explain.fit.memory import Memory
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Residuals

_BATCH = 32  # changes to a job


class Changes:
    """Changes of the residuals of all runs under one noise.

    k is their number, n the length of the whitened residuals.

    Args:
        whitening: the noise. residuals: of all runs; only their sizes are used. changes: k of them. pool: threads that
            may be used.

    Attributes:
        starts: (runs + 1,) where each run begins in a long vector, and its length.
    """

    def __init__(
        self, whitening: Whitening, residuals: Residuals, changes: Sequence[Residuals],
        pool: ThreadPoolExecutor | None = None,
    ):
        self.starts = whitening.starts(residuals)
        self._whitening, self._residuals, self._changes, self._pool = whitening, residuals, list(changes), pool

    def __len__(self) -> int:
        return len(self._changes)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Where each run begins and ends in a long vector."""
        return list(zip(self.starts[:-1].tolist(), self.starts[1:].tolist(), strict=True))

    def of_run(self, i: int) -> np.ndarray:
        """(k, n_i) the changes of run `i`, whitened."""
        whitened = np.empty((len(self), self.starts[i + 1] - self.starts[i]))

        def write(first):
            some = slice(first, first + _BATCH)
            whitened[some] = self._whitening.several(i, [change[i] for change in self._changes[some]])

        list((self._pool.map if self._pool else map)(write, range(0, len(self), _BATCH)))
        return whitened

    def dot(self, w: np.ndarray) -> np.ndarray:
        """(k,) scalar products of the whitened changes with `w` (n,)."""
        turned = self._whitening.transposed(w, self._residuals)
        return np.array([
            sum(float(np.vdot(rows, part[name])) for run, part in zip(turned, change, strict=True)
                for name, rows in run.items())
            for change in self._changes
        ])

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) sum of the whitened changes, each times its amount (k,)."""
        nothing = [{name: np.zeros(rows.shape) for name, rows in run.items()} for run in self._residuals]
        return self._whitening(without(nothing, -amounts, self._changes))


def directions(
    whitening: Whitening, residuals: Residuals, changes: Sequence[Residuals],
    offsets: Sequence[tuple[int, dict[str, np.ndarray]]] = (), pool: ThreadPoolExecutor | None = None,
) -> Directions:
    """Whitened changes of all residuals, kept, and whitened offsets.

    offsets: (run, change of its residuals) of each, in the order of the runs. Others: as of Changes.
    """
    whole = Changes(whitening, residuals, changes, pool)
    everywhere = np.hstack([whole.of_run(i) for i in range(len(residuals))])
    grouped = [(i, [change for _, change in group]) for i, group in itertools.groupby(offsets, lambda o: o[0])]
    parts = (pool.map if pool else map)(lambda group: whitening.several(*group), grouped)
    return Directions(everywhere, [(int(whole.starts[i]), part) for (i, _), part in zip(grouped, parts, strict=True)])


def without(
    residuals: Residuals, amounts: np.ndarray, changes: Sequence[Residuals],
    offsets: Sequence[tuple[int, dict[str, np.ndarray]]] = (),
) -> Residuals:
    """Residuals less so much of every change, and of every offset.

    Args:
        amounts: (changes + offsets,), those of the changes first. offsets: (run, change of that run by stream).
    """
    remaining = [{name: rows.copy() for name, rows in run.items()} for run in residuals]
    for amount, change in zip(amounts, changes, strict=False):
        for run, part in zip(remaining, change, strict=True):
            for name in run:
                run[name] -= amount * part[name]
    for amount, (i, change) in zip(amounts[len(changes) :], offsets, strict=True):
        for name in remaining[i]:
            remaining[i][name] -= amount * change[name]
    return remaining


class Marginal:
    """Products of changes with each other, and of what offsets and the memory of a noise cannot explain of them.

    X (k, n) are the whitened changes, N (q, n) the offsets, M removes the memory. What is left of X is
    (X - U N) M, U = X M N' (N M N' + 1)^-1.

    Args:
        changes: X. offsets: N. memories: of the noise. inner: (q, q) the inverse; None: nothing is removed.

    Attributes:
        gram: (k + q, k + q) products of changes and offsets with each other. inner: (k, k) X times what is left of X.
    """

    def __init__(
        self, changes: Changes, offsets: Directions, memories: Sequence[Memory] = (), inner: np.ndarray | None = None
    ):
        k, q, self._changes, self._offsets, self._memories = len(changes), len(offsets), changes, offsets, memories
        plain, with_offsets = np.zeros((k, k)), np.zeros((k, q))
        remembered = [np.zeros((k, *memory.shape)) for memory in memories]
        for i, (start, end) in enumerate(changes.spans):
            part = changes.of_run(i)
            plain += part @ part.T
            with_offsets += offsets.part(start, end).dot(part)
            for amounts, memory in zip(remembered, memories, strict=True):
                amounts += memory.amounts(part, start)
        self.gram = np.block([[plain, with_offsets], [with_offsets.T, offsets.gram()]])
        of_offsets = [memory.amounts_in(offsets) for memory in memories]
        for own, other in zip(remembered, of_offsets, strict=True):
            plain -= np.tensordot(own, own, axes=((1, 2), (1, 2)))
            with_offsets -= np.tensordot(own, other, axes=((1, 2), (1, 2)))
        self._used = np.zeros((k, q)) if inner is None else with_offsets @ inner
        self.inner = plain - self._used @ with_offsets.T
        self._remembered = [
            own - np.tensordot(self._used, other, axes=1) for own, other in zip(remembered, of_offsets, strict=True)
        ]

    def least_squares(self, w: np.ndarray) -> np.ndarray:
        """(k + q,) amounts of changes and offsets whose sum comes nearest to `w` (n,)."""
        return amounts_of(self.gram, np.concatenate([self._changes.dot(w), self._offsets.dot(w)]))

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) sum of changes and offsets, whitened, each times its amount (k + q,)."""
        k = len(self._changes)
        return self._changes.combined(amounts[:k]) + self._offsets.combined(amounts[k:])

    def by_instant(self, w: np.ndarray, instants: np.ndarray) -> np.ndarray:
        """(k, instants) products with `w` (n,), summed over the numbers of one instant.

        instants: (n,) which instant of which run each number belongs to, ascending; no two runs share one.
        """
        sums = []
        for i, (start, end) in enumerate(self._changes.spans):
            part = self._changes.of_run(i)
            part -= self._offsets.part(start, end).combined(self._used)
            for amounts, memory in zip(self._remembered, self._memories, strict=True):
                memory.subtract(amounts, part, start)
            part *= w[start:end]
            starts = np.flatnonzero(np.diff(instants[start:end], prepend=-1))
            sums.append(np.add.reduceat(part, starts, axis=1))
        return np.hstack(sums)
