"""Disagreements that no effect of the library stands for: a force or a loss of motion that goes with some variable.

They race against the library. Where one of them explains the runs better than every effect with a name, the verdict is
"unknown", and this is what is said about it: on which link it acts, with what it goes, whether it remembers.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Parameter
from drake_ispace.explain.decide.signatures import Signature
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.prediction import Prediction, Residuals, wheel_speeds
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.robots.robot import COMMAND

_CELLS = 3  # along each side of the place that the runs have visited
_RIPPLES = (1, 2, 3, 4, 6, 8, 9, 12, 16, 18, 24)  # periods per wheel turn
_WARM_S = 5.0


@dataclass(frozen=True, eq=False)
class Generic:
    """A disagreement that no effect stands for; a Candidate may have it in the place of an Effect.

    Attributes:
        name: by which others can be told from it. link: "force" or "motion". driver: with what it goes.
        columns: how many amplitudes it has.
    """

    name: str
    link: str
    driver: str
    columns: int

    @property
    def is_local(self) -> bool:
        """Whether it is so free that it explains slow noise as well, wherever the robot happens to be meanwhile."""
        return self.columns > 4

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """An amplitude for every column."""
        return tuple(Parameter(f"amplitude_{i + 1}", "", probes=(1.0,)) for i in range(self.columns))


@dataclass(frozen=True)
class Motion:
    """What a run did, at every tick of it and of the lead after it.

    Attributes:
        body: (rows, 3) velocity of B [m/s, m/s, rad/s]. place: (rows, 3) pose in W. t: (rows,) [s].
        angles: (rows, n) of the wheels. command: (rows, m).
    """

    body: np.ndarray
    place: np.ndarray
    t: np.ndarray
    angles: np.ndarray
    command: np.ndarray


def motion_of(prediction: Prediction, track: Track) -> Motion:
    """From encoders and fixes; zeros where there is neither."""
    body = prediction.replay.body
    angles = track.measured[:, : body.wheels]
    forward = body.plant.geometry.forward
    velocity = wheel_speeds(angles) @ forward.T
    t = np.arange(len(angles)) * TICK_S
    place = np.zeros((len(t), 3))
    if len(track.fix_t) > 1:
        fixes = track.poses
        fixes[:, 2] = np.unwrap(fixes[:, 2])
        place = np.column_stack([np.interp(t, track.fix_t, column) for column in fixes.T])
    return Motion(velocity, place, t, angles, track.command)


def generics(prediction: Prediction, point: Point, base: Residuals, pool: ThreadPoolExecutor) -> list[Signature]:
    """A signature for every amplitude of every generic disagreement that these runs could show."""
    motions = [motion_of(prediction, track) for track in prediction.tracks]
    values, found = merged(point), []
    jobs = []
    if prediction.channels["motion"]:
        jobs += [(generic, prediction.pushed, columns) for generic, columns in _forces(prediction, motions)]
        jobs += [(generic, prediction.injected, columns) for generic, columns in _torques(prediction, motions)]
    if any(len(track.fix_t) for track in prediction.tracks) and prediction.replay.body.robot.in_room:
        jobs += [(generic, prediction.displaced, columns) for generic, columns in _losses(motions)]

    def one(job):
        _, predicted, added = job
        return predicted(added, values)

    flat = [(generic, predicted, added) for generic, predicted, columns in jobs for added in columns]
    for (generic, _, _), raw in zip(flat, (pool.map if pool else map)(one, flat), strict=True):
        at = sum(s.candidate.effect is generic for s in found)
        candidate = next((s.candidate for s in found if s.candidate.effect is generic), None)
        candidate = candidate or Candidate(generic, (), generic.parameters)
        z = [float(i == at) for i in range(generic.columns)]
        change = [{s: before[s] - after[s] for s in before} for before, after in zip(base, raw, strict=True)]
        found.append(Signature(candidate, z, at, False, change))
    return found


def _forces(prediction, motions) -> Iterator[tuple[Generic, list[list[np.ndarray]]]]:
    """(generic, for each amplitude the force on each run), about a tenth of the usual command in size."""
    body = prediction.replay.body
    size = _usual(motions)
    largest = body.robot.force_of_command(body.plant)

    def push(m, x=0.0, y=0.0, yaw=0.0):
        force = size * largest * np.column_stack([np.broadcast_to(f, m.t.shape) for f in (x, y, yaw)])
        return body.robot.ground_force(force)

    def each(force):
        return [force(m) for m in motions]

    top = max(np.sqrt(np.mean(m.body[:, :2] ** 2)) for m in motions) or 1.0
    turn = max(np.sqrt(np.mean(m.body[:, 2] ** 2)) for m in motions) or 1.0
    unit = lambda m: _direction(m.body[:, :2])  # noqa: E731
    speed = lambda m: np.hypot(m.body[:, 0], m.body[:, 1]) / top  # noqa: E731
    yield Generic("drag_of_speed_squared", "force", "speed squared", 1), [
        each(lambda m: push(m, *(-unit(m) * speed(m)[:, None] ** 2).T))
    ]
    yield Generic("drag_of_spin_squared", "force", "yaw rate squared", 1), [
        each(lambda m: push(m, yaw=-np.abs(m.body[:, 2]) * m.body[:, 2] / turn**2))
    ]
    yield Generic("spring_in_the_room", "force", "place", 3), [
        each(lambda m, f=f: push(m, *_turned(m, f))) for f in (
            lambda m: np.array([1.0, 0.0]), lambda m: np.array([0.0, 1.0]), lambda m: -m.place[:, :2],
        )
    ]
    yield Generic("resistance_that_wears_off", "force", "time and direction", 2), [
        each(lambda m, f=f: push(m, *(-unit(m) * f(m)[:, None]).T)) for f in (
            lambda m: np.exp(-m.t / _WARM_S), lambda m: m.t / 20.0,
        )
    ]
    if any(len(track.fix_t) for track in prediction.tracks):  # else nobody knows the place
        cells = _cells(motions)
        yield Generic("resistance_of_a_patch", "force", "place and direction", len(cells[0])), [
            [push(m, *(-unit(m) * inside[:, None]).T) for m, inside in zip(motions, inner, strict=True)]
            for inner in zip(*cells, strict=True)
        ]


def _torques(prediction, motions) -> Iterator[tuple[Generic, list[list[np.ndarray]]]]:
    """(generic, for each amplitude the command to add to each run), about a tenth of the usual command in size."""
    body, size = prediction.replay.body, _usual(motions)
    yield Generic("command_that_wears_in", "force", "time and command", 1), [
        [0.1 * m.command * np.exp(-m.t / _WARM_S)[:, None] for m in motions]
    ]
    if body.robot.driven == COMMAND:
        return
    yield Generic("constant_torque", "force", "nothing", body.wheels), [
        [np.broadcast_to(size * np.eye(body.wheels)[i], m.command.shape) for m in motions] for i in range(body.wheels)
    ]
    for n in _RIPPLES:
        yield Generic(f"ripple_{n}_a_turn", "force", "wheel angle", 2), [
            [size * f(n * m.angles) for m in motions] for f in (np.sin, np.cos)
        ]


def _usual(motions):
    """A tenth of the usual command."""
    return 0.1 * np.sqrt(np.mean(np.vstack([m.command for m in motions]) ** 2)) or 0.01


def _losses(motions) -> Iterator[tuple[Generic, list[list[np.ndarray]]]]:
    """(generic, for each amplitude the displacement [m, m, rad] that the fixes of each run would show besides)."""
    cells = _cells(motions)
    along = lambda m, share: _travelled(m, m.body[:, 0] * share, m.body[:, 1] * share, 0.0 * share)  # noqa: E731
    yield Generic("slip_of_a_patch", "motion", "place", len(cells[0])), [
        [-0.05 * along(m, inside) for m, inside in zip(motions, inner, strict=True)]
        for inner in zip(*cells, strict=True)
    ]
    yield Generic("slip_of_speed", "motion", "speed", 1), [
        [-0.1 * along(m, np.hypot(m.body[:, 0], m.body[:, 1])) for m in motions]
    ]
    yield Generic("slip_of_time", "motion", "time", 1), [[-0.05 * along(m, m.t / 20.0) for m in motions]]
    yield Generic("drift", "motion", "distance", 2), [
        [_travelled(m, 0.0, 0.02 * np.hypot(m.body[:, 0], m.body[:, 1]), 0.0) for m in motions],
        [_travelled(m, 0.0, 0.0, 0.05 * np.hypot(m.body[:, 0], m.body[:, 1])) for m in motions],
    ]


def _cells(motions):
    """Per run, (rows,) arrays: 1 inside one cell of the visited place, else 0; cells that nobody visited left out."""
    places = np.vstack([m.place[:, :2] for m in motions])
    low, high = places.min(axis=0), places.max(axis=0) + 1e-9
    index = lambda m: np.minimum((_CELLS * (m.place[:, :2] - low) / (high - low)).astype(int), _CELLS - 1)  # noqa: E731
    number = [at[:, 0] * _CELLS + at[:, 1] for at in map(index, motions)]
    visited = [c for c in range(_CELLS**2) if sum((n == c).sum() for n in number) > 200]
    return [[(n == c).astype(float) for c in visited] for n in number]


def _direction(v):
    return v / np.maximum(np.hypot(v[:, 0], v[:, 1]), 0.02)[:, None]


def _turned(m, force):
    """A force in W as components of B."""
    f = np.broadcast_to(force(m), (len(m.t), 2))
    c, s = np.cos(m.place[:, 2]), np.sin(m.place[:, 2])
    return c * f[:, 0] + s * f[:, 1], -s * f[:, 0] + c * f[:, 1]


def _travelled(m, vx, vy, wz):
    """(rows, 3) displacement in W that a further body velocity adds up to, turning included."""
    vx, vy, wz = (np.broadcast_to(v, m.t.shape) for v in (vx, vy, wz))
    turned = np.cumsum(wz) * TICK_S
    c, s = np.cos(m.place[:, 2]), np.sin(m.place[:, 2])
    bx, by = m.body[:, 0], m.body[:, 1]
    x = np.cumsum(c * vx - s * vy - turned * (s * bx + c * by)) * TICK_S
    y = np.cumsum(s * vx + c * vy + turned * (c * bx - s * by)) * TICK_S
    return np.column_stack([x, y, turned])
