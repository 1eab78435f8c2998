"""Noise in the gap: of the sensors, as stated, and of the process, as strong as the runs need and may need.

Noise of known size is added to the recorded runs anew, and the spread of the errors is what noise of that size leaves.
Sensor noise is what counts, pixels and densities of the scenario say, or what fixes show of a robot at rest, or on the
move where that is less. Process noise has physical forms: forces from outside along each coordinate, and a random walk
of the place (translation, turn) with the way, as wheels slip. How strong each is follows from short horizons. What adds
up over long horizons as noise of that form does not is then no noise; and a strength beyond the limits of the robot is
not plausible.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import brentq, nnls
from scipy.signal import lfilter
from scipy.stats import binom

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.messages import FIX
from drake_ispace.blocks.noise import stream
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.levels import CERTAIN, CHANCE
from drake_ispace.explain.predict.filters import CORRELATION_S
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.predict.room_view import SIGHTING
from drake_ispace.explain.predict.tracks import Track, coarsest_count
from drake_ispace.explain.prove.errors.free_run import (
    HORIZONS_S,
    PREDICTION,
    RPE,
    STEP,
    WHEELS,
    Errors,
    Measure,
    Simulated,
    Windows,
    changes,
    compare,
    errors,
    horizon_of,
    measures_of,
    rms,
    start_of,
)
from drake_ispace.explain.prove.errors.paths import chained, compose, relative
from drake_ispace.explain.prove.noise.counting import Recounting
from drake_ispace.explain.prove.noise.fix_noise import at_rest, on_the_move
from drake_ispace.explain.threads import each
from drake_ispace.robots.robot import COMMAND
from drake_ispace.room.localizer import Localizer, camera_of, see
from drake_ispace.scenario import Scenario

DRAWS = 4  # of noise, for each run
INDEPENDENT = 2.0 / 3.0  # share of relative errors over windows end to end, which share a fix
_DRIVE_S = 0.5  # correlation time of a drive that leaves its command

SENSORS = "sensors"
FORCES = ("force 1", "force 2", "force 3")  # as slow as the filter assumes
WALKS = ("slip", "turn")
JOLTS = ("jolt 1", "jolt 2", "jolt 3")  # of the same spectral density, new at every tick


@dataclass(frozen=True)
class SensorNoise:
    """Noise of one sample.

    Attributes:
        of_fixes: (poses (k, 3), generator) -> (k, 3) errors of fixes there [m, m, rad]. outputs: (p,) standard
            deviations [rad, m/s^2, rad/s]. count_rad: of an encoder, 0 for an exact one.
    """

    of_fixes: Callable[[np.ndarray, np.random.Generator], np.ndarray]
    outputs: np.ndarray
    count_rad: float = 0.0


@dataclass(frozen=True)
class ProcessNoise:
    """Strengths of process noise.

    Attributes:
        needed: source -> strength that the runs need, in units of the robot's assumed noise. "force 1" to "force 3"
            and "jolt 1" to "jolt 3" are forces along the coordinates of the plant's ground force (where velocity is
            commanded: velocities along the axes of the body), "slip" and "turn" the random walk of place and heading.
        limits: source -> the largest plausible strength.
    """

    needed: dict[str, float]
    limits: dict[str, float]

    @property
    def plausible(self) -> dict[str, float]:
        """Source -> strength that is needed, or the largest plausible one if that is less."""
        return {name: min(strength, self.limits[name]) for name, strength in self.needed.items()}

    @property
    def tolerated(self) -> dict[str, float]:
        """Source -> strength that a sound robot may have: the plausible one, and of slip, which is rare, at least the
        assumed one."""
        return {name: max(size, 1.0) if name in WALKS else size for name, size in self.plausible.items()}


def sensor_noise(scenario: Scenario, prediction: Prediction, seed: int) -> SensorNoise:
    """The noise of the camera, the encoders and the IMU; seed: of the draws by which a camera's pixels are judged."""
    settings, localizer = getattr(scenario, prediction.replay.body.name), scenario.space.localizer
    said = 2.0 * np.pi / settings.encoder.counts_per_turn if settings.encoder.counts_per_turn else 0.0
    count = max(said, coarsest_count(prediction.tracks))
    outputs = [count / np.sqrt(12.0)] * prediction.replay.body.wheels
    if prediction.replay.body.robot.has_imu:
        imu = settings.imu
        outputs += [d / np.sqrt(TICK_S) for d in [imu.accelerometer_noise_density] * 3 + [imu.gyro_noise_density] * 3]
    return SensorNoise(_noise_of_fixes(localizer, prediction, seed), np.array(outputs), count)


def _noise_of_fixes(localizer, prediction, seed):
    """`of_fixes` of a SensorNoise: as stated, unless fixes at rest show otherwise, or those on the move less."""
    body, tracks, stated = prediction.replay.body, prediction.tracks, partial(_pixels, localizer)
    if not any(len(track.seen) for track in tracks):
        return stated
    poses = np.vstack([track.poses for track in tracks])
    by_pixels = np.sqrt(np.mean(stated(poses, np.random.default_rng(seed)) ** 2, axis=0))
    resting, most = at_rest(tracks, body.wheels), on_the_move(tracks, body.plant.geometry, by_pixels)
    shown = np.minimum(by_pixels, most)
    if resting is not None:
        least, likely, most = resting
        shown = np.where(least > by_pixels, likely, np.minimum(shown, most))
    return partial(_independent, shown) if (shown != by_pixels).any() else stated


def _pixels(localizer: Localizer, poses: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """(k, 3) errors of fixes by the camera's pixels. Where whole ones lie is drawn: a robot at rest repeats its error.
    """
    shift = np.array([*generator.uniform(0.0, 1.0, 2) * localizer.pixel_m, 0.0])
    camera = camera_of(replace(localizer, dropout=0.0), np.inf, np.inf)
    numbers, noise = np.array(list(camera.values())), stream(int(generator.integers(2**31)), "fixes")
    out = np.zeros((len(poses), len(FIX)))
    for tick, (x, y, phi) in enumerate(poses + shift):
        see(tick, 0, x, y, phi, numbers, noise, out[tick])
    errors = out[:, [FIX.x, FIX.y, FIX.phi]] - poses - shift
    errors[:, 2] = wrap(errors[:, 2])
    return errors


def _independent(std: np.ndarray, poses: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """(k, 3) errors of fixes that are independent of each other, standard deviations (3,)."""
    return generator.standard_normal(poses.shape) * std


#: For each run Measure -> (k, d) changes of errors by noise, all draws pooled.
Spread = list[Errors]


class Spreads:
    """How far errors spread under noise that is added to the runs anew.

    Args:
        prediction: model and runs. windows: of each run. values: effects in the model, of each run. unperturbed:
            simulation of each run. noise: of the sensors. seed: of the draws.

    Attributes:
        errors: of each run, unperturbed.
    """

    def __init__(
        self, prediction: Prediction, windows: Sequence[Windows], values: Sequence[Values],
        unperturbed: Sequence[Simulated], noise: SensorNoise, seed: int,
    ):
        self._prediction, self._windows, self._values, self._noise = prediction, windows, values, noise
        self._unperturbed, self._seed, self._recounting = unperturbed, seed, None
        body, count = prediction.replay.body, noise.count_rad
        if body.robot.driven == COMMAND and "encoder" in prediction.replay.feeds and count:
            self._recounting = [Recounting(track, body.wheels, count) for track in prediction.tracks]
        self.errors = [
            compare(prediction, *run) for run in zip(prediction.tracks, windows, unperturbed, strict=True)
        ]

    def of_sensors(self) -> Spread:
        """The spread under sensor noise."""
        return self._spread(self._with_sensor_noise, SENSORS)

    def of_process(self) -> dict[str, Spread]:
        """Source -> spread under the robot's assumed process noise from this source alone."""
        replay, tracks, sources = self._prediction.replay, self._prediction.tracks, {}
        robot = replay.body.robot
        if "encoder" in replay.feeds and robot.unknown_forces is not None:
            for axis in np.flatnonzero(robot.unknown_forces):
                for source, correlation_s in ((FORCES[axis], CORRELATION_S), (JOLTS[axis], 0.0)):
                    sources[source] = lambda i, g, axis=axis, correlation_s=correlation_s: replay.pushed(
                        tracks[i], self._forces(tracks[i], axis, correlation_s, g)
                    )
        if {"encoder", "kinect"} <= replay.feeds:
            sources["slip"] = lambda i, g: self._walked(tracks[i], np.array([1.0, 1.0, 0.0]), g)
            sources["turn"] = lambda i, g: self._walked(tracks[i], np.array([0.0, 0.0, 1.0]), g)
        return {source: self._spread(perturbed, source) for source, perturbed in sources.items()}

    def _spread(self, perturbed, source):
        jobs = [(i, draw) for i in range(len(self._windows)) for draw in range(DRAWS)]
        key = sum(map(ord, str(source)))

        def one(job):
            i, draw = job
            track, windows = perturbed(i, np.random.default_rng([self._seed, key, i, draw])), self._windows[i]
            if source in WALKS:  # other fixes do not move the model
                again = compare(self._prediction, track, windows, self._unperturbed[i])
            else:
                tracks = [*self._prediction.tracks]
                tracks[i] = track
                moved = replace(self._prediction, tracks=tracks)
                if source == SENSORS:  # the start is estimated from noisy fixes
                    windows = replace(windows, start=start_of(moved, i, self._values[i]))
                again = errors(moved, i, windows, self._values[i])
            return changes(self.errors[i], again)

        differences: Spread = [{} for _ in self._windows]
        for (i, _), change in zip(jobs, each(one, jobs), strict=True):
            for measure, part in change.items():
                known = differences[i].get(measure)
                differences[i][measure] = part if known is None else np.vstack([known, part])
        return differences

    def _with_sensor_noise(self, i: int, generator) -> Track:
        track, replay = self._prediction.tracks[i], self._prediction.replay
        recorded, wheels = track.measured, replay.body.wheels
        if self._recounting:
            track = self._recounting[i].drawn(generator)
            measured = track.measured.copy()
        else:
            measured = recorded + generator.standard_normal(recorded.shape) * self._noise.outputs
        for name, values in self._values[i].items():
            measured[:, :wheels] += replay.effects[name].scattered(
                recorded[:, :wheels], values, self._noise.count_rad, generator
            ) - recorded[:, :wheels]
        sightings = track.sightings.copy()
        if len(track.fix_rows):
            first, *reckoned = self._unperturbed[i].reckoned  # which has no pixels of its own
            path = compose(self._windows[i].start, relative(first, np.array(reckoned)))
            sightings[track.fix_rows, SIGHTING.x : SIGHTING.phi + 1] += self._noise.of_fixes(path, generator)
        return replace(track, measured=measured, sightings=sightings)

    def _forces(self, track, axis, correlation_s, generator):
        """(rows, 3) force along one coordinate; correlation_s: 0 for a new force at every tick."""
        robot = self._prediction.replay.body.robot
        force, size = np.zeros((len(track.command), 3)), robot.unknown_forces[axis]
        if robot.driven == COMMAND:  # the drive's acceleration leaves its command, and is called back
            size *= np.sqrt(CORRELATION_S * _DRIVE_S)
            correlation_s = _DRIVE_S if correlation_s else 0.0
        keep = np.exp(-TICK_S / correlation_s) if correlation_s else 0.0
        size *= 1.0 if correlation_s else np.sqrt(2.0 * CORRELATION_S / TICK_S)
        white = generator.standard_normal(len(force)) * np.sqrt(1.0 - keep**2)
        force[:, axis] = size * lfilter([1.0], [1.0, -keep], white)
        return force

    def _walked(self, track, which, generator):
        """The run with a random walk of the place, along the axes in `which` (3,), in the camera's fixes."""
        if len(track.fix_t) < 2:
            return track
        size, poses = np.array(self._prediction.replay.body.robot.unknown_slip)[[0, 0, 1]] * which, track.poses
        steps = relative(poses[:-1], poses[1:])
        way = np.hypot(steps[:, 0], steps[:, 1])
        noise = generator.standard_normal((len(steps), 3)) * np.sqrt(way)[:, None] * size
        sightings = track.sightings.copy()
        sightings[track.fix_rows, SIGHTING.x : SIGHTING.phi + 1] = chained(poses[0], steps + noise)
        return replace(track, sightings=sightings)


def process_noise(
    prediction: Prediction, horizon: str, after: Sequence[Errors], sensors: Spread, unit: Mapping[str, Spread],
) -> ProcessNoise:
    """The strengths that errors need beyond sensor noise.

    Those of the forces follow from the covariances of all wheels and rates at the next sample and at the shortest
    horizon of the windows, those of slip from dead reckoning over 1 s. A drive leaves the commanded velocity by no more
    than free runs on it show, over 1 s and from there to 5 s, nor by more than most of them do: a wheel that does not
    turn as told for a few seconds is no noise.

    Args:
        horizon: name of the shortest horizon. after: errors of each run. sensors: spread under sensor noise. unit:
            source -> spread under the robot's assumed process noise.

    Raises:
        LinAlgError: the model runs away from the runs.
    """
    needed, robot = {}, prediction.replay.body.robot
    pooled, noise = pooled_of(after), pooled_of(sensors)
    parts_of = {source: pooled_of(spread) for source, spread in unit.items()}
    for source, channel, unit_of in (("slip", "position", "m"), ("turn", "heading", "rad")):
        if source in unit and (strengths := _walk(pooled, noise, parts_of[source], channel, unit_of, WHEELS)):
            shortest = Measure(RPE, horizon_of(HORIZONS_S[0]), channel, unit_of, WHEELS)
            needed[source] = min([*strengths, _most(shortest, pooled, noise, parts_of[source], robot.most_slip)])
    forces = [source for source in (*FORCES, *JOLTS) if source in unit]
    blocks = [_shown(pooled, name) for name in (STEP, horizon)]
    if forces and all(blocks):
        columns = []
        for measures in blocks:
            of_noise = _covariance(noise, measures)
            parts = [_covariance(parts_of[source], measures) for source in forces]
            scale = 1.0 / np.sqrt(np.diag(of_noise + sum(parts)))
            found = _covariance(pooled, measures)
            if robot.driven == COMMAND:  # free runs on the command say how strong it is at most
                found[np.diag_indices_from(found)] *= 1.0 + _by_chance(pooled[measures[0]])
            extra = found - of_noise
            columns.append([(part * np.outer(scale, scale)).ravel() for part in (extra, *parts)])
        extra, *parts = (np.concatenate(column) for column in zip(*columns, strict=True))
        if not np.isfinite([extra, *parts]).all():
            raise np.linalg.LinAlgError("the model runs away")
        strengths = np.sqrt(nnls(np.column_stack(parts), extra)[0])
        needed |= dict(zip(forces, map(float, strengths), strict=True))
        if robot.driven == COMMAND:  # noise that free runs on the command do not show is none
            for source in forces:
                of = ("heading", "rad") if source in (FORCES[2], JOLTS[2]) else ("position", "m")
                shortest = Measure(RPE, horizon_of(HORIZONS_S[0]), *of, COMMAND)
                most = _most(shortest, pooled, noise, parts_of[source], robot.most_unknown)
                needed[source] = min([needed[source], *_walk(pooled, noise, parts_of[source], *of, COMMAND), most])
    limits = {source: robot.most_slip if source in WALKS else robot.most_unknown for source in needed}
    return ProcessNoise(needed, limits)


def pooled_of(runs: Sequence[Errors]) -> Errors:
    """Measure -> (k, d) errors of all runs."""
    return {m: np.vstack([run[m] for run in runs if m in run]) for m in measures_of(runs)}


def _walk(pooled, noise, walk, channel, unit, driven_by) -> list[float]:
    """Strengths of a random walk: by the errors of free runs over 1 s, and by their growth from 1 s to 5 s.

    Errors that do not grow are no walk, and errors that are small over 1 s are no strong one; under command each may be
    larger than it looks, by chance.
    """
    known = [m for m in (Measure(RPE, horizon_of(s), channel, unit, driven_by) for s in HORIZONS_S) if m in pooled]
    may_be = [_by_chance(pooled[m]) if driven_by == COMMAND else 0.0 for m in known]
    extra = [rms([pooled[m]]) ** 2 * (1.0 + more) - rms([noise[m]]) ** 2 for m, more in zip(known, may_be, strict=True)]
    squares = [rms([walk[m]]) ** 2 for m in known]
    pairs = zip([extra[:1], np.diff(extra)], [squares[:1], np.diff(squares)], strict=True) if known else ()
    return [
        float(np.sqrt(max(e[0], 0.0) / max(w[0], 1e-300))) for e, w in pairs if len(e) and w[0] > 0.0
    ]


def _by_chance(errors: np.ndarray) -> float:
    """By which share the mean square of errors (k, d) may be too small by chance, of errors that are Gaussian noise."""
    return CERTAIN * float(np.sqrt(2.0 / (INDEPENDENT * errors.size)))


def _most(m: Measure, pooled: Errors, noise: Errors, unit: Errors, limit: float) -> float:
    """The largest strength that most errors of a measure allow; infinite where it is not known of all."""
    known = [errors[m] for errors in (pooled, noise, unit) if m in errors]
    return most_of_most_errors(*known, limit) if len(known) == 3 else np.inf


def most_of_most_errors(found: np.ndarray, noise: np.ndarray, walk: np.ndarray, limit: float) -> float:
    """The largest strength of a random walk that most errors allow; infinite where they allow the limit.

    Half of the errors that a walk and noise make together are smaller than their median. A strength at which more of
    those that were found are smaller than chance allows is that of a few large ones, which are no walk.

    found: (k, d) errors. noise, walk: (draws * k, d) of sensors, and of a walk of strength 1. limit: largest strength
    that is looked for.
    """
    count = int(len(found) * INDEPENDENT)
    smaller = int(binom.isf(CHANCE, count, 0.5))  # at most by chance
    if noise.shape != walk.shape or smaller >= count:
        return np.inf
    highest = np.quantile(np.sum(found**2, axis=1), smaller / count)

    def beyond(strength):
        return np.median(np.sum((noise + strength * walk) ** 2, axis=1)) - highest

    if beyond(0.0) >= 0.0:
        return 0.0
    return brentq(beyond, 0.0, limit, rtol=1e-3) if beyond(limit) > 0.0 else np.inf


def _shown(pooled, horizon):
    """The wheels and rates that show forces; an accelerometer shows them through the tilt as well, which drifts."""
    return [
        m for m in sorted(pooled) if (m.metric, m.horizon) == (PREDICTION, horizon)
        and not m.channel.startswith("imu: a")
    ]


def _covariance(errors, measures):
    """(k, k) mean products of the errors of these measures, constants included."""
    rows = np.column_stack([errors[m][:, 0] for m in measures])
    return rows.T @ rows / len(rows)
