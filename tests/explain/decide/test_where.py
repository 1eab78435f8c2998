"""A fit of an effect in a part of the room begins where it explains most."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.decide.proposals.where import start_in_room
from stand_ins.tried import candidate

WIDTH_M, DEPTH_M = 4.0, 2.0
X, Y = (points.ravel() for points in np.meshgrid(np.linspace(-1.9, 1.9, 40), np.linspace(-0.95, 0.95, 40)))


def felt(patch):
    """The force at each place that the robot was at."""
    inside = (patch["x_min_m"] < X) & (patch["x_max_m"] > X) & (patch["y_min_m"] < Y) & (patch["y_max_m"] > Y)
    return patch["force_n"] * inside


def started(measured, patch):
    """Where the fit of a patch begins in a room where residuals are the measured force less that of the model."""
    class Prediction:
        replay = SimpleNamespace(body=SimpleNamespace(room_m=(WIDTH_M, DEPTH_M)))

        def residuals(self, values):
            return [{"motion": measured - sum(felt(patch) for patch in values.values())}]

    likelihood = SimpleNamespace(
        whitening=lambda residuals: residuals[0]["motion"], products=lambda rows: rows @ rows.T
    )
    view = SimpleNamespace(prediction=Prediction(), sizes={patch: [0.2] + [0.1] * 5})
    residuals = [{"motion": measured}]
    return start_in_room(
        SimpleNamespace(view=view, likelihood=likelihood, point={}, residuals=residuals, w=measured), patch
    )


def test_it_is_the_rectangle_that_explains_most_with_its_best_force():
    patch, truth = candidate("soft_patch"), {"x_min_m": -1.0, "x_max_m": 0.5, "y_min_m": -0.25, "y_max_m": 0.75}
    found = started(felt({"force_n": 3.0} | truth), patch)
    assert found == pytest.approx([3.0, *truth.values(), patch.neutral[-1]], rel=1e-6)


def test_where_a_force_would_have_to_push_it_begins_with_none():
    patch, everywhere = candidate("soft_patch"), {"x_min_m": -9.0, "x_max_m": 9.0, "y_min_m": -9.0, "y_max_m": 9.0}
    assert started(-felt({"force_n": 3.0} | everywhere), patch) == patch.neutral
