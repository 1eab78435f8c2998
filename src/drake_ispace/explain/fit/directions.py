"""Vectors as long as all residuals, a row each; of a vector that is zero but in one run, only that run is stored."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_LEAST_EIGENVALUE = 1e-9  # as a share of the largest; below it directions coincide


@dataclass(frozen=True)
class Directions:
    """(k + q) vectors of n numbers.

    Attributes:
        everywhere: (k, n) vectors over all runs.
        own: (start, (q_i, n_i)) vectors of each run, zero but in [start, start + n_i); q is the sum of all q_i.
    """

    everywhere: np.ndarray
    own: Sequence[tuple[int, np.ndarray]] = ()

    def __len__(self) -> int:
        return len(self.everywhere) + sum(len(part) for _, part in self.own)

    def dot(self, vectors: np.ndarray) -> np.ndarray:
        """(k + q,) or (m, k + q) scalar products with (n,) or (m, n) vectors."""
        parts = [vectors @ self.everywhere.T]
        parts += [vectors[..., start : start + part.shape[1]] @ part.T for start, part in self.own]
        return np.concatenate(parts, axis=-1)

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) or (m, n) sums of the vectors, each times its amount; amounts (k + q,) or (m, k + q)."""
        at = len(self.everywhere)
        total = amounts[..., :at] @ self.everywhere
        for start, part in self.own:
            total[..., start : start + part.shape[1]] += amounts[..., at : at + len(part)] @ part
            at += len(part)
        return total

    def part(self, start: int, end: int) -> "Directions":
        """The vectors between two numbers, as long as that; vectors of other runs are zero there."""
        none = lambda part: np.zeros((len(part), 0))  # noqa: E731
        own = [(a - start, part) if start <= a < end else (0, none(part)) for a, part in self.own]
        return Directions(self.everywhere[:, start:end], own)

    def gram(self) -> np.ndarray:
        """(k + q, k + q) scalar products of the vectors with each other."""
        at, products = len(self.everywhere), np.zeros((len(self), len(self)))
        products[:at, :at] = self.everywhere @ self.everywhere.T
        k = at
        for start, part in self.own:
            rows = slice(at, at + len(part))
            products[rows, :k] = part @ self.everywhere[:, start : start + part.shape[1]].T
            products[:k, rows] = products[rows, :k].T
            products[rows, rows] = part @ part.T
            at += len(part)
        return products


def amounts_of(gram: np.ndarray, products: np.ndarray) -> np.ndarray:
    """(k,) amounts of k vectors whose sum comes nearest to y; vectors that nearly coincide share theirs.

    gram: (k, k) scalar products of the vectors with each other. products: (k,) with y.
    """
    values, vectors, lengths = _distinct(gram)
    return vectors @ ((vectors.T @ (products / lengths)) / values) / lengths


def spent_on(gram: np.ndarray, columns: np.ndarray) -> float:
    """How many of m numbers a fit of k vectors takes for itself: as many as it leaves fewer degrees of freedom there.

    gram: (k, k) as for `amounts_of`. columns: (k, m) the vectors' entries at these numbers.
    """
    values, vectors, lengths = _distinct(gram)
    return float(np.sum((vectors.T @ (columns / lengths[:, None])) ** 2 / values[:, None]))


def _distinct(gram):
    """Eigenvalues (r,), eigenvectors (k, r) of the vectors at unit length, without nearly vanishing ones; lengths (k,).
    """
    lengths = np.maximum(np.sqrt(np.diag(gram)), 1e-9)
    values, vectors = np.linalg.eigh(gram / np.outer(lengths, lengths))
    kept = values > _LEAST_EIGENVALUE * values[-1]
    return values[kept], vectors[:, kept], lengths
