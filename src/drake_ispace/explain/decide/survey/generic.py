"""Generic disagreements: a force or a loss of motion that goes with some variable, and has no name in the library.

They compete with the effects of the library. Where a generic disagreement explains the runs better than every effect,
the verdict is "unknown", and the disagreement tells which link is wrong and what the error goes with.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander

from drake_ispace.blocks.frames import rotated
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Parameter
from drake_ispace.explain.decide.survey.signatures import Signature, difference
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.explain.predict.prediction import Prediction, Residuals, Speeds, past_speeds, wheel_speeds
from drake_ispace.explain.predict.stretches import STRETCH_S
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.threads import each
from drake_ispace.plants.wheels import WheelGeometry
from drake_ispace.robots.robot import COMMAND

_CELLS = 3  # along each side of the area that the runs have visited
_DEGREES = 5  # of polynomials of time, and of the way that a user's own plant went, which make them local
_FINEST_RIPPLE = 24  # periods per wheel turn
WARM_S = 5.0  # time constant of what wears off
_SMALL = 0.01  # share of a radius, by which the way is turned so little that shares add up
_LEAST_SPEED = 0.02  # m/s, below which the direction of motion fades to zero

#: (prediction, point, residuals at the point) -> a signature for every amplitude of every generic disagreement.
Generics = Callable[[Prediction, Point, Residuals], list[Signature]]
#: A generic disagreement, and for each of its amplitudes an array per run.
_Shapes = tuple["Generic", list[list[np.ndarray]]]


@dataclass(frozen=True, eq=False)
class Generic:
    """A disagreement that no effect stands for; a Candidate may have it in the place of an Effect.

    Attributes:
        name: tells it from other disagreements. link: "force" or "motion". driver: the variable that it goes with.
        columns: number of its amplitudes. since_s, until_s: of what may go with time in any way, between which [s];
            else 0. share: of the command or radius that an amplitude of one then is.
    """

    name: str
    link: str
    driver: str
    columns: int
    since_s: float = 0.0
    until_s: float = 0.0
    share: float = 0.0

    @property
    def is_local(self) -> bool:
        """Whether it has amplitudes for parts of the room, way, time or commands: these can explain slow noise, too."""
        return self.is_in_time or (self.columns > 4 and self.driver.startswith(("place", "command")))

    @property
    def is_in_time(self) -> bool:
        """Whether it may go with time in any way."""
        return self.until_s > 0.0

    def course(self, amounts: np.ndarray, covariance: np.ndarray) -> list[tuple[float, float, float]]:
        """(t [s], share by which there is more, its standard deviation) at a few instants.

        amounts, covariance: of its amplitudes.
        """
        t = np.linspace(self.since_s, self.until_s, self.columns)
        shares = self.share * legvander(np.linspace(-1.0, 1.0, self.columns), _DEGREES)
        stds = np.sqrt(np.maximum(np.sum(shares @ covariance * shares, axis=1), 0.0))
        return [tuple(map(float, row)) for row in zip(t, shares @ amounts, stds, strict=True)]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """An amplitude for every column."""
        return tuple(Parameter(f"amplitude_{i + 1}", "", probes=(1.0,)) for i in range(self.columns))


def generic_signatures(
    prediction: Prediction, point: Point, base: Residuals, in_time: bool = True
) -> list[Signature]:
    """A signature for every amplitude of every generic disagreement that these runs could show.

    Args:
        prediction: model and runs. point: effects that the model already has. base: residuals at `point`. in_time:
            whether those count that may go with time in any way.
    """
    motions = [motion_of(prediction, track, past_speeds) for track in prediction.tracks]
    shapes = []  # each behind the method of the prediction that takes it
    if prediction.channels["motion"]:
        shapes += [(prediction.pushed, force) for force in _forces(prediction, motions)]
        shapes += [(prediction.injected, command) for command in _commands(prediction, motions)]
        shapes += [(prediction.read_off, angle) for angle in _angles(prediction, motions)]
    if any(m.is_placed for m in motions) and prediction.replay.body.robot.in_room:
        shapes += [(prediction.displaced, loss) for loss in _losses(prediction.replay.body.plant.geometry, motions)]
    values, amplitudes = merged(point), []
    for predict, (generic, columns) in shapes:
        if generic.is_in_time and not in_time:
            continue
        candidate = Candidate(generic, (), generic.parameters)
        amplitudes += [(candidate, at, predict, column) for at, column in enumerate(columns)]

    def signature(amplitude):
        candidate, at, predict, column = amplitude
        z = [float(i == at) for i in range(candidate.effect.columns)]
        return Signature(candidate, z, at, False, difference(base, predict(column, values)))

    return each(signature, amplitudes)


@dataclass(frozen=True)
class Motion:
    """The motion of a run, at every tick of it and of the lead after it.

    Attributes:
        body: (rows, 3) velocity of B [m/s, m/s, rad/s]. place: (rows, 3) pose in W. t: (rows,) [s].
        angles, rates: (rows, n) of the wheels [rad, rad/s]. command: (rows, m). is_placed: whether the place is known.
    """

    body: np.ndarray
    place: np.ndarray
    t: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    command: np.ndarray
    is_placed: bool = True


def motion_of(prediction: Prediction, track: Track, speeds: Speeds = wheel_speeds) -> Motion:
    """The motion of a run: velocity from its encoders, pose from its fixes (zeros where it has fewer than two).

    speeds: of the wheels from their angles.
    """
    body = prediction.replay.body
    angles = track.turned[:, : body.wheels]
    rates = speeds(angles)
    ticks_s = np.arange(len(angles)) * TICK_S
    place, is_placed = np.zeros((len(angles), 3)), len(track.fix_t) > 1
    if is_placed:
        fixes = track.poses
        fixes[:, 2] = np.unwrap(fixes[:, 2])
        place = np.column_stack([np.interp(ticks_s, track.fix_t, column) for column in fixes.T])
    velocity = rates @ body.plant.geometry.forward.T
    return Motion(velocity, place, track.since_s + ticks_s, angles, rates, track.command, is_placed)


def _forces(prediction, motions) -> Iterator[_Shapes]:
    """Forces on the body, each array (rows, 3) as Replay.pushed takes it.

    They are about as large as a tenth of the usual command makes. Where velocity is commanded, they go with the motion
    as it is told.
    """
    body, around = prediction.replay.body, [motion_of(prediction, track) for track in prediction.tracks]
    if body.robot.driven == COMMAND:  # what goes with the drive's own errors repeats how these are correlated
        motions, around = ([replace(m, body=m.command) for m in those] for those in (motions, around))
    size = _tenth_of_usual_command(motions)
    largest = body.robot.force_of_command(body.plant)
    top_speed, top_turn = _top(motions, slice(2)), _top(motions, 2)

    def resist(m, share):
        """A push against the direction of motion, of size `share` (rows,)."""
        return push(m, *(-_direction(m.body[:, :2]) * share[:, None]).T)

    def push(m, x=0.0, y=0.0, yaw=0.0):
        force = size * largest * np.column_stack([np.broadcast_to(f, m.t.shape) for f in (x, y, yaw)])
        return body.robot.ground_force(force)

    def push_in_room(m, force):
        """A push that is given in W; beside runs whose place is known, none in one whose is not."""
        return push(m, *_in_body_frame(m, force)) * (m.is_placed or not knows_places)

    knows_places = any(m.is_placed for m in motions)
    if _is_motion(motions, around, slice(2, 3)):
        yield Generic("drag_of_spin_squared", "force", "yaw rate squared", 1), [
            [push(m, yaw=-np.abs(m.body[:, 2]) * m.body[:, 2] / top_turn**2) for m in motions]
        ]
    ways = [m.angles.mean(axis=1) for m in motions]
    if body.robot.in_room:
        of_room = lambda m: np.array([1.0, 0.0]), lambda m: np.array([0.0, 1.0]), lambda m: -m.place[:, :2]
        forces = [[push_in_room(m, force) for m in motions] for force in of_room]
        yield Generic("spring_in_the_room", "force", "place", 3), forces
        if knows_places and body.robot.driven == COMMAND:  # a torque may meet a tilted floor, which is in the library
            yield Generic("constant_force_in_the_room", "force", "heading", 2), forces[:2]
    else:
        longest = max(np.abs(way).max() for way in ways) or 1.0
        yield Generic("spring_along_the_way", "force", "wheel angle", 1), [
            [push(m, -way / longest) for m, way in zip(motions, ways, strict=True)]
        ]
    if not _is_motion(motions, around, slice(2)):
        return
    yield Generic("drag_of_speed_squared", "force", "speed squared", 1), [
        [resist(m, (_speed(m) / top_speed) ** 2) for m in motions]
    ]
    yield Generic("resistance_that_wears_off", "force", "time and direction", 2), [
        [resist(m, np.exp(-m.t / WARM_S)) for m in motions], [resist(m, m.t / STRETCH_S) for m in motions],
    ]
    if not body.robot.in_room:
        along = _polynomials(ways)
        yield Generic("resistance_along_the_way", "force", "place and direction", _DEGREES), [
            [resist(m, x[:, degree]) for m, x in zip(motions, along, strict=True)] for degree in range(1, _DEGREES + 1)
        ]
    elif knows_places:
        cells = _cells(motions)
        yield Generic("resistance_of_a_patch", "force", "place and direction", len(cells)), [
            [resist(m, inside) for m, inside in zip(motions, cell, strict=True)] for cell in cells
        ]


def _commands(prediction, motions) -> Iterator[_Shapes]:
    """Commands to add to the recorded ones, each array (rows, m), about a tenth of the usual command in size."""
    body, size = prediction.replay.body, _tenth_of_usual_command(motions)
    yield Generic("command_that_wears_in", "force", "time and command", 1), [
        [0.1 * m.command * np.exp(-m.t / WARM_S)[:, None] for m in motions]
    ]
    times = [np.broadcast_to(m.t[:, None], m.command.shape) for m in motions]
    largest = np.maximum(np.max([np.abs(m.command).max(axis=0) for m in motions], axis=0), 1e-9)
    sizes = [np.abs(m.command) / largest for m in motions]
    for generic, of in (
        (_in_time("command_in_time", "force", "time and command", 0.1, motions), times),
        (Generic("command_of_its_size", "force", "command", _DEGREES + 1), sizes),
    ):
        gains = _polynomials(of)
        yield generic, [
            [0.1 * m.command * gain[..., degree] for m, gain in zip(motions, gains, strict=True)]
            for degree in range(_DEGREES + 1)
        ]
    if body.robot.driven == COMMAND:
        return
    yield Generic("constant_torque", "force", "nothing", body.wheels), [
        [np.broadcast_to(size * np.eye(body.wheels)[i], m.command.shape) for m in motions] for i in range(body.wheels)
    ]
    for n in _ripples():
        yield Generic(f"ripple_{n}_a_turn", "force", "wheel angle", 2), [
            [size * wave(n * m.angles) for m in motions] for wave in (np.sin, np.cos)
        ]
    if body.robot.in_room:  # else it is a resistance along the way
        yield Generic("friction_once_a_turn", "force", "wheel angle and direction", 2 * body.wheels), [
            [-size * wheel * wave(m.angles) * np.sign(m.rates) for m in motions]
            for wheel in np.eye(body.wheels) for wave in (np.sin, np.cos)
        ]


def _angles(prediction, motions) -> Iterator[_Shapes]:
    """What encoders may show besides the angles of the wheels, each array (rows, wheels) [rad].

    Of a robot whose torque is recorded a ripple twice a turn is one of its torque.
    """
    if prediction.replay.body.robot.driven != COMMAND or "encoder" not in prediction.replay.feeds:
        return
    for number, wheel in enumerate(np.eye(prediction.replay.body.wheels), 1):
        yield Generic(f"encoder_ripple_of_wheel_{number}", "motion", "wheel angle", 2), [
            [0.01 * wheel * wave(2.0 * m.angles) for m in motions] for wave in (np.sin, np.cos)
        ]


def _ripples() -> list[int]:
    """Periods per wheel turn of what poles, spokes and rollers make: numbers that have no primes but two and three."""
    return [n for n in range(1, _FINEST_RIPPLE + 1) if _FINEST_RIPPLE**n % n == 0]


def _losses(wheels: WheelGeometry, motions) -> Iterator[_Shapes]:
    """Displacements that the fixes would show besides, each array (rows, 3) [m, m, rad] in W."""
    def slip(m, share):
        return _travelled(m, m.body[:, 0] * share, m.body[:, 1] * share, 0.0 * share)

    cells = _cells(motions)
    yield Generic("slip_of_a_patch", "motion", "place", len(cells)), [
        [-0.05 * slip(m, inside) for m, inside in zip(motions, cell, strict=True)] for cell in cells
    ]
    yield Generic("slip_of_speed", "motion", "speed", 1), [[-0.1 * slip(m, _speed(m)) for m in motions]]
    top_turn = _top(motions, 2)
    yield Generic("slip_of_turning", "motion", "yaw rate", 1), [
        [-0.05 * slip(m, np.abs(m.body[:, 2]) / top_turn) for m in motions]
    ]
    if not wheels.holds_sideways:
        often = np.lcm(2, len(wheels.wheels))  # as the same wheels come round, pushed or pulled
        yield Generic("slip_of_direction", "motion", "direction of motion", 3), [
            [-0.05 * slip(m, wave(often * _course(m))) for m in motions] for wave in (np.ones_like, np.cos, np.sin)
        ]
    yield Generic("understeer", "motion", "speed and turning", 1), [
        [_travelled(m, 0.0, 0.0, -0.2 * m.body[:, 2] * _speed(m) ** 2) for m in motions]
    ]
    yield Generic("slip_of_time", "motion", "time", 1), [[-0.05 * slip(m, m.t / STRETCH_S) for m in motions]]
    in_time = _polynomials([m.t for m in motions])
    for i, moved in enumerate(wheels.forward.T):
        further = [_SMALL * np.outer(moved, m.rates[:, i]) for m in motions]
        driver = f"time and way of wheel {i + 1}"
        yield _in_time(f"radius_of_wheel_{i + 1}_in_time", "motion", driver, _SMALL, motions), [
            [_travelled(m, *(v * x[:, degree])) for m, v, x in zip(motions, further, in_time, strict=True)]
            for degree in range(_DEGREES + 1)
        ]
    yield Generic("drift", "motion", "distance", 2), [
        [_travelled(m, 0.0, 0.02 * _speed(m), 0.0) for m in motions],
        [_travelled(m, 0.0, 0.0, 0.05 * _speed(m)) for m in motions],
    ]


def _is_motion(motions, around, axes: slice) -> bool:
    """Whether the robot moved along these axes of its body, or its encoders only round.

    Where they do, speeds of the past alone (`motions`) differ from those `around` each instant by more than there is of
    the latter.
    """
    apart = [past.body[:, axes] - now.body[:, axes] for past, now in zip(motions, around, strict=True)]
    return bool(np.sum(np.vstack([now.body[:, axes] for now in around]) ** 2) > np.sum(np.vstack(apart) ** 2))


def _tenth_of_usual_command(motions):
    """A tenth of the root mean square of all commands."""
    return 0.1 * np.sqrt(np.mean(np.vstack([m.command for m in motions]) ** 2)) or 0.01


def _in_time(name, link, driver, share, motions):
    """The Generic that may go with time in any way; share: of an amplitude of one."""
    since_s, until_s = min(m.t.min() for m in motions), max(m.t.max() for m in motions)
    return Generic(name, link, driver, _DEGREES + 1, since_s, until_s, share)


def _polynomials(xs):
    """(..., _DEGREES + 1) Legendre polynomials of a variable of each run, over the range that it has in all of them."""
    low, high = min(x.min() for x in xs), max(x.max() for x in xs)
    return [legvander((2.0 * x - low - high) / max(high - low, 1e-9), _DEGREES) for x in xs]


def _cells(motions):
    """For each cell of the visited area, per run (rows,): 1 inside of it, else 0; a run without a place is in none.

    Cells that all runs together visited for no longer than noise is correlated are left out.
    """
    places = np.vstack([m.place[:, :2] for m in motions if m.is_placed])
    low, high = places.min(axis=0), places.max(axis=0) + 1e-9

    def number(m):
        index = np.minimum((_CELLS * (m.place[:, :2] - low) / (high - low)).astype(int), _CELLS - 1)
        return index[:, 0] * _CELLS + index[:, 1] if m.is_placed else np.full(len(index), -1)

    numbers = [number(m) for m in motions]
    visited = [c for c in range(_CELLS**2) if sum((n == c).sum() for n in numbers) > BLOCK_TICKS]
    return [[(n == c).astype(float) for n in numbers] for c in visited]


def _speed(m):
    """(rows,) of B [m/s]."""
    return np.hypot(m.body[:, 0], m.body[:, 1])


def _top(motions, axes):
    """The largest root mean square of a run's velocity along these axes of B; 1 where nothing moves."""
    return max(np.sqrt(np.mean(m.body[:, axes] ** 2)) for m in motions) or 1.0


def _course(m):
    """(rows,) direction of motion in B [rad]."""
    return np.arctan2(m.body[:, 1], m.body[:, 0])


def _direction(v):
    """(rows, 2) unit vectors along velocities (rows, 2), shorter near rest."""
    return v / np.maximum(np.hypot(v[:, 0], v[:, 1]), _LEAST_SPEED)[:, None]


def _in_body_frame(m, force):
    """x and y components in B, (rows,) each, of a force that is given in W as a function of the motion."""
    return rotated(np.broadcast_to(force(m), (len(m.t), 2)), -m.place[:, 2]).T


def _travelled(m, vx, vy, wz):
    """(rows, 3) displacement in W that a further body velocity adds up to; what it turns, the way is turned by.

    Linear in the velocity only where it turns little.
    """
    vx, vy, wz = (np.broadcast_to(v, m.t.shape) for v in (vx, vy, wz))
    turned = np.cumsum(wz) * TICK_S
    way = rotated(m.body[:, :2], m.place[:, 2])
    further = rotated(np.column_stack([vx, vy]), m.place[:, 2]) + way - rotated(way, -turned)
    return np.column_stack([np.cumsum(further, axis=0) * TICK_S, turned])
