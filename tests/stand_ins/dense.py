"""Nuisances as vectors that are all kept whitened: what those that are whitened run by run must equal."""

import numpy as np


class Dense:
    """Of (k, n) vectors what a Likelihood asks of its offsets."""

    def __init__(self, vectors: np.ndarray):
        self.vectors = vectors

    def __len__(self) -> int:
        return len(self.vectors)

    def dot(self, vectors):
        return vectors @ self.vectors.T

    def combined(self, amounts):
        return amounts @ self.vectors

    def gram_and_amounts(self, memories):
        return self.vectors @ self.vectors.T, [memory.amounts(self.vectors) for memory in memories]
