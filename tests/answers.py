"""Explanations as `explain` could have returned them, without the minute that it takes."""

import copy

from drake_ispace.explain.answer.explanation import (
    Estimate,
    Explanation,
    NamedEffect,
    Place,
    Unknown,
    Untestable,
)
from drake_ispace.explain.decide.proposals.detect import Detection
from drake_ispace.explain.prove.errors.gap import GapRow
from drake_ispace.explain.prove.left.remainder import Remainder
from drake_ispace.scenario import Scenario, difference

FOUND = Detection(1e-9, 9.0, 3.0)
GAP = [
    GapRow("held_out", "RPE", "5s", "position", "m", "torque", 0.3, 0.04, 0.015, 0.03, 0.039, 0.98, (0.95, 1.0)),
    GapRow("held_out", "ATE", "run", "position", "m", "wheels", 0.006, 0.006, 0.005, 0.002, 0.006, None, None),
    GapRow("held_out", "prediction", "0.2s", "encoder: wheel 1", "rad", "torque", 0.3, 0.05, 0.02, 0.03, 0.05, 0.97,
           (-1e12, 1.0)),
    GapRow("training", "RPE", "5s", "position", "m", "torque", 0.31, 0.04, 0.015, 0.03, 0.04, 0.97, None),
]
LEFT = Remainder(
    "encoder: wheel 2", "speed", 0.07, "rad", "0.2s", 1.8, "from the start of a run", ["c"], "41 % goes with speed",
)


def named(model: Scenario, **changes) -> Explanation:
    """The omni robot lacks Coulomb friction of 0.01 N m."""
    scenario = copy.deepcopy(model)
    scenario.omni.effects = {**scenario.omni.effects, "coulomb_friction": {"torque_n_m": 0.01}}
    effect = NamedEffect(
        "coulomb_friction", "transmission", [], {"torque_n_m": Estimate(0.01, (0.0097, 0.0103), "N*m")}, 1.0,
    )
    values = {
        "verdict": "named", "effects": [effect], "detection": FOUND, "untestable": [],
        "localization": [Place("encoder: wheel 1", 0.7, "direction"), Place("kinect: x", 0.3, "place")],
        "gap": GAP, "proof": "held-out runs", "model": scenario, "difference": difference(scenario), "runs": ["a", "b"],
        "held_out": ["c"], "seconds": 20.0,
    }
    return Explanation(**{**values, **changes})


def one_of_a_set(model: Scenario) -> Explanation:
    """Coulomb or Stribeck friction, its size at its bound, with a warning."""
    estimate = Estimate(0.01, (0.008, 0.01), "N*m", on_bound=True)
    effect = NamedEffect(
        "coulomb_friction", "transmission", ["stribeck_friction"], {"torque_n_m": estimate}, 1.0, "slow reversals",
    )
    return named(
        model, verdict="set", effects=[effect], warnings=["kinect: x got worse <b>"], next_experiment="reverse slowly",
    )


def incomplete(model: Scenario) -> Explanation:
    """Coulomb friction, and something that goes with the speed of a wheel."""
    return named(model, verdict="incomplete", remainders=[LEFT])


def nothing() -> Explanation:
    """The runs are as the model says."""
    return Explanation(
        "none", [], Detection(0.4, 0.4, 3.0), [], [Untestable("gyro_bias", "an IMU")], runs=["a"],
        next_experiment="drive faster",
    )


def unknown() -> Explanation:
    """A force with the place that nobody has heard of."""
    what = Unknown("force", "place", 0.8, "differs with place", "none", "from 3.1 s on", "soft_floor", 12.5)
    return Explanation("unknown", [], FOUND, [Place("kinect: y", 1.0, "place")], [], unknown=what, runs=["a"])
