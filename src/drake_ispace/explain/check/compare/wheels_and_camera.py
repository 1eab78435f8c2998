"""Do wheels and camera say the same motion, and if not, which mistake of either makes them?"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.explain.check.compare.agreement import (
    ALIKE,
    SAID,
    Agreement,
    Part,
    Row,
    compared,
    disagreement,
    gains,
    mistakes,
    part,
    plainly_better,
    row,
)
from drake_ispace.explain.check.compare.drive_and_imu import command_columns_of
from drake_ispace.explain.check.compare.foreign import owner
from drake_ispace.explain.check.compare.hypotheses import MODEL_SIZE, Reading, pairs, readings, wheel_angles
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    PLACES_AND_TURNS,
    Base,
    camera_link,
    in_motion,
    inside,
    integral,
    link_of,
)
from drake_ispace.explain.check.compare.motion import Camera, arm, has_motion, turned, windows
from drake_ispace.explain.check.compare.regression import (
    CAMERA,
    MOST_ROWS,
    PHYSICS,
    SLACK,
    Slack,
    relation,
    scale_of,
    scores,
)
from drake_ispace.explain.check.compare.scale import is_unit, ratios
from drake_ispace.explain.check.compare.turned import turns
from drake_ispace.faults.repair import Mixed, Repair, repaired
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND


def wheels_or_camera(
    runs: Sequence[Recording], bases: Sequence[Base | None], single: bool = False
) -> Agreement:
    """The mistakes of wheels, camera or the model's dimensions under which wheels and camera agree.

    single: whether one mistake is looked for only.

    Where a gyro is there, it takes part: it tells wheels that are mistaken for each other from a mirrored room. So do
    torques or a command, where these two are alike.
    """
    base = next((base for base in bases if base is not None), None)
    if base is None:
        return Agreement([])
    motions = [_motions(run, own) for run, own in zip(runs, bases, strict=True)]
    gears = _gears(motions)
    counts = float(base.settings.encoder.counts_per_turn)

    def rows_of(tried):
        return [_row(run, own, tried) for run, own in zip(runs, bases, strict=True)]

    def said_of(angles):
        """The angles [rad] of `turns` as they are said: against most runs, where these are turned by no mistake."""
        tried = readings(base.geometry, counts, turns_rad=angles[:1])
        tried = [reading for reading in tried if not reading.fault] + tried[-1:]
        usual, *others = angles
        if not others or gains(rows_of(tried), tried)[:, -1].clip(0.0).sum() >= SAID:
            return angles
        return [usual, *(float(wrap(angle - usual)) for angle in others)]

    turned = said_of(turns(motions))
    angles = [angle for angle in turned[:1] if _command_tells_angle(runs, bases, base, angle)]
    given = readings(base.geometry, counts, gears, *_ratios(motions), turned, angles, base.skids)

    def casting(reading, having):
        """How much better torques or command agree with the wheels as they are then than with no motion."""
        if reading.fault == MODEL_SIZE and not _command_tells_size(runs, bases, reading):
            return -np.inf
        undo = [repair for one in mistakes(reading) for repair in repairs_of(one, base)]
        return sum(_by_drive(runs[i], bases[i], undo) for i in having if bases[i] is not None)

    def against(i, reading):
        """What the thirds of a run lose by the reading, of which a stretch of a few seconds leaves one as it is."""
        tried = [*(other for other in given if not other.fault), replace(reading, fault="", rare=False, of=())]
        whole = _compare(runs[i], bases[i], tried)
        thirds = [] if whole is None else [third.row(tried, PHYSICS).scored for third in whole.thirds()]
        return sum(max(scored[:-1].max() - scored[-1], 0.0) for scored in thirds)

    def is_others(i, reading):
        """Whether the camera moves with the wheels of another run; of four wheels one that is wrong shows by itself."""
        shows = reading.channel == "encoder" and len(base.geometry.wheels) > 3
        return not shows and owner(runs, bases, i, "kinect") is not None

    return disagreement(
        rows_of, given, None if single else lambda: pairs(base.geometry, counts, gears),
        lambda reading: reading.channel, lambda reading: repairs_of(reading, base), casting, against,
        is_others=is_others,
    )


def _command_tells_angle(runs, bases, base, turn_rad):
    """Whether commands plainly go with the wheels, once those of the model are turned by the angle, and not as given.

    A command that has another frame or sense by itself, or is noise, goes with neither.
    """
    if base.robot.driven != COMMAND or base.geometry.holds_sideways or abs(turn_rad) <= SLACK:
        return False
    as_given = command_columns_of(runs, bases)
    then = command_columns_of(*_read(runs, bases, wheel_angles(base.geometry, turn_rad)))
    follows = then.explained and then.follows > plainly_better(as_given.follows)
    return follows and all(finding.fault == "wrong_unit" for finding in then.findings)


def _command_tells_size(runs, bases, reading):
    """Whether every command tells the ways and the turns of wheels of this size, which the model has not as given."""
    found = [ratio for of_run in ratios(*_read(runs, bases, reading)) for ratio in of_run]
    return bool(found) and all(ratio is not None and is_unit(ratio) for ratio in found)


def _read(runs, bases, reading):
    """The runs and their bases with the angles of wheels as those of a model that a reading accuses."""
    undo = [() if base is None else repairs_of(reading, base) for base in bases]
    read = [repaired(run, repairs) for run, repairs in zip(runs, undo, strict=True)]
    return read, [
        None if base is None else replace(base, encoder=run.channels["encoder"])
        for run, base in zip(read, bases, strict=True)
    ]


def _motions(run, base):
    """(n, 3) motions of windows as wheels and as camera say."""
    link = None if base is None else camera_link(run, base)
    if link is None:
        return np.empty((0, 3)), np.empty((0, 3))
    kept = inside(base, link.since_s, link.until_s)
    return link.predicted(link.since_s[kept], link.until_s[kept]), link.measured[kept]


def _gears(motions):
    """Gears -> how many times as far as the wheels say, the camera sees ways or turns go; motions: of each run.

    A gear is the whole number, or one over it, that is near to that in some run, or the median of what is near to none.
    """
    gears = {}
    for of in (slice(2), slice(2, 3)):
        sizes = [[np.linalg.norm(motion[:, of], axis=1).sum() for motion in both] for both in motions]
        measured = np.array([camera / wheels for wheels, camera in sizes if min(wheels, camera) > 0.0])
        whole = np.where(measured > 1.0, np.rint(measured), 1.0 / np.maximum(np.rint(1.0 / measured), 1.0))
        is_large = np.maximum(whole, 1.0 / whole) > 2.0  # a smaller one may be two, and wheels of another size
        odd = (np.abs(measured / whole - 1.0) > SLACK) & is_large
        if odd.any():
            whole[odd] = np.median(measured[odd])
        of_part = {gear: float(np.median(measured[whole == gear])) for gear in {*whole.tolist()} - {1.0}}
        gears = of_part | gears  # ways first: a robot that skids turns less
    return gears


def _ratios(motions):
    """How many times as far as the camera sees, the wheels turn the robot, and how many times as far as the wheels say,
    the camera sees it go; motions: of each run.
    """
    wheels, camera = map(np.concatenate, zip(*motions, strict=True))
    turns, ways = (np.linalg.norm(wheels[:, part]) for part in (slice(2, 3), slice(2)))
    seen_turns, seen_ways = (np.linalg.norm(camera[:, part]) for part in (slice(2, 3), slice(2)))
    ratio = lambda one, other: float(one / other) if min(one, other) > 0.0 else 1.0  # noqa: E731
    return ratio(turns, seen_turns), ratio(seen_ways, ways)


def _by_drive(run, base, repairs):
    for repair in repairs:
        run = repair.apply(run)
    link = link_of(run, replace(base, encoder=run.channels["encoder"]), base.robot.driven)
    if link is None:
        return 0.0
    unit, as_given_or_unrelated = np.eye(link.measured.shape[1]), np.array([1.0, 0.0])[:, None, None]
    found = compared(link, base, [unit, unit], as_given_or_unrelated)
    return 0.0 if found is None else float(found.scored[0] - found.scored[1])


@dataclass(frozen=True)
class _Compared:
    """Windows [s] of a run (n,), motions x (h, n, 3) that h readings make of the wheels, and y of the camera.

    noise: (h, 3), as of regression.scores. apart: (h, n, r) what the wheels turn by that no motion of the body makes
    them, as a share of what they turn by; r = 0: of so few wheels there is nothing.
    """

    since_s: np.ndarray
    until_s: np.ndarray
    x: np.ndarray
    y: np.ndarray
    noise: np.ndarray
    apart: np.ndarray

    def row(self, given: Sequence[Reading], slack: Slack, gyro: Part | None = None) -> Row:
        """What these windows say of the readings."""
        if len(self.since_s) < FEWEST:
            return row(given)
        return row(given, part(self.x, self.y, PLACES_AND_TURNS, self.noise, slack=slack), self._of_wheels(), gyro)

    def _of_wheels(self) -> Part | None:
        """Do the wheels agree with each other? Four wheels of a body on the floor tell of three motions."""
        count = min(self.apart.shape[1], MOST_ROWS) * self.apart.shape[2]
        if not count:
            return None
        return Part(-count * np.log(np.clip(_size(self.apart), SLACK, 1.0)), -count * np.log(SLACK))

    def thirds(self) -> list["_Compared"]:
        """Each third of the time, with the marker where the whole run has it: a short one would tell of any."""
        x = self.x.copy()
        x[:, :, :2] += self.x[:, :, 2:] @ relation(self.x, self.y, CAMERA)[:, 2:, :2]
        ends = np.linspace(self.since_s[0], self.until_s[-1], 4)
        parts = [(self.since_s >= begin) & (self.until_s <= end) for begin, end in pairwise(ends)]
        return [
            _Compared(self.since_s[k], self.until_s[k], x[:, k], self.y[:, k], self.noise, self.apart[:, k])
            for k in parts
        ]


def _compare(run: Recording, base: Base | None, given: Sequence[Reading]) -> _Compared | None:
    """The windows of a run by each of the readings; None: there are none."""
    if base is None or not has_motion(run):
        return None
    kinect = run.channels["kinect"]
    stretches = windows(kinect)
    since, until, camera = stretches.since_s, stretches.until_s, Camera(kinect, stretches)
    noise = base.noise_beside(camera.noise())
    kept = inside(base, since, until) & in_motion(base.moved(since, until), camera.motion(), noise)
    if kept.sum() < FEWEST:
        return None
    since, until, unit = since[kept], until[kept], np.array([1.0, 1.0, arm(base.geometry)])
    angles = turned(base.encoder, since, until)
    views = {
        view: (camera.motion(view)[kept], base.noise_beside(camera.noise(view)))
        for view in {reading.view for reading in given}
    }
    x = np.stack([angles @ (r.body @ base.geometry.forward @ r.wheels).T for r in given]) * unit
    y, noise = (np.stack(values) * unit for values in zip(*(views[r.view] for r in given), strict=True))
    return _Compared(since, until, x, y, noise, _apart(angles, base, given))


def _apart(angles, base, given):
    """As of _Compared; where the camera is unrelated to the wheels, these are as given."""
    geometry, unit = base.geometry, np.eye(angles.shape[1])
    left, sizes, _ = np.linalg.svd(unit - geometry.inverse @ geometry.forward)
    turns = np.stack([angles @ (r.wheels if r.wheels.any() else unit).T for r in given])
    return turns @ left[:, sizes > 0.5] / (_size(turns)[:, None, None] + base.count_rad)


def _size(motions):
    """(h,) scale of motions (h, n, d): the root mean square over their components."""
    return np.sqrt(np.mean(scale_of(np.swapaxes(motions, 1, 2)) ** 2, axis=1))


def _row(run: Recording, base: Base | None, given: Sequence[Reading]) -> Row:
    both = _compare(run, base, given)
    if both is None:
        return row(given)
    gyro = None  # it decides between readings that are alike, and accuses nobody
    if "imu" in run.channels:
        since, until = both.since_s, both.until_s
        turn = np.broadcast_to(integral(run.channels["imu"], ("wz",), since, until), (len(given), len(since), 1))
        gyro = scores(both.x[:, :, 2:] / arm(base.geometry), turn, ((0,),), np.zeros((len(given), 1)))
        gyro = Part(np.clip(gyro - gyro[0], -ALIKE, ALIKE), 0.0)
    return both.row(given, CAMERA, gyro)


def repairs_of(reading: Reading, base: Base) -> tuple[Repair, ...]:
    """What undoes the mistakes of a reading, of the model's dimensions in the angles of the wheels."""
    repairs, geometry, wheels = [], base.geometry, reading.wheels
    if not np.array_equal(reading.body, np.eye(3)):  # of the wheels' angles, as if not the model were wrong
        seen = geometry.inverse @ geometry.forward
        wheels = (geometry.inverse @ reading.body @ geometry.forward + np.eye(len(wheels)) - seen) @ wheels
    if not np.array_equal(wheels, np.eye(len(wheels))):
        repairs.append(Mixed("encoder", base.encoder.columns, tuple(map(tuple, wheels.tolist()))))
    view = reading.view
    if view.axes != ((1.0, 0.0), (0.0, 1.0)):
        repairs.append(Mixed("kinect", ("x", "y"), view.axes))
    if (view.scale, view.offset_rad) != (1.0, 0.0):
        repairs.append(Mixed("kinect", ("phi",), ((view.scale,),), (view.offset_rad,)))
    return tuple(repairs)
