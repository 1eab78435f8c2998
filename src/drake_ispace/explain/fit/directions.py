"""Vectors as long as all residuals, a row each; those that are zero but in one run are kept in that run only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_LEAST = 1e-9  # of the largest eigenvalue, below which directions coincide


@dataclass(frozen=True)
class Directions:
    """(k + q) vectors of n numbers.

    Attributes:
        everywhere: (k, n). own: (start, (q_i, n_i)) of every run, zero but in [start, start + n_i).
    """

    everywhere: np.ndarray
    own: Sequence[tuple[int, np.ndarray]] = ()

    def __len__(self) -> int:
        return len(self.everywhere) + sum(len(part) for _, part in self.own)

    def dot(self, vectors: np.ndarray) -> np.ndarray:
        """(k + q,) or (m, k + q) products with (n,) or (m, n) vectors."""
        parts = [vectors @ self.everywhere.T]
        parts += [vectors[..., start : start + part.shape[1]] @ part.T for start, part in self.own]
        return np.concatenate(parts, axis=-1)

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(n,) or (m, n) sums of so much of each, (k + q,) or (m, k + q)."""
        at = len(self.everywhere)
        total = amounts[..., :at] @ self.everywhere
        for start, part in self.own:
            total[..., start : start + part.shape[1]] += amounts[..., at : at + len(part)] @ part
            at += len(part)
        return total

    def gram(self) -> np.ndarray:
        """(k + q, k + q) products with each other."""
        at, found = len(self.everywhere), np.zeros((len(self), len(self)))
        found[:at, :at] = self.everywhere @ self.everywhere.T
        k = at
        for start, part in self.own:
            rows = slice(at, at + len(part))
            found[rows, :k] = part @ self.everywhere[:, start : start + part.shape[1]].T
            found[:k, rows] = found[rows, :k].T
            found[rows, rows] = part @ part.T
            at += len(part)
        return found

    def least_squares(self, y: np.ndarray) -> np.ndarray:
        """(k + q,) how much of each together comes nearest to `y` (n,); what nearly coincides shares."""
        gram = self.gram()
        lengths = np.maximum(np.sqrt(np.diag(gram)), 1e-9)
        values, vectors = np.linalg.eigh(gram / np.outer(lengths, lengths))
        kept = vectors[:, values > _LEAST * values[-1]]
        values = values[values > _LEAST * values[-1]]
        return kept @ ((kept.T @ (self.dot(y) / lengths)) / values) / lengths
