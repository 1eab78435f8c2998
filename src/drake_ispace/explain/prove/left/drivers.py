"""Measured variables that an error may go with: functions of the recorded motion, at every tick."""

import numpy as np

from drake_ispace.blocks.frames import rotated
from drake_ispace.explain.decide.survey.generic import WARM_S, Motion
from drake_ispace.explain.predict.prediction import wheel_speeds

CONSTANT = "nothing (constant)"
TIME, LOAD, COMMANDED = "time", "load", "command"
#: Those in which nothing is measured that noise moves.
NO_NOISE = (CONSTANT, TIME, LOAD, COMMANDED)


def drivers_of(m: Motion, in_room: bool) -> dict[str, np.ndarray]:
    """Variable -> (rows, k) functions of it at every tick; vectors along the axes of the room, or else of the body."""
    velocity = m.body
    if in_room:
        velocity = np.column_stack([rotated(m.body[:, :2], m.place[:, 2]), m.body[:, 2]])
    wheels = wheel_speeds(m.angles)
    kernel = np.ones(41) / 41.0
    smooth = [np.convolve(column, kernel, mode="same") for column in np.gradient(velocity, axis=0).T]
    return {
        CONSTANT: np.ones((len(m.t), 1)),
        "speed": velocity,
        "speed squared": velocity * np.abs(velocity),
        "direction": np.tanh(wheels / (0.05 * np.maximum(np.abs(wheels).max(axis=0), 1e-9))),
        "acceleration": np.column_stack(smooth),
        "heading": np.column_stack([np.cos(m.place[:, 2]), np.sin(m.place[:, 2])]),
        "place": m.place[:, :2] - m.place[:, :2].mean(axis=0),
        TIME: np.column_stack([m.t - m.t.mean(), np.exp(-m.t / WARM_S)]),
        LOAD: np.abs(m.command),
        COMMANDED: m.command,
    }


def of_wheel_angle(m: Motion) -> np.ndarray:
    """(rows, 2 n) cosine and sine of every wheel's angle."""
    return np.hstack([np.cos(m.angles), np.sin(m.angles)])
