"""Are planted mistakes found, under their own names?

    python -m planted.campaign --bases omni pendulum omni3 diff      (in the folder tests)

prints a line for each miss, then the shares: of the right name first, and among the first two. A mistake that the data
do not show (by less than five times their noise) does not count: `plain_to_see` says so without the checks.
`--sound N` counts findings in N sound sets. `--explain` asks `explain` for its verdict as well. `--pairs N` plants N
times two mistakes at once into each set instead, drawn at random, and counts in how many both are found and nothing
else; some are the same to the data as one other mistake, or hide each other.
"""

import argparse
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.check.check import check
from drake_ispace.explain.explain import explain
from drake_ispace.scenario import load_scenario
from hidden.generator import RobotLost, generate
from hidden.motions import MOTIONS
from planted.bases import ALL, REAL, bases
from planted.corruptions import CORRUPTIONS
from planted.files import Folder

#: Mistakes of the model's numbers: robot -> name -> (override, names by which it may be found).
MODELS = {
    "omni": {
        "diameter for radius": ("omni.plant.wheel_radius_m=0.048", {"counts_per_turn", "diameter_for_radius", "gear"}),
        "twice the track": ("omni.plant.wheel_distance_m=0.72", {"half_track"}),
    },
    "pendulum": {
        "diameter for radius": (
            "pendulum.plant.wheel_radius_m=0.16", {"counts_per_turn", "diameter_for_radius", "gear"}
        ),
        "full for half track": ("pendulum.plant.half_track_m=0.4", {"half_track"}),
    },
}


@dataclass
class Result:
    """What was found of a planted mistake: names in order, whether the data show it, seconds, an error's text."""

    base: str
    name: str
    expected: frozenset[str]
    found: list[str]
    shown: bool
    seconds: float
    error: str = ""
    verdict: str = ""
    named: list[str] = field(default_factory=list)

    @property
    def first(self) -> bool:
        """Whether a right name comes first."""
        return bool(self.found) and self.found[0] in self.expected

    @property
    def among_two(self) -> bool:
        """Whether a right name is among the first two."""
        return any(name in self.expected for name in self.found[:2])


def fits(corruption, folder: Folder, robot: str) -> bool:
    """Whether a recording has the channel, and is of a robot that the mistake is for."""
    return corruption.channel in folder.tables and (not corruption.robots or robot in corruption.robots)


def plain_to_see(before: Folder, after: Folder) -> bool:
    """Whether a mistake moves the data by more than five times their noise: the median absolute second difference."""
    for name, (_, table) in before.tables.items():
        other = after.tables[name][1]
        if table.shape != other.shape or not np.array_equal(table[:, 0], other[:, 0]):
            return True
        values = table[:, 1:] if name != "kinect" else np.column_stack([table[:, 1:3], np.unwrap(table[:, 3])])
        noise = np.median(np.abs(np.diff(values, n=2, axis=0)), axis=0) + 1e-4
        if (np.abs(other[:, 1:] - table[:, 1:]).max(axis=0)[: len(noise)] > 5.0 * noise).any():
            return True
    return False


def planted(base, model, originals, name, place, with_explain=False) -> Result | None:
    """Plant one mistake into a set of recordings and look for it; None where it does not fit."""
    written = plant(originals, [name], place)
    if written is None:
        return None
    shown = any(plain_to_see(Folder(before), Folder(after)) for before, after in zip(originals, written, strict=True))
    return looked_for(base, model, written, name, CORRUPTIONS[name].expected, shown, with_explain)


def plant(originals, names, place) -> list[Path] | None:
    """Folders of the recordings with mistakes planted, one after the other; None where one does not fit."""
    folders = [Folder(path) for path in originals]
    mistakes = [CORRUPTIONS[name] for name in names]
    if not all(fits(mistake, folder, folder.data["robot"]) for mistake in mistakes for folder in folders):
        return None
    for i, folder in enumerate(folders):
        for mistake in mistakes:
            if i == 0 or mistake.every:
                mistake.change(folder, Folder(originals[1 if i == 0 else 0]))
    return [folder.write(place / f"run_{i}") for i, folder in enumerate(folders)]


def planted_together(model, originals, names, place) -> list[str] | None:
    """What is found of several mistakes at once, planted one after the other; None where one does not fit."""
    written = plant(originals, names, place)
    if written is None:
        return None
    try:
        return [finding.fault for finding in check(model, written).findings]
    except InputError as error:
        return [f"refused: {error}"]


def pairs(base, model, originals, count, seed, place) -> tuple[int, int]:
    """How many of so many pairs of mistakes are found, both and nothing else, and how many there were.

    Mistakes that leave nothing to compare, and two of the same kind in one channel, are no pair.
    """
    generator, exact, tried = np.random.default_rng(seed), 0, 0
    usual = [name for name in CORRUPTIONS if not any(word in name for word in ("always", "elsewhere"))]
    while tried < count:
        names = generator.choice(usual, 2, replace=False).tolist()
        one, other = (CORRUPTIONS[name] for name in names)
        if (one.channel, one.expected) == (other.channel, other.expected):
            continue
        found = planted_together(model, originals, names, place)
        if found is None:
            continue
        tried += 1
        both = all(any(fault in mistake.expected for fault in found) for mistake in (one, other))
        if both and set(found) <= one.expected | other.expected:
            exact += 1
        else:
            print(f"{base}: {' + '.join(names)}: {', '.join(found[:4]) or 'nothing'}", flush=True)
    return exact, tried


def looked_for(base, model, runs, name, expected, shown, with_explain=False) -> Result:
    """What the checks, and `explain` where asked, make of runs."""
    started = time.perf_counter()
    result = Result(base, name, frozenset(expected), [], shown, 0.0)
    try:
        result.found = [finding.fault for finding in check(model, runs).findings]
        result.seconds = time.perf_counter() - started
        if with_explain:
            answer = explain(model, runs[:-1], runs[-1:])
            result.verdict, result.named = answer.verdict, [effect.name for effect in answer.effects]
    except InputError as error:
        result.found, result.error = ["refused"], str(error)
    except Exception:
        result.error = traceback.format_exc()
    return result


def totals(results: list[Result]) -> dict[str, float]:
    """Shares over the mistakes that the data show."""
    counted = [result for result in results if result.shown]
    return {
        "mistakes": len(counted), "first": np.mean([r.first for r in counted]),
        "among two": np.mean([r.among_two for r in counted]), "nothing found": sum(not r.found for r in counted),
        "tracebacks": sum("Traceback" in r.error for r in results),
        "seconds": float(np.median([r.seconds for r in results])),
    }


def sound(count: int, seed: int) -> int:
    """How many of so many sound sets of three runs have a finding."""
    wrong = 0
    for k in range(count):
        robot, level = ("omni", "pendulum")[k % 2], (0.3, 1.0, 3.0)[k // 2 % 3]
        motions = np.random.default_rng(seed + k).permutation(MOTIONS)[:3]
        try:
            runs = [generate(robot, str(motion), {}, 20.0, seed + 10 * k + i, process_noise=min(level, 2.0),
                             sensor_noise=level) for i, motion in enumerate(motions)]
        except RobotLost:
            continue
        found = check(f"{robot}_multirate", runs).findings
        wrong += bool(found)
        for finding in found:
            print(f"sound {k} {robot} noise {level:g}: {finding.fault}, {finding.what}", flush=True)
    return wrong


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bases", nargs="*", default=[*ALL, *REAL], help="sets of recordings, default all")
    parser.add_argument("--only", nargs="*", default=list(CORRUPTIONS), help="names of mistakes, default all")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the simulated runs")
    parser.add_argument("--seed", type=int, default=100, help="of the simulated runs")
    parser.add_argument("--sound", type=int, default=0, help="number of sound sets")
    parser.add_argument("--pairs", type=int, default=0, help="number of pairs of mistakes in each set")
    parser.add_argument("--explain", action="store_true", help="ask for the verdict as well")
    options = parser.parse_args(arguments)
    results, together = [], []
    with tempfile.TemporaryDirectory() as temporary:
        for base, (model, runs) in bases(options.bases, options.seconds, options.seed).items():
            own, originals = [], [Path(temporary) / "sound" / str(i) for i in range(len(runs))]
            for run, path in zip(runs, originals, strict=True):
                run.save(path)
            if options.pairs:
                place = Path(temporary) / "planted"
                together.append(pairs(base, model, originals, options.pairs, options.seed, place))
                print(f"{base}: both of {together[-1][0]} of {together[-1][1]} pairs, and nothing else", flush=True)
                continue
            for name in options.only:
                result = planted(base, model, originals, name, Path(temporary) / "planted", options.explain)
                own += [result] if result is not None else []
            for name, (override, expected) in MODELS.get(base, {}).items():
                mistaken = load_scenario(model, [override])
                own.append(looked_for(base, mistaken, originals, name, expected, True, options.explain))
            for result in own:
                said = "; ".join(filter(None, [result.verdict, ", ".join(result.named), result.error[-200:]]))
                if not result.first or result.error or result.verdict not in ("", "data"):
                    print(f"{base}: {result.name}: {', '.join(result.found[:3]) or 'nothing'}"
                          f"{'' if result.shown else ' (not to be seen)'} {said}", flush=True)
            print(f"{base}: " + ", ".join(f"{key} {value:.3g}" for key, value in totals(own).items()), flush=True)
            results += own
    if results:
        print("all: " + ", ".join(f"{key} {value:.3g}" for key, value in totals(results).items()))
        verdicts = [result.verdict for result in results if result.shown and result.verdict]
        if verdicts:
            print("verdicts: " + ", ".join(f"{v} {verdicts.count(v)}" for v in sorted(set(verdicts))))
    if together:
        print("all: both of {} of {} pairs, and nothing else".format(*np.sum(together, axis=0)))
    if options.sound:
        print(f"sound: {sound(options.sound, options.seed)} of {options.sound} sets with a finding")


if __name__ == "__main__":
    main()
