"""Do torque, command and IMU say the same motion as the wheels? If not, which mistake of their columns makes them?"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.agreement import RELATED, WELL, Agreement, compared, disagreement, part, row
from drake_ispace.explain.check.compare.columns import (
    Columns,
    accelerometer_columns,
    command_columns,
    gyro_columns,
    innocent,
    pairs,
    torque_columns,
)
from drake_ispace.explain.check.compare.gyro_rates import ratios as gyro_ratios
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    RATE_S,
    Base,
    command_link,
    held_integral,
    inside,
    integral,
    torque_link,
    turn_link,
)
from drake_ispace.explain.check.compare.motion import arm, has_motion
from drake_ispace.explain.check.compare.ratio import times, unit_as_ratio
from drake_ispace.explain.check.compare.regression import SLACK
from drake_ispace.explain.check.compare.scale import doubted
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.faults.repair import AlongRobot, Mixed
from drake_ispace.files.recording import Recording
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.robot import COMMAND, TORQUE

_NO_LEAN = "as given, whatever the lean"
_FORCES, _TURNS = ("ax", "ay", "az"), ("wx", "wy", "wz")
#: A mistake of torques -> those of the wheels that are the same where nothing else tells of the wheels.
_OF_THE_WHEELS = {
    "torque_sign": ("encoder_sign", "wheel_sign"), "torques_swapped": ("wheels_swapped",),
    "wrong_unit": ("counts_per_turn", "gear"),
}
#: Vibration hides some of what a sound IMU follows, friction and the room's forces most of what a torque does.
_WELL = {COMMAND: WELL, "imu": 0.5 * WELL, TORQUE: 0.25 * WELL}
#: A command whose turns are of another sense and unit still follows well, by its way.
_LEAST_SHARE = {COMMAND: 1.0 - RELATED}
Runs, Bases = Sequence[Recording], Sequence[Base | None]


def torque_columns_of(runs: Runs, bases: Bases, single: bool = False) -> Agreement:
    """The mistakes of the torques' columns under which they agree with the wheels' acceleration.

    single: as of wheels_or_camera.
    """
    base = _first(bases)
    if base is None or base.robot.driven != TORQUE:
        return Agreement([])
    links = [
        torque_link(run, own) if own is not None and TORQUE in run.channels else None
        for run, own in zip(runs, bases, strict=True)
    ]
    of_run = {id(run): link for run, link in zip(runs, links, strict=True)}
    lags_s = np.zeros(1) if single else base.lags_s
    off_by = 1.0 if base.robot.in_si and single else times(links, bases, lags_s)
    given, plant = torque_columns(len(base.geometry.wheels), base.robot.in_si, off_by), base.settings.plant
    effort = base.robot.effort(plant)[base.robot.unweighted]
    effort = effort / np.abs(effort).max(axis=1, keepdims=True)

    def one(run, own, tried):
        link = of_run[id(run)]
        lags_s = np.zeros(1) if single else own.lags_s  # where clocks are tried, each is a lag
        return row(tried, None if link is None else _of_wheels(run, own, link, tried, effort, lags_s))

    found = _found(runs, bases, given, one, TORQUE, None, single)
    if base.robot.in_si:
        return found
    told = unit_as_ratio(found.findings, runs, bases, lags_s)
    return replace(found, findings=[
        replace(finding, rivals=(*finding.rivals, *_OF_THE_WHEELS[finding.fault])) for finding in told
    ])


def _of_wheels(run, base, link, given, effort, lags_s):
    """As `compared`, of the torque of each wheel: some of their sums push nothing, and are not in the link.

    Of a reading counts what it gains over no relation to the wheels, at the best of some lags: forces of any share tell
    of no reading, and a late torque is no torque of another sense.
    """
    kept = np.all([inside(base, link.since_s, link.until_s, lag_s) for lag_s in lags_s], axis=0)
    if kept.sum() < FEWEST:
        return None
    since, until = link.since_s[kept], link.until_s[kept]
    impulses = held_integral(run.channels[TORQUE], since, until)
    y = np.stack([impulses @ (effort @ columns.matrix).T for columns in given])
    noise = np.broadcast_to(link.noise, (len(y), y.shape[2]))

    def at(lag_s):
        """The log likelihoods of all readings, and those of no relation, where wheels say the motion lag_s later."""
        times = since + lag_s, until + lag_s
        x, besides = _related(given) * link.predicted(*times), link.besides(*times)
        return [part(motion, y, link.groups, noise, besides, link.slack) for motion in (x, 0.0 * x)]

    found = [at(lag_s) for lag_s in lags_s]
    gained = np.max([related.scored - unrelated.scored for related, unrelated in found], axis=0)
    related, unrelated = found[len(found) // 2]  # without a lag
    return replace(related, scored=gained + unrelated.scored[0])


def _related(given):
    """(readings, 1, 1), or (readings, 1, d) where one is unrelated in some columns: a factor on the wheels' motion."""
    each = [np.atleast_1d(columns.related) for columns in given]
    return np.stack(np.broadcast_arrays(*each))[:, None]


def command_columns_of(runs: Runs, bases: Bases, single: bool = False) -> Agreement:
    """The mistakes of the command's columns under which it agrees with the wheels' motion.

    single: as of wheels_or_camera.
    """
    base = _first(bases)
    if base is None or base.robot.driven != COMMAND:
        return Agreement([])
    unit, along = np.array([1.0, 1.0, arm(base.geometry)]), AlongRobot(COMMAND, "kinect")
    links = [
        command_link(run, own) if own is not None and COMMAND in run.channels else None
        for run, own in zip(runs, bases, strict=True)
    ]
    told = [
        None if link is None else held_integral(along.apply(run).channels[COMMAND], link.since_s, link.until_s) * unit
        for run, link in zip(runs, links, strict=True)
    ]
    given = command_columns(doubted(runs, bases), _rooms(runs, bases, links, told))
    of_run = {id(run): both for run, both in zip(runs, zip(links, told, strict=True), strict=True)}

    def one(run, own, tried):
        link, in_room = of_run[id(run)]
        if link is None:
            return row(tried)
        measured = [in_room if columns.in_room else link.measured for columns in tried]
        matrices = [columns.matrix * unit[:, None] / unit for columns in tried]
        return row(tried, compared(link, own, matrices, _related(tried), measured))

    found = _found(runs, bases, given, one, COMMAND, ("vx", "vy", "wz"), single)
    return replace(found, findings=[
        replace(finding, repairs=(), for_now=finding.repairs) if finding.advice else finding
        for finding in found.findings
    ])


def _rooms(runs, bases, links, told):
    """Angles [rad] by which the room of commands may be turned against the camera's, none first; of no camera: empty.

    told: of each run, motions that are commanded along the camera's room.
    """
    both, sees = 0.0, any(map(has_motion, runs))
    for run, base, link, way in zip(runs, bases, links, told, strict=True):
        if link is not None and has_motion(run):
            kept = inside(base, link.since_s, link.until_s)
            wheels = link.predicted(link.since_s[kept], link.until_s[kept])
            both += np.vdot(way[kept, :2] @ (1.0, 1j), wheels[:, :2] @ (1.0, 1j))
    angle = float(np.angle(both))
    return [0.0, *([angle] if abs(angle) > SLACK else [])] if sees else []


def imu_columns_of(runs: Runs, bases: Bases, single: bool = False) -> Agreement:
    """The mistakes of the IMU's columns under which it agrees with gravity and the wheels' motion.

    single: as of wheels_or_camera.

    A body that shakes faster than rates can be told from counts leans otherwise than these comparisons say, by which no
    column is to blame: other axes must do better than no lean at all.
    """
    unit, gyros = np.eye(3), gyro_columns(gyro_ratios(runs, bases))
    given = [*innocent(6), Columns("", _NO_LEAN, np.eye(6))]
    given += [_six(gyro, unit, gyro.matrix) for gyro in gyros]
    given += [_six(force, force.matrix, unit) for force in accelerometer_columns()]
    given += [_six(both, both.matrix, both.matrix) for both in gyros if both.fault == "imu_axes"]

    def one(run, own, tried):
        return row(tried, *_imu_parts(run, own, tried)) if "imu" in run.channels else row(tried)

    return _found(runs, bases, given, one, "imu", (*_FORCES, *_TURNS), single)


def _six(columns, force, gyro):
    """The reading of all six columns of an IMU."""
    what = columns.what
    if columns.fault == "imu_axes" and not np.array_equal(force, np.eye(3)) and not np.array_equal(gyro, np.eye(3)):
        what = f"{what}, and the accelerometer's alike"
    both = np.block([[force, np.zeros((3, 3))], [np.zeros((3, 3)), gyro]])
    offset = None if columns.offset is None else np.concatenate([columns.offset, np.zeros(3)])
    return Columns(columns.fault, what, both, columns.rare, offset)


def _imu_parts(run, base, given):
    """Log likelihoods of the turn about the vertical, of gravity, and of the specific force along x and y."""
    imu, parts = run.channels["imu"], []
    link = turn_link(run, base)
    kept = inside(base, link.since_s, link.until_s)
    if kept.sum() >= FEWEST:
        since, until = link.since_s[kept], link.until_s[kept]
        six = np.hstack([integral(imu, _FORCES, since, until), integral(imu, _TURNS, since, until)])
        lasts = (until - since)[:, None]
        read = [six @ c.matrix.T + (0.0 if c.offset is None else lasts * c.offset) for c in given]
        turn = np.stack([values[:, 5:] for values in read])
        x = _related(given) * link.predicted(since, until)
        parts.append(part(x, turn, ((0,),), np.zeros((len(given), 1)), link.besides(since, until), link.slack))
        force = np.stack([values[:, :3] for values in read])
        x = _related(given) * lasts * np.array([0.0, 0.0, GRAVITY])
        parts.append(part(x, force, ((0, 1, 2),), np.zeros((len(given), 3))))
    edges, block, predicted = _felt(run, base)
    kept = inside(base, *edges.T)
    if len(np.unique(block[kept])) > 1:
        since, until = edges[kept].T
        force = integral(imu, _FORCES, since, until) / (until - since)[:, None]
        y = _levelled(np.stack([force @ c.matrix[:3, :3].T for c in given])[:, :, :2], block[kept])
        x = _levelled(np.stack([predicted(c.matrix[3:, 3:] * (c.what != _NO_LEAN))[kept] for c in given]), block[kept])
        parts.append(part(_related(given) * x, y, ((0, 1),), np.zeros((len(given), 2))))
    return parts


def _felt(run: Recording, base: Base) -> tuple[np.ndarray, np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """The specific force along x and y that an accelerometer on a body that leans a little should feel.

    Returns:
        edges (n, 2) [s] of windows, whole blocks of BLOCK_TICKS; number of the block (n,) of each; and a function of a
        matrix (3, 3) on the gyro's rates: (n, 2) [m/s^2]. A block's mean says nothing, as the lean drifts.
    """
    imu = run.channels["imu"]
    t = np.arange(imu.t[0] + 3.0 * RATE_S, imu.t[-1] - 3.0 * RATE_S, 2.0 * RATE_S)
    block = round(BLOCK_TICKS * TICK_S / (2.0 * RATE_S))
    t = t[: len(t) // block * block]
    columns = ("wx", "wy", "wz")
    angles = integral(imu, columns, np.full(len(t), imu.t[0]), t)
    rates = [integral(imu, columns, t + k * RATE_S, t + (k + 1) * RATE_S) / RATE_S for k in (-1, 0)]
    spins = (rates[1] - rates[0]) / RATE_S
    velocity, arm_m = _rates_at(base, t), base.robot.lean_arm(base.settings)
    accelerations = (_rates_at(base, t + RATE_S) - _rates_at(base, t - RATE_S)) / (2.0 * RATE_S)

    def predicted(gyro):
        lean, spin = (angles @ gyro.T)[:, 1], (spins @ gyro.T)[:, 1]
        along = accelerations[:, 0] - velocity[:, 1] * velocity[:, 2] + arm_m * spin - GRAVITY * lean
        return np.column_stack([along, accelerations[:, 1] + velocity[:, 0] * velocity[:, 2]])

    return np.column_stack([t - RATE_S, t + RATE_S]), np.arange(len(t)) // block, predicted


def _rates_at(base: Base, t: np.ndarray) -> np.ndarray:
    """(n, 3) velocity of the body [m/s, m/s, rad/s], as the wheels say."""
    return base.wheel_rates(t) @ base.geometry.forward.T


def _levelled(values, block):
    """values (h, n, d) less a straight line in each block."""
    levelled = values.copy()
    for k in np.unique(block):
        at = np.flatnonzero(block == k)
        line = np.linalg.qr(np.vander(np.arange(len(at)), 2))[0]
        levelled[:, at] -= line @ (line.T @ values[:, at])
    return levelled


def _first(bases):
    return next((base for base in bases if base is not None), None)


def _found(runs, bases, given, one, channel, columns, single):
    def rows_of(tried):
        return [row(tried) if base is None else one(run, base, tried) for run, base in zip(runs, bases, strict=True)]

    def repairs(reading):
        names = columns or next(run.channels[channel].columns for run in runs if channel in run.channels)
        offset = () if reading.offset is None else tuple(reading.offset.tolist())
        mixed = Mixed(channel, names, tuple(map(tuple, reading.matrix.tolist())), offset)
        if reading.in_room:
            return (AlongRobot(channel, "kinect"), *(() if np.array_equal(reading.matrix, np.eye(3)) else (mixed,)))
        return (mixed,)

    both = None if single else lambda: pairs(given)
    return disagreement(
        rows_of, given, both, lambda reading: channel, repairs, well=_WELL[channel],
        least_share=_LEAST_SHARE.get(channel, 0.0),
    )
