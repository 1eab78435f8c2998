"""The verdict: whether the named effects suffice."""

import math
from collections.abc import Callable, Sequence
from operator import attrgetter

from drake_ispace.explain.answer.describe import named_or_set, with_sizes
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.sentences import over, p_in_words
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.each_part import OfAPart
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.fit.candidates import Candidate, coordinate, tolerance_of
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.prove.errors.free_run import ATE, RPE, RUN, WHEELS
from drake_ispace.explain.prove.errors.gap import HELD_OUT, TRAINING, GapRow
from drake_ispace.explain.prove.left.adequacy import TOO_LARGE
from drake_ispace.explain.prove.left.remainder import amount
from drake_ispace.explain.prove.noise.noise import FORCES, JOLTS, ProcessNoise
from drake_ispace.explain.prove.proof import Proof
from drake_ispace.robots.robot import COMMAND, Robot

#: Why effects make no sense.
UNCONFIRMED = "with it free runs of unseen data come no nearer"
RULED_OUT = "unseen runs are likelier without it"
_ASTRAY = "unseen runs are led further away by it"
_SEVERAL = 3.0  # times what sensors leave
#: What drives a simulation -> measures by which it is told to be astray by chance, and what may lead it there.
_CHANCE = {WHEELS: ((ATE, RPE), "slip at random"), COMMAND: ((RPE,), "a drive that errs at random")}


def add_proof(answer: Explanation, case: Case, proof: Proof) -> None:
    """Add the gap and what is left of it to the answer, and correct the verdict by them."""
    answer.gap, answer.proof, answer.remainders, answer.plant = proof.rows, proof.by, proof.remainders, proof.plant
    answer.noise_is_fitted = proof.noise is not None
    if proof.noise is not None:
        answer.forces = _forces(case.replay.body.robot, proof.noise)
    if proof.least_squares is not None:
        answer.effects = with_sizes(answer.effects, case, proof.sizes, proof.least_squares, proof.without)
    if proof.alone:
        answer.warnings.append(
            f"{', '.join(proof.alone)}: only there some of the sizes show, and nothing else confirms them"
        )
    moved, moves_as_told = (_moves_as_told(proof.rows, attrgetter(which)) for which in ("before", "after"))
    if answer.verdict == "incomplete" and moves_as_told and not moved:  # beside the effects something is detectable
        answer.verdict = named_or_set(answer.effects)
    why = list(doubtful(answer, case, proof).values()) if proof.sizes else []
    if proof.sizes and case.scenario is None and (away := led_away(proof.rows)):
        why.append(away)
    _judge(answer, [f"{text}: what was detected is something else" for text in why])
    if answer.unknown is not None and moves_as_told and not answer.remainders:
        what = f"a {answer.unknown.link} that goes with {answer.unknown.driver} is detectable"
        answer.warnings.append(f"{what}, but on unseen runs the model without it is as good as the sensors")
        answer.verdict, answer.unknown = "none", None


def led_away(rows: Sequence[GapRow]) -> str:
    """In words, whether all whole runs of a user's own plant, seen and unseen, are off by more; empty if not.

    However far unknown torques may lead by chance: no sizes of the effects were found with which a run comes nearer.
    """
    whole = [row for row in rows if (row.metric, row.horizon) == (ATE, RUN) and row.unit != "1"]
    if {row.runs for row in whole} != {HELD_OUT, TRAINING}:
        return ""
    said = [[amount(error, row.unit) for error in (row.before, min(row.after, row.least_squares))] for row in whole]
    nearer = any(min(row.after, row.least_squares) <= row.before for row in whole)
    if nearer or any(before == after for before, after in said):
        return ""
    before, after = next(both for row, both in zip(whole, said, strict=True) if row.runs == HELD_OUT)
    return f"whole runs come no nearer with it, unseen ones are off by {after} instead of {before}"


def _moves_as_told(rows: Sequence[GapRow], error: Callable[[GapRow], float]) -> bool:
    """Whether free runs on the command, and dead reckoning, are off by no more than sensors leave, on unseen runs.

    What else is detectable then does not matter. Noise of the process does not count: of a drive that does otherwise
    than told it would be as large as whatever is wrong. That is of some seconds; over whole runs wheels slip.

    error: of a row, the one before or after.
    """
    unseen = [row for row in rows if row.runs == HELD_OUT and row.metric == RPE]
    return any(row.driven_by == COMMAND for row in unseen) and all(
        row.sensors is not None and error(row) <= TOO_LARGE[RPE] * row.sensors for row in unseen
    )


def doubtful(answer: Explanation, case: Case, proof: Proof) -> dict[str, str]:
    """Named effects that may be something else -> why.

    They have sizes that a sound robot may have, or that may be none, or the proof does not confirm them. Of a user's
    own plant the second alone is asked here: what unseen runs rule out takes other answers along.
    """
    is_own = case.scenario is None
    scales, why = scales_of(case.prediction), {}
    for effect in answer.effects:
        of_library, known = case.replay.effects[effect.name], case.replay.known.get(effect.name, {})
        parameters = of_library.parameters_of(case.replay.body)
        if not is_own and _is_trifle(effect, parameters, scales):
            why[effect.name] = f"{effect.name} is no larger than in a sound robot"
        elif _may_be_none(effect, parameters, known, is_own or of_library.kinematic):
            why[effect.name] = f"the size of {effect.name} may be none"
        elif not is_own and effect.name in proof.unconfirmed:
            why[effect.name] = f"{effect.name}: {UNCONFIRMED}"
    return why


def _is_trifle(effect, parameters, scales) -> bool:
    """Whether all sizes of an effect that have a tolerance are within it."""
    shares = [
        abs(coordinate(p, effect.parameters[p.name].estimate) - coordinate(p, p.neutral))
        / tolerance_of(p, scales) for p in parameters if p.tolerance
    ]
    return bool(shares) and max(shares) <= 1.0


def _may_be_none(effect, parameters, known, shows_in_path) -> bool:
    """Whether the interval of every size of an effect holds the model's own.

    known: name -> of these. shows_in_path: whether the path tells the sizes, so that those of plain least squares are
    part of the intervals.
    """
    for p in (p for p in parameters if not p.shape):
        size, value = effect.parameters[p.name], known.get(p.name, p.neutral)
        ends = (*size.ci90, size.least_squares) if shows_in_path and size.least_squares is not None else size.ci90
        if not min(ends) <= value <= max(ends):
            return False
    return True


def _judge(answer: Explanation, doubts: list[str]) -> None:
    """Correct the verdict.

    Effects that do not suffice make it "incomplete", and so does one at a size that makes no sense, or that is
    doubtful (`doubts`: why), that is not the same in every run, or that makes a channel of unseen runs worse. A
    model that lacks nothing known but leaves more than noise makes it "unknown".
    """
    beyond = [
        f"{_size(f'{name} of {effect.name} is', p.estimate, p.unit)}, which is on a bound or beyond what makes sense"
        for effect in answer.effects for name, p in effect.parameters.items() if p.on_bound
    ]
    worse = [] if not answer.effects else [
        f"{row.channel} ({row.driven_by}, {row.horizon}) got worse on unseen runs: {row.before:.3g} -> {row.after:.3g} "
        f"{row.unit}" for row in made_worse(answer.gap)
    ]
    answer.warnings = beyond + doubts + worse + answer.warnings
    if answer.verdict in ("named", "set") and (beyond or doubts or worse or answer.drifts or answer.remainders):
        answer.verdict = "incomplete"
    elif answer.verdict == "none" and answer.remainders:
        answer.verdict = "unknown"


def nonsense(answer: Explanation) -> tuple[set[str], str]:
    """Named effects that unseen runs speak against, and why, in words.

    All of them if places or headings are clearly further off with them, and nothing that was clearly off is nearer.
    Else those at sizes that make no sense, if with the answer the robot ends a run clearly further from where it was,
    or if these are all of several, and more than noise is left. One alone may be larger than was thought possible.
    """
    worse = {row.metric for row in made_worse(answer.gap)}
    was_off = [row for row in answer.gap if row.runs == HELD_OUT and row.closed is not None]
    if worse & {ATE, RPE} and not any(row.after < row.before for row in was_off):
        return {effect.name for effect in answer.effects}, _ASTRAY
    senseless = {effect.name for effect in answer.effects if any(p.on_bound for p in effect.parameters.values())}
    patched = answer.remainders and len(senseless) == len(answer.effects) > 1
    why = _ASTRAY if worse & {ATE, RPE} else "no size of it is plausible"
    return senseless if ATE in worse or patched else set(), why


def lacks_little(answer: Explanation, decision: Decision) -> bool:
    """Whether an answer is incomplete only because of a disagreement that shows less than each of its effects."""
    if decision.left_over is None or decision.left_over.gain >= min(decision.gains.values(), default=0.0):
        return False
    on_bound = any(p.on_bound for effect in answer.effects for p in effect.parameters.values())
    return not (on_bound or answer.remainders or answer.drifts or made_worse(answer.gap))


def _forces(robot: Robot, noise: ProcessNoise) -> str:
    """In words: forces from outside that pass as noise, of a robot that torque drives; empty where none needs to be
    clearly stronger than assumed."""
    if robot.driven == COMMAND or None in (robot.unknown_forces, robot.ground):
        return ""
    found = []
    for slow, quick, size, unit in zip(FORCES, JOLTS, robot.unknown_forces, robot.ground.units, strict=True):
        strength = math.hypot(noise.needed.get(slow, 0.0), noise.needed.get(quick, 0.0))
        if strength > TOO_LARGE[RPE]:
            found.append((amount(strength * size, unit), amount(size, unit)))
    if not found:
        return ""
    needed, assumed = (" and ".join(amounts) for amounts in zip(*found, strict=True))
    return f"forces from outside of {needed} pass as noise, where {assumed} are assumed"


def add_chance(answer: Explanation) -> None:
    """Say of an answer that suffices where places are off by several times what sensors leave.

    Of a model that lacks nothing, say as well how strong the forces are that pass as noise.
    """
    if answer.verdict not in ("none", "named", "set"):
        return
    for driven_by, (metrics, cause) in _CHANCE.items():
        off = [
            row for row in answer.gap if row.metric in metrics and row.channel == "position"
            and row.driven_by == driven_by and row.sensors and row.after > _SEVERAL * row.sensors
        ]
        if off:
            worst = max(off, key=lambda row: (row.runs == HELD_OUT, row.after / row.sensors))
            answer.warnings.append(
                f"{worst.channel} ({driven_by}) is {'still ' if answer.effects else ''}off by "
                f"{amount(worst.after, worst.unit)} {over(worst.horizon)}, and sensors leave "
                f"{amount(worst.sensors, worst.unit)}: the rest passes as chance, such as {cause}"
            )
    if answer.verdict == "none" and answer.forces:
        answer.warnings.append(f"{answer.forces}: something that comes and goes may be among them")


def add_trace(answer: Explanation, doubted: Explanation) -> None:
    """Say in an answer which effects it does not name were barely detectable; doubted: the answer that named them."""
    answer.warnings.append(
        f"there may be a trace of {_sizes_beside(answer, doubted)}, but on unseen runs the model without it is as good "
        "as noise allows"
    )


def left_out(answer: Explanation, before: Explanation, why: str) -> str:
    """A sentence on the effects that an answer no longer names, and why; before: it did."""
    most = "explains some" if answer.effects else "explains most"
    return f"{_sizes_beside(answer, before)} {most} from one sample to the next, but {why}"


def _sizes_beside(answer, other) -> str:
    """In words: effects and their sizes that an answer does not name, but the other one."""
    kept = {effect.name for effect in answer.effects}
    return ", ".join(
        f"{effect.name} ({', '.join(_size(name, p.estimate, p.unit) for name, p in effect.parameters.items())})"
        for effect in other.effects if effect.name not in kept
    )


def add_parts(answer: Explanation, found: Sequence[OfAPart]) -> None:
    """Say which parts of the runs show an effect that the rest contradicts, or at another size.

    An answer for all does not suffice then.
    """
    groups = _alike(found)
    several = [parts for parts in groups if any(one.sizes for one in parts)]
    answer.drifts += [_at_different_sizes(parts) for parts in several]
    for one in (one for parts in groups if parts not in several for one in parts):
        values = one.candidate.values(one.z)
        sizes = ", ".join(_size(p.name, values[p.name], p.unit) for p in one.candidate.parameters)
        alike = "".join(f" or {other.label}" for other in one.alike)
        rest = "other runs contradict it: explain it by itself"
        if one.is_half:
            rest = "the other half contradicts it: it begins, ends or changes on the way, or the motion there differs"
        answer.drifts.append(
            f"{one.part} by itself is explained best by {one.candidate.label} ({sizes}; {p_in_words(one.p_value)})"
            f"{alike}, and {rest}"
        )
    if found:
        answer.verdict = "incomplete" if answer.effects else "unknown"


def _alike(found: Sequence[OfAPart]) -> list[list[OfAPart]]:
    """The parts in groups, of which each shows what looks like that of another one."""
    groups: list[tuple[set[Candidate], list[OfAPart]]] = []
    for one in found:
        names, parts = {one.candidate, *one.alike}, [one]
        for near in [group for group in groups if group[0] & names]:
            groups.remove(near)
            names, parts = near[0] | names, near[1] + parts
        groups.append((names, parts))
    return [parts for _, parts in groups]


def _at_different_sizes(found: Sequence[OfAPart]) -> str:
    """A sentence on what several runs show at different sizes; found: the runs that are told for it, of names alike."""
    one = next(part for part in found if part.sizes)
    p_values = {part.part: f"; {p_in_words(part.p_value)}" for part in found}

    def in_part(size):
        how = _size(size.parameter.name, size.value, size.parameter.unit)
        return f"{size.part} ({how}{p_values.get(size.part, '')})"

    clear = [size for size in one.sizes if size.is_clear or size.part in p_values]
    names = [name.label for part in [one, *found] for name in (part.candidate, *part.alike)]
    said = f"{' or '.join(dict.fromkeys(names))} shows in {' and '.join(map(in_part, clear))}"
    if others := [size for size in one.sizes if size not in clear]:
        said += f", not for certain in {' and '.join(map(in_part, others))}"
    return f"{said}: its size differs from run to run, something else goes with it"


def _size(name, value, unit):
    return f"{name} {value:.3g}{'' if unit in ('1', 'wheel') else f' {unit}'}"


def made_worse(rows: Sequence[GapRow]) -> list[GapRow]:
    """Rows of unseen runs whose squared error clearly grew, by more than sensors and chance leave."""
    return [row for row in rows if row.runs == HELD_OUT and row.worse]
