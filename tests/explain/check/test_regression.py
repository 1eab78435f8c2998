"""How well motions follow each other, compared over readings at once."""

import numpy as np

from drake_ispace.explain.check.compare.links import PLACES_AND_TURNS
from drake_ispace.explain.check.compare.regression import scores


def test_a_command_that_turns_in_two_windows_is_likeliest_in_its_own_unit():
    """The wheels wander by less than a hundredth of the turn, and by far more than their counts."""
    rng, told = np.random.default_rng(5), np.zeros((32, 3))
    told[:, :2] = rng.uniform(-0.1, 0.1, (32, 2))
    told[[7, 8], 2] = 0.06, 0.1
    wheels = told + np.array([5e-4, 1e-4, 2e-4]) * rng.standard_normal((32, 3))
    read = np.stack([told * [1.0, 1.0, factor] for factor in (1.0, -1.0, 2.0 * np.pi, 180.0 / np.pi)])
    found = scores(np.stack([wheels] * 4), read, PLACES_AND_TURNS, np.full((4, 3), 3e-5))
    assert found[0] - found[1:].max() > 20.0
