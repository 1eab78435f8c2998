"""Does `explain` answer as an older revision did? Every number and every text, on recordings that the older one made.

The older revision is checked out beside this tree for the time being. Its command line hides effects in recordings, and
both of them explain these. same_answers.yaml says what was renamed since, and what may differ (wall time).

    python benchmarks/same_answers.py [--before REVISION] [--cases NAME ...] [--tiny] [--json]

Exit code 0: the same answers. 1: one differs, or does not show what its case is there for.
"""

import argparse
import asyncio
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from _runs import print_json

TREE = Path(__file__).resolve().parents[1]
SAME = 1e-9  # relative, for numbers below 1 absolute
_AT_ONCE = 2
_SHOWN = 10  # differences of a case, on the terminal
_ABSENT = "absent"


@dataclass(frozen=True)
class Case:
    """Recordings, three motions of which the last is held out, and what an answer to them must show.

    Attributes:
        scenario: that hides and explains. hidden: options of `hide`, of the older revision too. seconds: of each run.
        shows: the `headline` of the answer, in the words of this tree.
    """

    scenario: str
    hidden: str
    shows: str
    seconds: float = 10.0


CASES = {
    "omni_named": Case(
        "omni_multirate", "--effect coulomb_friction:torque_n_m=0.01", "named coulomb_friction",
    ),
    "pendulum_named": Case(
        "pendulum_multirate", "--effect viscous_friction:coefficient_n_m_s=0.004", "named viscous_friction",
    ),
    "omni_set": Case(
        "omni_multirate", "--effect camera_latency:latency_s=0.03", "set camera_latency or clock_offset",
    ),
    "pendulum_two": Case(
        "pendulum_multirate",
        "--effect floor_tilt:slope_x_rad=0.005,slope_y_rad=0.0 --effect viscous_friction:coefficient_n_m_s=0.004",
        "named viscous_friction, floor_tilt",
    ),
    "omni_none": Case("omni_multirate", "", "none"),
    "pendulum_none": Case("pendulum_multirate", "", "none"),
    # half of the room has another carpet
    "omni_unknown": Case(
        "omni_multirate",
        "--set omni.plant.slip.patch_m=[0.0,2.0,-2.0,2.0] --set omni.plant.slip.patch_ratio=[0.2,0.2,0.2]",
        "unknown motion that goes with place",
    ),
    "odometry": Case(
        "odometry_replay", "--effect wheel_radius_errors:share_1=0.02,share_2=-0.02", "named wheel_radius_errors",
    ),
    "velocity": Case("velocity_base", "--effect velocity_lag:time_constant_s=0.1", "named velocity_lag"),
}
TINY = {
    "tiny": Case(
        "odometry_replay", "--effect encoder_scale:share=0.05", "set encoder_scale or velocity_gain", seconds=2.0,
    ),
}


@dataclass(frozen=True)
class Rules:
    """How an older answer reads today, and what may differ.

    Attributes:
        words: old -> new, whole words of keys and texts. keys: old -> new, keys only. may_differ: patterns of places.
    """

    words: dict[str, str]
    keys: dict[str, str]
    may_differ: tuple[str, ...]

    @classmethod
    def read(cls, path: Path) -> "Rules":
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        return cls(data["words"], data["keys"], tuple(data["may_differ"]))

    def renamed(self, value):
        """An older answer in the words of this tree."""
        if isinstance(value, dict):
            return {self._worded(self.keys.get(key, key)): self.renamed(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [self.renamed(inner) for inner in value]
        return self._worded(value) if isinstance(value, str) else value

    def _worded(self, text):
        return re.sub(r"\w+", lambda word: self.words.get(word[0], word[0]), text)

    def free(self, place: str) -> bool:
        return any(fnmatchcase(place, pattern) for pattern in self.may_differ)


def leaves(value, place: str = "") -> Iterator[tuple[str, object]]:
    """Place, such as effects.0.name, and value of all that a document holds; of an empty list or mapping itself."""
    if not isinstance(value, dict | list) or not value:
        yield place, value
        return
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield from leaves(inner, f"{place}.{key}" if place else str(key))


def compare(before: dict, after: dict, rules: Rules) -> dict:
    """largest, at: difference of two numbers, and where; numbers: how many; differences: what is not the same."""
    old, new = (
        {place: value for place, value in leaves(answer) if not rules.free(place)}
        for answer in (rules.renamed(before), after)
    )
    largest, at, numbers, differences = 0.0, None, 0, []
    for place in dict.fromkeys([*old, *new]):
        a, b = old.get(place, _ABSENT), new.get(place, _ABSENT)
        if all(type(value) in (int, float) for value in (a, b)):
            numbers += 1
            apart = abs(a - b) / max(1.0, abs(a), abs(b))
            if apart > largest:
                largest, at = apart, place
            same = apart <= SAME
        else:
            same = type(a) is type(b) and a == b
        if not same:
            differences.append({"at": place, "before": a, "after": b})
    return {"largest": largest, "at": at, "numbers": numbers, "differences": differences}


def headline(answer: dict) -> str:
    """The verdict, and what it is of."""
    names = [" or ".join([effect["name"], *effect["equivalents"]]) for effect in answer["effects"]]
    said = [answer["verdict"], ", ".join(names)]
    if answer["unknown"]:
        said.append(f"{answer['unknown']['link']} that goes with {answer['unknown']['driver']}")
    return " ".join(part for part in said if part)


@contextmanager
def checked_out(revision: str):
    """The tree of a commit, in a folder that is removed again."""
    with TemporaryDirectory(prefix="same_answers-") as folder:
        tree = Path(folder) / "before"
        try:
            git("worktree", "add", "--quiet", "--detach", tree, revision)
            yield tree
        finally:
            subprocess.run(["git", "-C", TREE, "worktree", "remove", "--force", tree], capture_output=True)


def git(*arguments) -> str:
    """What git prints; Ctrl-C waits for its end, for a checkout that went on would fill a folder that is being removed.

    Raises:
        subprocess.CalledProcessError: git says no.
    """
    words = ["git", "-C", TREE, *arguments]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        out, err = process.communicate()
    except KeyboardInterrupt:
        process.communicate()
        raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words, out, err)
    return out.strip()


async def command(tree: Path, folder: Path, arguments: list[str], turns: asyncio.Semaphore) -> dict:
    """The document that a command of the tree prints.

    Raises:
        RuntimeError: what it said when it failed.
    """
    # one thread each: two of them run at once
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "OPENBLAS_NUM_THREADS": "1"}
    async with turns:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "drake_ispace", *arguments, "--json", cwd=folder, env=environment,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )
        try:
            out, err = await process.communicate()
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    if process.returncode:
        raise RuntimeError(f"{arguments[0]} of {tree}: {err.decode().strip()}")
    return json.loads(out)


async def judged(name: str, case: Case, before: Path, folder: Path, rules: Rules, turns: asyncio.Semaphore) -> dict:
    """Make the recordings, explain them twice, compare; error: the sentence of a command that failed."""
    row = {"case": name, "same": False, "expected": case.shows, "error": None}
    options = ["--runs", "3", "--seconds", str(case.seconds), "--out", name]
    try:
        made = await command(before, folder, ["hide", case.scenario, *case.hidden.split(), *options], turns)
        *runs, last = made["recordings"].values()
        asked = ["explain", *runs, "--held-out", last, "--model", case.scenario]
        old, new = [await command(tree, folder, asked, turns) for tree in (before, TREE)]
    except RuntimeError as error:
        return row | {"error": str(error)}
    found = compare(old, new, rules)
    shown = {"before": headline(rules.renamed(old)), "after": headline(new)}
    return row | shown | found | {"same": shown["before"] == case.shows and not found["differences"]}


async def all_judged(cases: dict[str, Case], before: Path, rules: Rules, tell) -> list[dict]:
    """The judgements in the order of the cases, each told as soon as those before it are there."""
    turns, rows = asyncio.Semaphore(_AT_ONCE), []
    with TemporaryDirectory(prefix="same_answers-") as folder:
        async with asyncio.TaskGroup() as group:
            tasks = [
                group.create_task(judged(name, case, before, Path(folder), rules, turns))
                for name, case in cases.items()
            ]
            for task in tasks:
                rows.append(await task)
                tell(rows[-1])
    return rows


def show(row: dict) -> None:
    """One line, and one for everything that is not the same."""
    name = f"{row['case']:15} {'same   ' if row['same'] else 'DIFFERS'}"
    if row["error"]:
        print(f"{name} {row['error']}", flush=True)
        return
    where = f" at {row['at']}" if row["at"] else ""
    lines = [f"{name} {row['after']}; {row['numbers']} numbers, largest difference {row['largest']:.2g}{where}"]
    if row["before"] != row["expected"]:
        lines.append(f"expected to show {row['expected']!r}, before: {row['before']!r}")
    lines += [f"{one['at']}: {one['before']!r} -> {one['after']!r}" for one in row["differences"][:_SHOWN]]
    if len(row["differences"]) > _SHOWN:
        lines.append(f"and {len(row['differences']) - _SHOWN} more")
    print("\n    ".join(lines), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", default="HEAD", metavar="REVISION", help="of git, default HEAD")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), metavar="NAME",
                        help=f"of {', '.join(CASES)}; default all")
    parser.add_argument("--tiny", action="store_true", help="one short case")
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output, nothing else")
    asked = parser.parse_args()
    try:
        revision = git("rev-parse", "--verify", f"{asked.before}^{{commit}}")
    except (OSError, subprocess.CalledProcessError):
        parser.error(f"--before {asked.before}: expected a revision in the git history of {TREE}")
    cases = TINY if asked.tiny else {name: CASES[name] for name in asked.cases}
    rules = Rules.read(Path(__file__).with_suffix(".yaml"))
    try:
        with checked_out(revision) as before:
            rows = asyncio.run(all_judged(cases, before, rules, (lambda row: None) if asked.json else show))
    except KeyboardInterrupt:
        sys.exit(130)
    same = all(row["same"] for row in rows)
    if asked.json:
        print_json({"before": revision, "same": same, "cases": rows})
    sys.exit(not same)


if __name__ == "__main__":
    main()
