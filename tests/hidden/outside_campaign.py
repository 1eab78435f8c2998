"""What `explain` says of sound robots, and of robots with an effect that no library names.

    python -m hidden.outside_campaign --sound 18 --outside 60      (in the folder tests)

prints a line a case as it ends, then the shares. A sound robot must not be called incomplete or unknown. A robot with
an effect that is clearly visible (its residual twice that of the sound robot of the same seed) must not be called
sound, and a named effect must not be said to close 90 % of the gap.
"""

import argparse
import time
from types import SimpleNamespace

import numpy as np

from drake_ispace.explain.explain import explain
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import ATE, PREDICTION, STEP, errors, rms, windows_of
from drake_ispace.explain.prove.prove import prove
from hidden.generator import FOREIGN, OWN, RobotLost, generate
from hidden.motions import MOTIONS
from hidden.outside import cases, runs_of


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sound", type=int, default=18, help="number of sound sets of runs")
    parser.add_argument("--outside", type=int, default=60, help="number of cases outside the library")
    parser.add_argument("--left", type=int, default=0, help="number of sound sets of which only what is left is tested")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--physics", choices=[OWN, FOREIGN], default=OWN, help="of the sound robots")
    options = parser.parse_args()
    told = [sound(k, options.physics) for k in range(options.first, options.first + options.sound)]
    if told:
        wrong = sum(verdict not in ("none",) for verdict in told)
        unsound = sum(verdict in ("incomplete", "unknown") for verdict in told)
        print(f"sound: {len(told)} sets, {wrong} not 'none', {unsound} incomplete or unknown")
    if options.left:
        unsound = [k for k in range(options.first, options.first + options.left) if left_of(k, options.physics)]
        print(f"left: {len(unsound)} of {options.left} sound sets leave more than noise: {unsound}")
    chosen = cases()[options.first : options.first + options.outside]
    rows = [row for row in (outside(k, case) for k, case in enumerate(chosen, options.first)) if row]
    if rows:
        visible = [row for row in rows if row["ratio"] >= 2.0]
        missed = [row for row in visible if row["verdict"] == "none"]
        proud = [row for row in rows if row["verdict"] in ("named", "set") and (row["closed"] or 0.0) >= 0.9]
        print(f"outside: {len(rows)} cases, {len(visible)} clearly visible, {len(missed)} of these called sound")
        print(f"named with at least 90 % closed: {len(proud)} of {len(rows)}")
        honest = [row for row in rows if row["verdict"] in ("unknown", "incomplete", "data")]
        print(f"unknown, incomplete or data: {len(honest)} of {len(rows)}")
        repaired = sum(row["repaired"] for row in rows if row not in honest)
        print(f"of the others, found by the check of the data under its own name, and repaired: {repaired}")


def sound_runs(k: int, physics: str):
    """Robot, level of process noise and runs of a sound robot; noise 0.3, 1 and 2 in turn, the two robots in turn."""
    robot, level = ("omni", "pendulum")[k % 2], (0.3, 1.0, 2.0)[k // 2 % 3]
    motions = np.random.default_rng(k).permutation(MOTIONS)[:4]
    runs = [generate(robot, str(m), {}, 20.0, 9000 + 10 * k + i, process_noise=level, physics=physics)
            for i, m in enumerate(motions)]
    return robot, level, runs


def left_of(k: int, physics: str) -> list:
    """What is left of a sound robot without any effect, whatever the detection says."""
    robot, level, runs = sound_runs(k, physics)
    case = prepare(f"{robot}_multirate", runs[:-1], runs[-1:])
    left = prove(case, SimpleNamespace(named=None), 0).remainders
    if left:
        print(f"left of {k} {robot} noise {level}: {'; '.join(f'{r.channel} ~ {r.driver}' for r in left)}", flush=True)
    return left


def sound(k: int, physics: str) -> str:
    """The verdict on a sound robot."""
    robot, level, runs = sound_runs(k, physics)
    started = time.perf_counter()
    answer = explain(f"{robot}_multirate", runs[:-1], runs[-1:])
    seconds = time.perf_counter() - started
    print(f"sound {k:3d} {robot:8s} noise {level:3.1f}: {said(answer)} ({seconds:.0f} s)", flush=True)
    return answer.verdict


def outside(k: int, case: dict) -> dict | None:
    """What is said of a case; None where the robot is lost."""
    try:
        runs, healthy = runs_of(case), runs_of(case, sound=True)
    except RobotLost:
        print(f"case {k:3d} {case['robot']} {case['effect']}: the robot is lost", flush=True)
        return None
    ratio = visibility(f"{case['robot']}_multirate", runs, healthy)
    answer = explain(f"{case['robot']}_multirate", runs[:-1], runs[-1:])
    print(
        f"case {k:3d} {case['robot']:8s} {case['effect']:18s} {case['size']:<8g} residual x {ratio:5.1f}: "
        f"{said(answer)} [{case['channel']}, {case['driver']}]", flush=True,
    )
    repaired = any(finding.fault == case["effect"] for finding in answer.data)
    return {"verdict": answer.verdict, "closed": answer.closed, "ratio": ratio, "repaired": repaired}


def visibility(model: str, runs, healthy) -> float:
    """The largest ratio of the errors of these runs to those of healthy ones, over next samples and dead reckoning."""
    sizes = []
    for some in (runs, healthy):
        prediction = prepare(model, some).prediction
        each = [errors(prediction, i, windows_of(prediction, i, {}), {}) for i in range(len(some))]
        sizes.append({
            m: rms([e[m] for e in each if m in e]) for m in each[0]
            if (m.metric == PREDICTION and m.horizon == STEP) or (m.metric == ATE and m.driven_by == "wheels")
        })
    return max(sizes[0][m] / max(sizes[1][m], 1e-300) for m in sizes[0])


def said(answer) -> str:
    """The answer on one line."""
    names = "+".join(effect.name for effect in answer.effects)
    closed = "" if answer.closed is None else f" {100 * answer.closed:.0f} %"
    left = "; ".join(f"{r.channel} ~ {r.driver}" for r in answer.remainders[:2])
    found = ", ".join(dict.fromkeys(finding.fault for finding in answer.data))
    besides = (f" left: {left}" if left else "") + (f" data: {found}" if found else "")
    return f"{answer.verdict} {names}{closed}{besides}"


if __name__ == "__main__":
    main()
