"""The gap of a user's own plant: free-run simulations on the recorded torque, and predictions one read ahead."""

from functools import partial

from drake_ispace.explain.check.runs import UNNAMED
from drake_ispace.explain.decide.decide import MOST_EFFECTS
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.validate import Choice
from drake_ispace.explain.fit.free_run import Sizes, fitted, shifts_of
from drake_ispace.explain.predict.case import Case, part_of
from drake_ispace.explain.prove.errors.free_run import RUN
from drake_ispace.explain.prove.errors.gap import HELD_OUT, TRAINING, Columns, rows_of
from drake_ispace.explain.prove.left.adequacy import too_large
from drake_ispace.explain.prove.noise.noise import DRAWS
from drake_ispace.explain.prove.own.ahead import Ahead
from drake_ispace.explain.prove.own.asked import asked_for_own
from drake_ispace.explain.prove.own.instead import preferred_by_runs
from drake_ispace.explain.prove.own.runs import errors_of_runs, noise_of_runs
from drake_ispace.explain.prove.own.sizes import leads_nearer
from drake_ispace.explain.prove.own.unseen import ruled_out
from drake_ispace.explain.prove.proof import PlantParameter, Proof

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
        columns = [errors_of_runs(case.replay, part.tracks, sizes) for sizes in (base, answer, plain)]
        is_judged = runs == HELD_OUT or not parts
        draws = _JUDGING_DRAWS if is_judged else DRAWS
        *noise, most = noise_of_runs(case.replay, part.tracks, answer, columns[1], seed, draws)
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
    asked, instead, unconfirmed = None, None, []
    if parts and isinstance(decision, Decision) and answer.point:
        unconfirmed = ruled_out(case.held_out, decision.named.point)  # at the sizes that are likeliest read by read
    if isinstance(decision, Decision) and decision.unknown is None:
        instead = partial(preferred_by_runs, case.prediction, decision)
        if len(answer.point) < MOST_EFFECTS:
            asked = partial(asked_for_own, case.prediction, decision, any(r.horizon == RUN for r in left))
    by = "held-out runs" if parts else ""
    shown = {c: [None] * len(z) if c in plain.held else z for c, z in plain.point.items()} or None
    return Proof(
        by, rows, worst, None, answer.point, shown, plant=plant, asked=asked, unconfirmed=unconfirmed,
        instead=instead,
    )


def _sizes(case, decision) -> tuple[Sizes, Sizes, Sizes]:
    """Sizes of the model as given, of the answer, and of plain least squares."""
    if isinstance(decision, Choice):
        return decision.base, decision.sizes, decision.sizes
    tracks, point = case.prediction.tracks, {} if decision.named is None else decision.named.point
    base = fitted(case.replay, tracks, {})
    plain = fitted(case.replay, tracks, point, shifts_of(point)) if point else base
    return base, Sizes(point, plain.plant), plain
