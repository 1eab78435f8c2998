"""Nuisances as vectors that are all kept whitened: what those that are whitened run by run must equal."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Dense:
    """Of (k, n) vectors what a Likelihood asks of its offsets; whitening: not used."""

    vectors: np.ndarray
    whitening: object = None

    def __len__(self) -> int:
        return len(self.vectors)

    def dot(self, vectors):
        return vectors @ self.vectors.T

    def combined(self, amounts):
        return amounts @ self.vectors

    def gram_and_amounts(self, memories):
        return self.vectors @ self.vectors.T, [memory.amounts(self.vectors) for memory in memories]
