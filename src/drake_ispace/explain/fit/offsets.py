"""Nuisances: changes of the residuals that are kept as they are, in single precision, and whitened run by run."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_ispace.explain.fit.directions import Part, add, dot
from drake_ispace.explain.fit.memory import Memory
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Residuals
from drake_ispace.explain.threads import each

Stack = dict[str, np.ndarray]  # stream -> (k, rows, channels) of k changes of a run


def stacks_of(changes: Sequence[Residuals], residuals: Residuals) -> list[Stack]:
    """The Stack of every run of changes of all runs; residuals: only their streams and sizes are used."""
    return [_stack([change[i] for change in changes], run) for i, run in enumerate(residuals)]


def stacks_of_runs(offsets: Sequence[tuple[int, dict[str, np.ndarray]]], residuals: Residuals) -> list[Stack]:
    """The Stack of every run of changes of one run each; offsets: (run, change), in the order of the runs."""
    return [_stack([change for at, change in offsets if at == i], run) for i, run in enumerate(residuals)]


def members(stack: Stack) -> list[dict[str, np.ndarray]]:
    """The changes of a Stack, which share its memory."""
    count = len(next(iter(stack.values())))
    return [{name: rows[j] for name, rows in stack.items()} for j in range(count)]


def _stack(changes, run) -> Stack:
    """The Stack of changes of a run."""
    return {name: np.array([c[name] for c in changes]).reshape(len(changes), *rows.shape) for name, rows in run.items()}


def offsets_of(
    whitening: Whitening, residuals: Residuals, everywhere: Sequence[Sequence[Stack]], own: Sequence[Stack]
) -> "Offsets":
    """The Offsets under a noise, none of them freed."""
    return Offsets(whitening, residuals, everywhere, own, np.empty((0, whitening.starts(residuals)[-1])))


@dataclass(frozen=True)
class Offsets:
    """(k + q + f) whitened vectors of n numbers, of which none but `freed` is kept whitened.

    Attributes:
        whitening: the noise. residuals: of all runs; only their sizes are used. everywhere: groups of changes of all
            runs, k of them all; per run, a Stack of each group. own: per run, changes of this run only; q of them all.
            freed: (f, n) further vectors, whitened.
    """

    whitening: Whitening
    residuals: Residuals
    everywhere: Sequence[Sequence[Stack]]
    own: Sequence[Stack]
    freed: np.ndarray
    _ends: list[int] = field(init=False, repr=False)
    _starts: list[int] = field(init=False, repr=False)

    def __post_init__(self):
        ends = np.cumsum([*(_count(group[0]) for group in self.everywhere), *map(_count, self.own), len(self.freed)])
        object.__setattr__(self, "_ends", ends.tolist())
        object.__setattr__(self, "_starts", self.whitening.starts(self.residuals).tolist())

    def __len__(self) -> int:
        return self._ends[-1]

    @property
    def kept(self) -> np.ndarray:
        """Numbers of the vectors in `freed`."""
        return np.arange(self._ends[-2], self._ends[-1])

    def with_freed(self, vectors: np.ndarray) -> "Offsets":
        """The Offsets with further whitened vectors (f, n)."""
        return replace(self, freed=np.vstack([self.freed, vectors]))

    def dot(self, vectors: np.ndarray) -> np.ndarray:
        """(len,) or (m, len) scalar products with (n,) or (m, n) vectors."""
        several = np.atleast_2d(vectors)
        turned = [self.whitening.transposed(w, self.residuals) for w in several]
        products = np.zeros((len(several), len(self)))
        products[:, self.kept] = several @ self.freed.T
        for i in range(len(self.residuals)):
            for places, stack in self._groups(i):
                for name in self.whitening.noise:
                    w = np.array([one[i][name].ravel() for one in turned])
                    products[:, places] += dot(w, _flat(stack[name]))
        return products.reshape(*vectors.shape[:-1], len(self))

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) or (m, n) sums of the vectors, each times its amount; amounts (len,) or (m, len)."""
        several = np.atleast_2d(amounts)
        total = several[:, self.kept] @ self.freed
        for i, (start, end) in enumerate(self._spans):
            sums = {name: np.zeros((len(several), rows.size)) for name, rows in self.residuals[i].items()}
            for places, stack in self._groups(i):
                for name, rows in stack.items():
                    add(several[:, places], _flat(rows), sums[name])
            of_run = {name: s.reshape(len(s), *self.residuals[i][name].shape) for name, s in sums.items()}
            total[:, start:end] += self.whitening.several(i, members(of_run))
        return total.reshape(*amounts.shape[:-1], -1)

    def part(self, start: int, end: int) -> Part:
        """The vectors of the run that is between these two numbers; one without any begins where the next one does."""
        i = self._spans.index((start, end))
        groups = self._groups(i)
        ends = np.cumsum([0, *(at.stop - at.start for at, _ in groups), len(self.freed)])
        rows = np.empty((ends[-1], end - start))
        for (_, stack), first, last in zip(groups, ends[:-2], ends[1:-1], strict=True):
            if first < last:
                self.whitening.several(i, members(stack), rows[first:last])
        rows[ends[-2] :] = self.freed[:, start:end]
        places = np.concatenate([np.arange(at.start, at.stop) for at, _ in groups])
        return Part(rows, np.concatenate([places, self.kept]), len(self))

    def gram_and_amounts(self, memories: Sequence[Memory]) -> tuple[np.ndarray, list[np.ndarray]]:
        """(len, len) products of the vectors, and the amounts (len, p, q) of the basis of every memory in them."""
        def of_run(start, end):
            part = self.part(start, end)
            return part.gram(), [part.spread(memory.amounts(part.rows, start)) for memory in memories]

        grams, amounts = zip(*each(of_run, *zip(*self._spans, strict=True)), strict=True)
        return sum(grams), [sum(of) for of in zip(*amounts, strict=True)]

    @property
    def _spans(self):
        return list(zip(self._starts[:-1], self._starts[1:], strict=True))

    def _groups(self, i):
        """Which of the vectors, and their changes in run `i`: those of all runs, group by group, and its own."""
        ends, groups = [0, *self._ends], len(self.everywhere)
        numbers, stacks = [*range(groups), groups + i], [*(group[i] for group in self.everywhere), self.own[i]]
        return [(slice(ends[number], ends[number + 1]), stack) for number, stack in zip(numbers, stacks, strict=True)]


def _flat(rows):
    """(k, numbers) the changes of a stream, each as one vector."""
    return rows.reshape(len(rows), rows.shape[1] * rows.shape[2])


def _count(stack):
    return len(next(iter(stack.values())))
