"""How often `explain` is right: many recordings with a hidden effect, one record each, and a table of what was reached.

    PYTHONPATH=tests python -m hidden.campaign --out records.jsonl            # all of it, for hours
    PYTHONPATH=tests python -m hidden.campaign --out records.jsonl --robot omni --effects weak_motor --seeds 1
    PYTHONPATH=tests python -m hidden.campaign --out records.jsonl --table    # only the table

A case whose record is in the file is not run again, so it can be stopped at any time and called again.
"""

import argparse
import dataclasses
import itertools
import json
import sys
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtri_exp

from drake_ispace.effects.effect import Effect
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import survey
from drake_ispace.explain.explain import explain
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from hidden.effect_sizes import LARGEST_FACTOR, TYPICAL_UNKNOWN, effects_of, scaled, scaled_unknown
from hidden.effects_truth import ROBOTS
from hidden.generator import RobotLost, generate
from hidden.summary import print_summary

TRAINING = ("square", "circle", "eight", "back_and_forth")
HELD_OUT = ("spin", "square")
SECONDS = 20.0
FACTORS = (0.5, 0.25, 1.0, 0.1)
NOISES = (1.0, 0.3, 2.0)
_HELD_OUT_FROM = 50  # what is added to the seeds of held-out runs
_NULLS_PER_ROUND = 10


@dataclass(frozen=True)
class Case:
    """One diagnosis.

    Attributes:
        kind: "effect" of the library, "unknown" to it, or "none". name: of what is hidden, "none" for nothing.
        factor: size, of the typical one. noise: level of process noise.
    """

    robot: str
    kind: str
    name: str
    factor: float
    noise: float
    seed: int

    def recordings(self, motions: Sequence[str], seconds: float, first: int) -> list:
        """A run of each motion; `first` is added to their seeds."""
        effects = {self.name: scaled(self.name, self.robot, self.factor)} if self.kind == "effect" else {}
        unknown = scaled_unknown(self.name, self.robot, self.factor) if self.kind == "unknown" else None
        own = f"{self.kind}/{self.name}/{self.factor:g}/{self.noise:g}/{self.seed}"
        start = zlib.crc32(own.encode()) + first  # noise of its own for every case
        return [
            generate(self.robot, motion, effects, seconds, start + i, self.noise, unknown)
            for i, motion in enumerate(motions)
        ]

    @property
    def truth(self) -> dict[str, float]:
        """The hidden parameters."""
        return scaled(self.name, self.robot, self.factor) if self.kind == "effect" else {}


def diagnose(
    case: Case, motions: Sequence[str] = TRAINING, seconds: float = SECONDS, effects: Sequence[Effect] | None = None,
) -> dict:
    """The record of a case: what was hidden, what was said, and how far the parameters are off.

    effects: to try, default the whole library.
    """
    record = dataclasses.asdict(case) | {"truth": case.truth}
    started = time.perf_counter()
    try:
        runs, held_out = case.recordings(motions, seconds, 0), case.recordings(HELD_OUT, seconds, _HELD_OUT_FROM)
    except RobotLost as lost:
        return record | {"verdict": "lost", "error": str(lost)}
    generated = time.perf_counter() - started
    try:
        found = explain(f"{case.robot}_multirate", runs, held_out, effects, case.seed)
    except Exception as error:  # a campaign goes on; the table counts it
        return record | {"verdict": "error", "error": f"{type(error).__name__}: {error}"}
    return record | said(found, case.truth, case.name) | {"generated_s": round(generated, 2)}


def said(found: Explanation, truth: dict[str, float], name: str) -> dict:
    """What an Explanation says, and the errors of the parameters where the true name stands first."""
    own = next((effect for effect in found.effects if effect.name == name), None)
    unknown = None if found.unknown is None else {
        key: getattr(found.unknown, key) for key in ("link", "driver", "nearest", "distance", "share")
    }
    return {
        "verdict": found.verdict,
        "names": [effect.name for effect in found.effects],
        "equivalents": [effect.equivalents for effect in found.effects],
        "parameters": {} if own is None else {
            key: _against(p.estimate, p.ci90, truth[key]) for key, p in own.parameters.items()
            if key in truth and p.unit != "wheel"
        },
        "p_value": found.detection.p_value,
        "minus_log10_p": found.detection.minus_log10_p,
        "detectability": detectability(found.detection.minus_log10_p),
        "closed": found.closed,
        "headline": None if found.headline is None else dataclasses.asdict(found.headline),
        "left": [[r.channel, r.driver, r.ratio] for r in found.remainders],
        "unknown": unknown,
        "untestable": [entry.effect for entry in found.untestable],
        "warnings": [*found.drifts, *found.warnings],
        "seconds": round(found.seconds, 2),
    }


def _against(estimate, ci90, true):
    low, high = ci90
    return {
        "true": true, "estimate": estimate, "ci90": [low, high], "covers": bool(low <= true <= high),
        "error": abs(estimate - true) / abs(true) if true else None,
    }


def detectability(minus_log10_p: float) -> float:
    """The normal deviate with this -log10 p (two-sided), which estimates the root of the non-centrality of the leading
    effect in these runs."""
    return float(np.clip(-ndtri_exp(-minus_log10_p * np.log(10.0) - np.log(2.0)), 0.0, 100.0))


def cases(
    robots: Sequence[str] = ROBOTS, effects: Sequence[str] = (), factors: Sequence[float] = FACTORS, seeds: int = 3,
    nulls: int = 30, noises: Sequence[float] = NOISES, unknown_factors: Sequence[float] = (1.0, 0.5),
) -> list[Case]:
    """All cases, mixed, the first seed and the first size first: wherever one stops, all has been tried about as often.

    effects: default all of a robot's, unknown ones and "none" included. nulls: runs of nothing per noise and robot.
    """
    rounds = {}
    for robot, seed in itertools.product(robots, range(max(seeds, nulls))):
        if seed < seeds:
            for number, factor in enumerate(factors):
                rounds.setdefault((seed, number), []).extend(
                    _limited(Case(robot, "effect", name, factor, 1.0, seed)) for name in effects_of(robot)
                )
            for number, factor in enumerate(unknown_factors):
                rounds.setdefault((seed, number), []).extend(
                    Case(robot, "unknown", name, factor, 1.0, seed) for name in TYPICAL_UNKNOWN[robot]
                )
        if seed < nulls:
            nothing = [Case(robot, "none", "none", 0.0, noise, seed) for noise in noises]
            rounds.setdefault((seed // _NULLS_PER_ROUND, 0), []).extend(nothing)
    found = []
    for at in sorted(rounds):
        found += np.random.default_rng(at).permutation(np.array(rounds[at], dtype=object)).tolist()
    return [case for case in found if not effects or case.name in effects]


def _limited(case):
    """No larger than what a robot survives."""
    return dataclasses.replace(case, factor=min(case.factor, LARGEST_FACTOR[case.robot].get(case.name, 1.5)))


def load(path: Path) -> list[dict]:
    """The records of a file; a last line that was cut off is left out."""
    records = []
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return records


def likeness(robot: str) -> dict:
    """For every effect the one whose signature is most like its own, and their |cosine|, nuisances marginalised."""
    prepared = prepare(f"{robot}_multirate", Case(robot, "none", "none", 0.0, 1.0, 0).recordings(TRAINING, SECONDS, 0))
    screen = survey(prepared.prediction, {}, candidates(prepared.replay.effects, prepared.replay.body)).screen
    every, nearest = [c for c in screen.candidates if not isinstance(c.effect, Generic)], {}
    for one, other in itertools.permutations(every, 2):
        cosine = screen.alike(one, other)
        if one.name != other.name and cosine > nearest.get(one.name, ["", 0.0])[1]:
            nearest[one.name] = [other.name, cosine]
    return {"kind": "likeness", "robot": robot, "nearest": nearest}


def key(record: dict) -> tuple:
    """What makes a record that of a case."""
    return tuple(record.get(field.name) for field in dataclasses.fields(Case))


def run(wanted: Sequence[Case], path: Path, minutes: float | None = None) -> None:
    """Diagnose what has no record in `path` yet, a line each, until done, `minutes` are over, or Ctrl-C."""
    done = {key(record) for record in load(path)}
    left = [case for case in dict.fromkeys(wanted) if key(dataclasses.asdict(case)) not in done]
    end = time.monotonic() + 60.0 * minutes if minutes is not None else None
    if path.exists() and not path.read_bytes().endswith(b"\n"):
        path.write_bytes(path.read_bytes() + b"\n")  # behind a line that was cut off
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        for robot in {case.robot for case in left} - {r["robot"] for r in load(path) if r["kind"] == "likeness"}:
            file.write(json.dumps(likeness(robot)) + "\n")
        for number, case in enumerate(left, 1):
            if end is not None and time.monotonic() > end:
                break
            record = diagnose(case)
            file.write(json.dumps(record) + "\n")
            file.flush()
            print(f"{number}/{len(left)} {line_of(record)}", file=sys.stderr, flush=True)


def line_of(record: dict) -> str:
    """A record in a line."""
    truth = f"{record['robot']} {record['name']} x{record['factor']:g} seed {record['seed']}"
    if record["verdict"] in ("lost", "error"):
        return f"{truth}: {record['error']}"
    names = [" or ".join([name, *others]) for name, others in zip(record["names"], record["equivalents"], strict=True)]
    closed = "" if record["closed"] is None else f", {100 * record['closed']:.0f} % closed"
    deviate = f"{record['detectability']:.1f} sigma"
    return f"{truth}: {record['verdict']} {' + '.join(names)} ({deviate}, {record['seconds']:.0f} s{closed})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="file of records, a JSON object a line")
    parser.add_argument("--robot", nargs="+", choices=ROBOTS, default=ROBOTS)
    parser.add_argument("--effects", nargs="+", default=(), help="names, 'none' among them; default all")
    parser.add_argument("--factors", nargs="+", type=float, default=FACTORS, help="sizes, of the typical ones")
    parser.add_argument("--unknown-factors", nargs="*", type=float, default=(1.0, 0.5))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--nulls", type=int, default=30, help="diagnoses of nothing per robot and noise level")
    parser.add_argument("--noises", nargs="+", type=float, default=NOISES)
    parser.add_argument("--minutes", type=float, help="stop then")
    parser.add_argument("--table", action="store_true", help="run nothing")
    chosen = parser.parse_args()
    if not chosen.table:
        wanted = cases(
            chosen.robot, chosen.effects, chosen.factors, chosen.seeds, chosen.nulls, chosen.noises,
            chosen.unknown_factors,
        )
        try:
            run(wanted, chosen.out, chosen.minutes)
        except KeyboardInterrupt:
            print("stopped; call it again to go on", file=sys.stderr)
    print_summary(load(chosen.out))


if __name__ == "__main__":
    main()
