"""Changes of the residuals, whitened: long vectors that exist for one run at a time.

There are hundreds of them, each as long as all runs together. Only their scalar products are kept.
"""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.fit.directions import amounts_of, spent_on
from drake_ispace.explain.fit.memory import Memory, alike
from drake_ispace.explain.fit.offsets import Offsets
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Residuals
from drake_ispace.explain.threads import each

_BATCH = 32  # changes to a job


class Changes:
    """Changes of the residuals of all runs under one noise.

    k is their number, n the length of the whitened residuals.

    Args:
        whitening: the noise. residuals: of all runs; only their sizes are used. changes: k of them.

    Attributes:
        starts: (runs + 1,) where each run begins in a long vector, and its length.
    """

    def __init__(
        self, whitening: Whitening, residuals: Residuals, changes: Sequence[Residuals],
    ):
        self.starts = whitening.starts(residuals)
        self._whitening, self._residuals, self._changes = whitening, residuals, list(changes)

    def __len__(self) -> int:
        return len(self._changes)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Where each run begins and ends in a long vector."""
        return list(zip(self.starts[:-1].tolist(), self.starts[1:].tolist(), strict=True))

    @property
    def batches(self) -> list[slice]:
        """Numbers of the changes that are whitened in one job, for every job."""
        return [slice(first, min(first + _BATCH, len(self))) for first in range(0, len(self), _BATCH)]

    def of_run(self, i: int, some: slice = slice(None), out: np.ndarray | None = None) -> np.ndarray:
        """(k, n_i) the changes of run `i`, or some of them, whitened, in `out` or in a new array."""
        chosen = [change[i] for change in self._changes[some]]
        return self._whitening.several(i, chosen, out) if chosen else np.empty((0, self.starts[i + 1] - self.starts[i]))

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
        return self._whitening(added_up(self._residuals, amounts, self._changes))


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


def added_up(
    residuals: Residuals, amounts: np.ndarray, changes: Sequence[Residuals],
    offsets: Sequence[tuple[int, dict[str, np.ndarray]]] = (),
) -> Residuals:
    """The sum of changes and offsets, each times its amount; residuals: of all runs, only their sizes are used.

    amounts, offsets: as of `without`.
    """
    nothing = [{name: np.zeros(rows.shape) for name, rows in run.items()} for run in residuals]
    return without(nothing, -amounts, changes, offsets)


class Marginal:
    """Products of changes with each other, and of what offsets and the memory of a noise cannot explain of them.

    X (k, n) are the whitened changes, N (q, n) the offsets, M removes the memory. What is left of X is
    (X - U N) M, U = X M N' (N M N' + P)^-1, P as in `Likelihood`.

    Args:
        changes: X. offsets: N. memories: of the noise. of_offsets: of each memory, the amounts of its basis in the
            offsets. inner: (q, q) the inverse; None: nothing is removed.

    Attributes:
        gram: (k + q, k + q) products of changes and offsets with each other. inner: (k, k) X times what is left of X.
    """

    def __init__(
        self, changes: Changes, offsets: Offsets, memories: Sequence[Memory] = (),
        of_offsets: Sequence[np.ndarray] = (), inner: np.ndarray | None = None,
    ):
        k, q, self._changes, self._offsets, self._memories = len(changes), len(offsets), changes, offsets, memories
        by_run = [_products(changes, i, offsets, memories) for i in range(len(changes.spans))]
        plain, with_offsets, of_offsets_alone, *remembered = (sum(parts) for parts in zip(*by_run, strict=True))
        self.gram = np.block([[plain, with_offsets], [with_offsets.T, of_offsets_alone]])
        for own, other in zip(remembered, of_offsets, strict=True):
            plain -= alike(own, own)
            with_offsets -= alike(own, other)
        self._used = np.zeros((k, q)) if inner is None else with_offsets @ inner
        self.inner = plain - self._used @ with_offsets.T
        self._remembered = [
            own - np.tensordot(self._used, other, axes=1) for own, other in zip(remembered, of_offsets, strict=True)
        ]

    def least_squares(self, w: np.ndarray) -> np.ndarray:
        """(k + q,) amounts of changes and offsets whose sum comes nearest to `w` (n,)."""
        return amounts_of(self.gram, np.concatenate([self._changes.dot(w), self._offsets.dot(w)]))

    def spent_on(self, which: np.ndarray) -> float:
        """How many of the numbers `which` (n,) are explained by `least_squares` whatever they are."""
        columns = []
        for i, (start, end) in enumerate(self._changes.spans):
            offsets, here = self._offsets.part(start, end), which[start:end]
            columns.append(np.vstack([self._changes.of_run(i), offsets.combined(np.eye(len(offsets)))])[:, here])
        return spent_on(self.gram, np.hstack(columns))

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) sum of changes and offsets, whitened, each times its amount (k + q,)."""
        k = len(self._changes)
        return self._changes.combined(amounts[:k]) + self._offsets.combined(amounts[k:])

    def by_instant(self, w: np.ndarray, instants: np.ndarray) -> np.ndarray:
        """(k, instants) products with `w` (n,), summed over the numbers of one instant.

        instants: (n,) which instant of which run each number belongs to, ascending; no two runs share one.
        """
        return np.hstack([self._sums(i, w, instants) for i in range(len(self._changes.spans))])

    def _sums(self, i, w, instants):
        """(k, instants of run `i`) products of what is left of the changes with `w` (n,), summed over each instant."""
        start, end = self._changes.spans[i]
        offsets, firsts = self._offsets.part(start, end), np.flatnonzero(np.diff(instants[start:end], prepend=-1))

        def sums(some):
            part = self._changes.of_run(i, some)
            part -= offsets.combined(self._used[some])
            for amounts, memory in zip(self._remembered, self._memories, strict=True):
                memory.subtract(amounts[some], part, start)
            part *= w[start:end]
            return np.add.reduceat(part, firsts, axis=1)

        return np.vstack([np.empty((0, len(firsts))), *each(sums, self._changes.batches)])


def _products(changes, i, offsets, memories) -> list[np.ndarray]:
    """Products in run `i`: of the whitened changes (k, k), of them with the offsets (k, q), and of the offsets (q, q).

    After these come, for every memory, the amounts (k, p, q) of its basis in the changes.
    """
    k, (start, end) = len(changes), changes.spans[i]
    part, own_offsets = np.empty((k, end - start)), offsets.part(start, end)
    plain, with_offsets = np.zeros((k, k)), np.empty((k, len(offsets)))
    remembered = [np.empty((k, *memory.shape)) for memory in memories]

    def whiten(some):
        changes.of_run(i, some, part[some])

    def multiply(some):
        plain[some, some.start :] = part[some] @ part[some.start :].T
        with_offsets[some] = own_offsets.dot(part[some])
        for amounts, memory in zip(remembered, memories, strict=True):
            amounts[some] = memory.amounts(part[some], start)

    each(whiten, changes.batches)
    each(multiply, changes.batches)
    return [np.triu(plain) + np.triu(plain, 1).T, with_offsets, own_offsets.gram(), *remembered]
