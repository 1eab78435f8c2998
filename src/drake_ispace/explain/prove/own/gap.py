"""The gap of a user's own plant: free-run simulations of whole runs on the recorded torque."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.stats import chi2

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.runs import UNNAMED
from drake_ispace.explain.decide.decide import MOST_EFFECTS
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.decide.validate import Choice
from drake_ispace.explain.fit.free_run import Sizes, channel_of, errors, fitted, measured, shifts_of, unit_of
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.case import Case, part_of
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import ATE, RUN, Errors, Measure, rms
from drake_ispace.explain.prove.errors.gap import HELD_OUT, TRAINING, Columns, rows_of
from drake_ispace.explain.prove.left.adequacy import too_large
from drake_ispace.explain.prove.noise.noise import DRAWS
from drake_ispace.explain.prove.own.ahead import Ahead
from drake_ispace.explain.prove.own.asked import asked_for_own
from drake_ispace.explain.prove.own.instead import preferred_by_runs
from drake_ispace.explain.prove.own.sizes import leads_nearer, pushed
from drake_ispace.explain.prove.proof import PlantParameter, Proof
from drake_ispace.explain.threads import each

_JUDGING_DRAWS = 200  # of unknown torques, by which an answer is judged: what they leave is then known to a tenth


def prove_own(case: Case, decision: Decision | Choice, seed: int) -> Proof:
    """Measure the gap.

    Where the plant has free parameters they are fitted without any effect for the column "before".

    seed: of the draws of noise and of the bootstrap.
    """
    base, answer, plain = _sizes(case, decision)
    if isinstance(decision, Decision) and answer.point and leads_nearer(case.prediction, decision, answer, plain, seed):
        answer = plain
    parts = [
        (HELD_OUT, "" if kind == UNNAMED else kind, part_of(case.held_out, runs)) for kind, runs in case.kinds.items()
    ]
    rows, left = [], []
    for runs, kind, part in [*parts, (TRAINING, "", case.prediction)]:
        columns = [_errors(case.replay, part.tracks, sizes) for sizes in (base, answer, plain)]
        is_judged = runs == HELD_OUT or not parts
        draws = _JUDGING_DRAWS if is_judged else DRAWS
        *noise, most = _noise(case.prediction, part.tracks, answer, columns[1], seed, draws)
        if case.is_filtered and Ahead.may_judge(case.replay):
            ahead = Ahead(part, answer.point)
            columns = [
                [{**run, **own} for run, own in zip(column, ahead.errors(sizes.point), strict=True)]
                for column, sizes in zip(columns, (base, answer, plain), strict=True)
            ]
            noise = [{**one, **own} for one, own in zip(noise, ahead.noise(seed), strict=True)]
        rows += rows_of(Columns(*columns[:2], columns[2] if answer.point else None, *noise), runs, kind, seed)
        if is_judged:
            left += too_large(columns[1], *noise, [track.name for track in part.tracks], most=most)
    plant = [PlantParameter(name, value, plain.plant[name]) for name, value in base.plant.items()]
    worst = sorted((r for r in left if r.unit != "1"), key=lambda remainder: -remainder.ratio)[:1]
    asked = instead = None
    if isinstance(decision, Decision) and decision.unknown is None:
        instead = partial(preferred_by_runs, case.prediction, decision)
        if len(answer.point) < MOST_EFFECTS:
            asked = partial(asked_for_own, case.prediction, decision, any(r.horizon == RUN for r in left))
    by = "held-out runs" if parts else ""
    shown = {c: [None] * len(z) if c in plain.held else z for c, z in plain.point.items()} or None
    return Proof(by, rows, worst, None, answer.point, shown, plant=plant, asked=asked, instead=instead)


def _sizes(case, decision) -> tuple[Sizes, Sizes, Sizes]:
    """Sizes of the model as given, of the answer, and of plain least squares."""
    if isinstance(decision, Choice):
        return decision.base, decision.sizes, decision.sizes
    tracks, point = case.prediction.tracks, {} if decision.named is None else decision.named.point
    base = fitted(case.replay, tracks, {})
    plain = fitted(case.replay, tracks, point, shifts_of(point)) if point else base
    return base, Sizes(point, plain.plant), plain


def _errors(replay, tracks, sizes: Sizes) -> list[Errors]:
    """Errors of each run, in the unit of what was logged and as a share of its root mean square over the runs."""
    channel, unit = channel_of(replay), unit_of(replay)
    absolute = Measure(ATE, RUN, channel, unit, "torque")
    relative = Measure(ATE, RUN, f"{channel}, relative", "1", "torque")
    size = max(rms([measured(replay, track) for track in tracks]), 1e-300)
    each = [errors(replay, track, merged(sizes.point), sizes.plant).reshape(-1, 1) for track in tracks]
    return [{absolute: run, relative: run / size} for run in each]


def _noise(
    prediction: Prediction, tracks: Sequence, sizes: Sizes, after: Sequence[Errors], seed: int, draws: int
) -> list[Mapping[Measure, float]]:
    """Errors that the encoder's noise, and unknown torques as strong as the model assumes, cause by themselves.

    Both are root mean squares; a third one is exceeded by these torques as rarely as a false alarm may be.
    """
    replay, (absolute, relative), values = prediction.replay, after[0], merged(sizes.point)

    def drawn(draw):
        return rms([
            errors(replay, pushed(replay, track, [seed, 4, i, draw]), values, sizes.plant).reshape(-1, 1)
            - after[i][absolute] for i, track in enumerate(tracks)
        ])

    squares = np.square(each(drawn, range(draws)))
    chance = float(np.mean(squares))
    freedom = 2.0 * chance**2 / max(float(np.var(squares)), 1e-300)  # of a chi square with their mean and variance
    most = np.sqrt(chance * chi2.isf(FALSE_ALARM_RATE, freedom) / freedom) if chance else 0.0
    std = replay.angle_std * (1.0 if replay.logged == "angle" else np.sqrt(2.0) / (2.0 * TICK_S))
    size = rms([after[0][absolute]]) / max(rms([after[0][relative]]), 1e-300)
    return [{absolute: one, relative: one / size} for one in (float(std), np.sqrt(chance), most)]
