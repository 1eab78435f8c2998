"""How long a diagnosis takes: four runs of 20 s against the whole library, warm, stage by stage, and what dominates.

Runs of both robots, one effect hidden in each, each robot in a process of its own. Where the time goes is measured
twice: between the messages of `explain`, and by what the prediction Diagram and the whitening are called for. With
--long also half an hour of one run of the omni robot.

    python benchmarks/diagnosis.py [--json] [--quick] [--tiny] [--seed SEED] [--long]
"""

import os
import statistics
import time
from collections.abc import Sequence
from contextlib import contextmanager

from _runs import apart, options, peak_mb, print_json, print_table

import drake_ispace as di
from drake_ispace.explain.decide.survey import screen, view
from drake_ispace.explain.fit import whitening
from drake_ispace.explain.predict import replay
from drake_ispace.hiding import MOTIONS

TARGET_S, WISHED_S = 30.0, 5.0
SECONDS, LONG_S = 20.0, 1800.0
#: One effect for each robot.
HIDDEN = {
    "omni": {"coulomb_friction": {"torque_n_m": 0.005}},
    "pendulum": {"viscous_friction": {"coefficient_n_m_s": 0.004}},
}
#: What takes the time, by the functions that it passes through.
PARTS = {
    "rollouts of the prediction Diagram": [(replay.Replay, "run")],
    "noise model (fit)": [(view, "noise_of")],
    "whitening": [(whitening.Whitening, "one")],
    "score tests": [(screen.Screen, "__init__"), (screen.Screen, "calibrate")],
}


@contextmanager
def watched(parts: dict):
    """{part: [calls, thread seconds]} of what happens inside; a part inside of another counts in both."""
    found, before = {}, []

    def watch(name, owner, attribute):
        plain = getattr(owner, attribute)

        def call(*arguments, **keywords):
            started = time.thread_time()
            try:
                return plain(*arguments, **keywords)
            finally:
                found[name][0] += 1
                found[name][1] += time.thread_time() - started

        before.append((owner, attribute, plain))
        setattr(owner, attribute, call)

    for name, functions in parts.items():
        found[name] = [0, 0.0]
        for owner, attribute in functions:
            watch(name, owner, attribute)
    try:
        yield found
    finally:
        for owner, attribute, plain in before:
            setattr(owner, attribute, plain)


def diagnosis(robot: str, runs: list, held_out: list, effects: list | None, seed: int) -> dict:
    """Wall and CPU seconds of one call of `explain`, by stage and by part."""
    stages, marks = [], []

    def tell(stage):
        stages.append(stage)
        marks.append(time.perf_counter())

    with watched(PARTS) as parts:
        cpu, started = time.process_time(), time.perf_counter()
        found = di.explain(f"{robot}_multirate", runs, held_out, effects, seed=seed, tell=tell)
        wall, cpu = time.perf_counter() - started, time.process_time() - cpu
    spans = [b - a for a, b in zip(marks, [*marks[1:], started + wall], strict=True)]
    return {
        "wall_s": wall, "cpu_s": cpu, "verdict": found.verdict, "named": [effect.name for effect in found.effects],
        "stages": [{"stage": stage, "wall_s": span} for stage, span in zip(stages, spans, strict=True)],
        "parts": {name: {"calls": calls, "cpu_s": seconds} for name, (calls, seconds) in parts.items()},
    }


def measure(
    robot: str, seconds: float, motions: Sequence[str], effects: list | None, seed: int, repetitions: int,
) -> dict:
    """Compile (the first call), then the diagnosis of median wall time of `repetitions` warm ones.

    peak_mb: of the memory of this process, beyond what was there before the first call.
    """
    scenario = di.load_scenario(f"{robot}_multirate")
    runs = list(di.hide(scenario, robot, HIDDEN[robot], motions, seed, seconds).values())
    held_out = list(di.hide(scenario, robot, HIDDEN[robot], motions[:1], seed + 1, seconds).values())
    before = peak_mb()
    first = diagnosis(robot, runs, held_out, effects, seed)
    peak = peak_mb() - before
    again = [diagnosis(robot, runs, held_out, effects, seed) for _ in range(repetitions)]
    warm = sorted(again, key=lambda d: d["wall_s"])
    middle = warm[len(warm) // 2]
    dominates = max(middle["parts"], key=lambda name: middle["parts"][name]["cpu_s"])
    return middle | {
        "first_wall_s": first["wall_s"], "warm_wall_s": [d["wall_s"] for d in warm],
        "median_wall_s": statistics.median(d["wall_s"] for d in warm), "dominates": dominates,
        "peak_mb": peak,
    }


def main() -> None:
    chosen = options(__doc__, long={"action": "store_true", "help": "half an hour of one run of the omni robot, too"})
    motions, seconds, repetitions, effects, robots = list(MOTIONS), SECONDS, 3, None, list(HIDDEN)
    if chosen.quick:
        motions, seconds, repetitions = ["square", "figure_eight"], 8.0, 1
    if chosen.tiny:
        robots, motions, seconds = ["omni"], ["square"], 5.0
        effects = [di.effects()[name] for name in ("floor_tilt", "coulomb_friction", "mass_error")]
    cases = {robot: (robot, seconds, motions, effects, chosen.seed, repetitions) for robot in robots}
    if chosen.long:
        cases["half an hour of omni"] = "omni", LONG_S, motions[:1], None, chosen.seed, 1
    found = {case: measure(*asked) if chosen.tiny else apart(measure, *asked) for case, asked in cases.items()}
    data = {
        "runs": len(motions), "seconds": seconds, "cores": os.cpu_count(), "load": os.getloadavg()[0],
        "target_s": TARGET_S, "wished_s": WISHED_S, "robots": found,
    }
    if chosen.json:
        print_json(data)
        return
    for case, one in found.items():
        _, each_s, made, *_ = cases[case]
        title = (
            f"{case}: {len(made)} runs of {each_s:g} s, {one['median_wall_s']:.1f} s by the wall, "
            f"{one['cpu_s']:.1f} s of CPU, at its peak {one['peak_mb']:.0f} MB more (target {TARGET_S:g} s, "
            f"wished {WISHED_S:g} s); {one['verdict']} {', '.join(one['named'])}"
        )
        rows = [[stage["stage"], f"{stage['wall_s']:.2f}"] for stage in one["stages"]]
        print_table(title, ["stage", "s by the wall"], rows)
        rows = [[name, part["calls"], f"{part['cpu_s']:.2f}"] for name, part in one["parts"].items()]
        print_table("what it is spent on", ["part", "calls", "s of CPU"], rows)


if __name__ == "__main__":
    main()
