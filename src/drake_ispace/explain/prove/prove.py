"""The proof of an answer: the gap on training and on unseen runs, and what is left there that is not noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from drake_ispace.explain.check.runs import UNNAMED
from drake_ispace.explain.decide.decision import Decision, Rival
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.case import Case, joined
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.prove.asked_for import asked_for
from drake_ispace.explain.prove.errors.free_run import Errors, Measure, Windows, errors, rms, simulate, windows_of
from drake_ispace.explain.prove.errors.gap import HELD_OUT, TRAINING, Columns, rows_of
from drake_ispace.explain.prove.errors.least_squares import FAR, PlainFit, fitted_horizons, plain_fit, scaled
from drake_ispace.explain.prove.errors.left_out import blocks_in, in_parts
from drake_ispace.explain.prove.left.adequacy import TOO_LARGE, remainders
from drake_ispace.explain.prove.left.remainder import NOTHING, Remainder
from drake_ispace.explain.prove.noise.noise import (
    ProcessNoise,
    SensorNoise,
    Spread,
    Spreads,
    pooled_of,
    process_noise,
    sensor_noise,
)
from drake_ispace.explain.prove.proof import Proof
from drake_ispace.explain.prove.sizes import (
    SizesByRun,
    filtered_sizes,
    leads_nearer,
    left_by_uncertainty,
)
from drake_ispace.explain.threads import each
from drake_ispace.robots.robot import TORQUE


@dataclass(frozen=True)
class _Judged:
    """Runs under the answer: of each run windows, effects, errors, and their changes by noise."""

    prediction: Prediction
    windows: list[Windows]
    values: list[Values]
    before: list[Errors]
    after: list[Errors]
    sensors: Spread
    process: dict[str, Spread]
    noise: ProcessNoise

    def part(
        self, runs: slice, strengths: Mapping[str, float] | None = None
    ) -> tuple[dict[Measure, float], dict[Measure, float]]:
        """Measure -> root mean square of what sensors, and what chance, leave of some of the runs.

        strengths: of process noise, default those that are needed and plausible.
        """
        sensors = {m: rms([e]) for m, e in pooled_of(self.sensors[runs]).items()}
        squares = dict.fromkeys(sensors, 0.0)
        for source, strength in (strengths or self.noise.plausible).items():
            for m, e in pooled_of(self.process[source][runs]).items():
                squares[m] += (strength * rms([e])) ** 2
        return sensors, {m: float(np.sqrt(square)) for m, square in squares.items()}

    def columns(self, runs: slice, plain: Point | None, after: Sequence[Errors] | None = None) -> Columns:
        """The columns of the gap of some of the runs; after: other errors than those of the runs' own sizes."""
        fitted = None if plain is None else [
            errors(self.prediction, i, self.windows[i], merged(plain)) for i in range(len(self.windows))[runs]
        ]
        after = self.after[runs] if after is None else after
        return Columns(self.before[runs], after, fitted, *self.part(runs), self._size_m(runs))

    def _size_m(self, runs: slice) -> float:
        """Root mean square distance of the fixes from the mean of their run [m]."""
        squares = [
            np.sum((track.poses[:, :2] - track.poses[:, :2].mean(axis=0)) ** 2, axis=1)
            for track in self.prediction.tracks[runs] if len(track.fix_t)
        ]
        return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else np.inf


def prove(case: Case, decision: Decision, seed: int) -> Proof:
    """Measure the gap, and test whether the answer suffices.

    seed: of the draws of noise and of the bootstrap.
    """
    training, n = case.prediction, len(case.prediction.tracks)
    sensors = sensor_noise(case.scenario, training, seed)
    blocks, by = blocks_in(training), "leave-one-run-out"
    left_out = in_parts(training)
    parts = len(left_out.tracks)
    kinds, every = {UNNAMED: slice(0, parts)}, left_out
    if n == 1:
        by = "blocks of the run"
    if parts == 1:  # too short to be cut
        kinds, by = {}, ""
    if case.held_out is not None:
        by, every = "held-out runs", joined(left_out, case.held_out)
        kinds = {kind: slice(parts + runs.start, parts + runs.stop) for kind, runs in case.kinds.items()}

    def judged_with(sizes):
        values = [merged(point) for point in (sizes.without if parts > 1 else [sizes.point])]
        return _judged(every, values + [merged(sizes.point)] * (len(every.tracks) - parts), sensors, seed)

    chosen = SizesByRun({}, [{}] * parts, []) if decision.named is None else filtered_sizes(decision, blocks)
    judged, alone, passed_over = judged_with(chosen), [], []
    if parts > 1 and chosen.point:
        unsure = each(lambda i: left_by_uncertainty(every, i, judged.windows[i], decision, chosen), range(parts))
        assumed = dict.fromkeys(judged.noise.needed, 1.0)
        alone = [i for i in range(parts) if _alone_tells(judged, i, unsure[i], assumed)]
        passed_over = [i for i in alone if _alone_tells(judged, i, unsure[i], judged.noise.plausible)]
    if alone:
        judged = judged_with(chosen.with_all(alone))
    fitted_to = judged if n > 1 else _judged(training, [merged(chosen.point)], sensors, seed)
    plain = fitted = None
    if chosen.point:
        noise, chance = fitted_to.part(slice(0, n))
        floors = {m: float(np.hypot(noise[m], chance[m])) for m in noise}
        fitted = plain_fit(training, fitted_to.windows[:n], chosen.point, decision.end.likelihood.sizes, floors)
        found = replace(chosen, point=fitted.point, without=fitted.without)  # taken for as certain as the filter's
        plain = found.point
        if leads_nearer(found, chosen, training, fitted_to.windows[:n], floors, passed_over):
            chosen = found
            fitted_to = judged = judged_with(chosen.with_all(alone))
        elif training.replay.body.robot.driven == TORQUE and n > 1 and _left(judged, training):
            other = judged_with(found.with_all(alone))
            if not _left(other, training):
                chosen, fitted_to, judged = found, other, other
    unconfirmed = [] if fitted is None else _unconfirmed(judged, [*kinds.values()], fitted, floors)
    rows = []
    for kind, runs in kinds.items():
        rows += rows_of(judged.columns(runs, plain), HELD_OUT, "" if kind == UNNAMED else kind, seed)
    after = [errors(training, i, fitted_to.windows[i], merged(chosen.point)) for i in range(n)]
    rows += rows_of(fitted_to.columns(slice(0, n), plain, after), TRAINING, "", seed)
    names = [left_out.tracks[i].name for i in alone] if case.held_out is None else []
    without = chosen.without if chosen.point and chosen.point is plain else ()
    left, asked, may_stand = _distinct(_left(judged, every)), None, None
    if fitted is not None:
        if left:
            asked = partial(asked_for, training, fitted_to.windows[:n], decision, fitted, floors, passed_over)
        else:
            sizes = decision.end.likelihood.sizes
            fit = partial(plain_fit, training, fitted_to.windows[:n], sizes=sizes, floors=floors)
            may_stand = partial(_may_stand, judged, fit)
    shown = fitted and fitted.shown
    return Proof(
        by, rows, left, judged.noise, chosen.point, shown, without, asked=asked, alone=names, may_stand=may_stand,
        unconfirmed=unconfirmed,
    )


def _unconfirmed(
    judged: _Judged, unseen: Sequence[slice], fitted: PlainFit, floors: Mapping[Measure, float]
) -> list[str]:
    """Names of effects that free runs show, and with which those of unseen runs come no nearer, the worst first.

    One that changes all their errors together by less than noise changes one is not shown. The others keep their sizes.

    unseen: which runs of `judged` are unseen. floors: as of `plain_fit`.
    """
    runs = [i for part in unseen for i in range(len(judged.values))[part]]

    def all_scaled(errors_of):
        parts = each(lambda i: scaled(errors_of(i), floors, fitted_horizons(judged.windows[i])), runs)
        return np.clip(np.concatenate([np.empty(0), *parts]), -FAR, FAR)

    def errors_without(name, i):
        windows, values = judged.windows[i], {n: sizes for n, sizes in judged.values[i].items() if n != name}
        return errors(judged.prediction, i, windows, values, fitted_horizons(windows))

    with_all, further = all_scaled(lambda i: judged.after[i]), {}
    for name in (candidate.name for candidate, z in fitted.shown.items() if any(value is not None for value in z)):
        without = all_scaled(partial(errors_without, name))
        if np.linalg.norm(without - with_all) >= 1.0:
            further[name] = float(np.sum(with_all**2) - np.sum(without**2))
    return sorted((name for name in further if further[name] >= 0.0), key=further.get, reverse=True)


def _may_stand(judged: _Judged, fit: Callable[[Point], PlainFit], rival: Rival) -> bool:
    """Whether a rival suffices as the answer in `judged` does, at sizes of the filter or of plain least squares.

    Both are fitted to all training runs: what is left is no lack of data. One that nobody fitted may stand.
    """
    if rival.point is None:
        return True
    return _suffices(judged, rival.point) or _suffices(judged, fit(rival.point).point)


def _suffices(judged: _Judged, point: Point) -> bool:
    """Whether these effects leave noise of a sound robot, too."""
    prediction, values = judged.prediction, [merged(point)] * len(judged.values)
    windows = each(lambda i: windows_of(prediction, i, values[i]), range(len(values)))
    after = each(lambda i: errors(prediction, i, windows[i], values[i]), range(len(values)))
    noise = process_noise(prediction, windows[0].shortest, after, judged.sensors, judged.process)
    other = replace(judged, windows=windows, values=values, after=after, noise=noise)
    return not _left(other, prediction)


def _alone_tells(judged: _Judged, i: int, unsure: Mapping[Measure, float], strengths: Mapping[str, float]) -> bool:
    """Whether run `i` alone tells sizes that it needs: without it the best answer could leave too large an error.

    unsure: measure -> what sizes leave that are as uncertain as without the run. strengths: of the process noise beside
    which that is too large.
    """
    sensors, chance = judged.part(slice(i, i + 1), strengths)
    return any(
        size > TOO_LARGE[m.metric] * np.hypot(sensors.get(m, np.inf), chance.get(m, 0.0)) for m, size in unsure.items()
    )


def _left(judged: _Judged, first: Prediction) -> list[Remainder]:
    """What the answer leaves that is not noise of a sound robot; first: of the first runs of `judged`, or of all."""
    runs = slice(0, len(first.tracks))
    assumed = judged.part(runs, dict.fromkeys(judged.noise.needed, 1.0))[1]
    noise_leaves = *judged.part(runs, judged.noise.tolerated), assumed
    return remainders(
        first, judged.windows[runs], judged.values[runs], judged.after[runs], judged.noise, *noise_leaves
    )


def _judged(prediction: Prediction, values: Sequence[Values], sensors: SensorNoise, seed: int) -> _Judged:
    windows = each(lambda i: windows_of(prediction, i, values[i]), range(len(values)))
    before = each(lambda i: errors(prediction, i, windows[i], {}), range(len(values)))
    simulated = each(lambda i: simulate(prediction, i, windows[i], values[i]), range(len(values)))
    spreads = Spreads(prediction, windows, values, simulated, sensors, seed)
    by_sensors, by_process = spreads.of_sensors(), spreads.of_process()
    noise = process_noise(prediction, windows[0].shortest, spreads.errors, by_sensors, by_process)
    return _Judged(prediction, windows, list(values), before, spreads.errors, by_sensors, by_process, noise)


def _distinct(left: list[Remainder]) -> list[Remainder]:
    """One Remainder for every channel: that which says with what it goes, or else the worst."""
    worst: dict[str, Remainder] = {}
    for remainder in sorted(left, key=lambda r: (r.driver == NOTHING, -r.ratio)):
        worst.setdefault(remainder.channel, remainder)
    return list(worst.values())
