"""The memory of a noise model, and what other coefficients of it could explain of vectors as long as all residuals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Memory:
    """The past of one stream, as an orthonormal basis from which each of its channels is predicted.

    Attributes:
        channels: their number p.
        places: per run, where the stream's numbers begin and end in the long vector; the p of an instant are together.
        bases: per run, (instants, q) rows of the basis.
    """

    channels: int
    places: Sequence[tuple[int, int]]
    bases: Sequence[np.ndarray]

    @property
    def shape(self) -> tuple[int, int]:
        """(p, q), of the amounts of one vector."""
        return self.channels, self.bases[0].shape[1]

    def amounts(self, vectors: np.ndarray, start: int = 0) -> np.ndarray:
        """(m, p, q) amounts of the basis in each channel of vectors (m, n) that begin at `start`, zero elsewhere."""
        total = np.zeros((len(vectors), *self.shape))
        for (a, b), basis in zip(self.places, self.bases, strict=True):
            if start <= a and b <= start + vectors.shape[1]:
                part = vectors[:, a - start : b - start].reshape(len(vectors), len(basis), self.channels)
                total += np.tensordot(part, basis, axes=(1, 0))
        return total

    def subtract(self, amounts: np.ndarray, vectors: np.ndarray, start: int = 0) -> None:
        """Subtract amounts (m, p, q) of the basis, in place, from vectors (m, n) that begin at `start`."""
        for (a, b), basis in zip(self.places, self.bases, strict=True):
            if start <= a and b <= start + vectors.shape[1]:
                part = np.tensordot(amounts, basis, axes=(2, 1)).transpose(0, 2, 1)
                vectors[:, a - start : b - start] -= part.reshape(len(vectors), -1)


def alike(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k, m) scalar products of the parts of vectors that a memory explains, by its amounts (k, p, q), (m, p, q)."""
    return np.tensordot(one, other, axes=((1, 2), (1, 2)))
