"""Do the tests notice small changes in the code? Mutants of the rooms that compute, each under the tests of its room.

    python tools/mutants.py [--mutants 400] [--room fit decide rollout robots control] [--seed 0] [--list FILE]

draws mutants at random, and prints for each room how many of them its tests killed, and every survivor as a difference.
The tree is copied first, so that a mutant never stands in the tree itself. A process that has imported the large
libraries is forked for every mutant: what takes long is the tests alone.
"""

import argparse
import contextlib
import difflib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import WorkDB, use_db

ROOT = Path(__file__).parents[1]
PACKAGE = "src/drake_ispace"
LONGEST_S = 300.0  # of the tests of a room; a mutant that takes longer is killed
#: Room -> folders of its code, and its tests, the quick ones first.
ROOMS = {
    "fit": (["explain/fit"], [
        "tests/explain/fit", "tests/explain/decide/test_detect.py", "tests/explain/decide/test_decide.py",
        "tests/explain/test_own_model.py", "tests/explain/prove/test_free_run.py",
    ]),
    "decide": (["explain/decide"], [
        "tests/explain/decide/test_detect.py", "tests/explain/decide/test_survey.py",
        "tests/explain/decide/test_decide.py", "tests/explain/answer/test_localize.py",
        "tests/explain/test_own_model.py", "tests/explain/prove/test_free_run.py",
    ]),
    "rollout": (["rollout"], [
        "tests/rollout/test_engine.py", "tests/rollout/test_compile.py", "tests/rollout/test_lanes.py",
        "tests/rollout/test_campaign.py", "tests/rollout/test_parity.py",
    ]),
    "robots": (["robots", "plants"], ["tests/robots"]),
    "control": (["control"], ["tests/control", "tests/robots/test_rover.py", "tests/thesis"]),
}
#: Imported once, before any mutant: what the tests need and the package is not part of.
LIBRARIES = (
    "control", "cv2", "cyclopts", "hypothesis", "joblib", "matplotlib.pyplot", "numba", "numpy", "pyarrow.parquet",
    "pydrake.systems.analysis", "pydrake.systems.primitives", "pytest", "scipy.optimize", "scipy.signal",
    "scipy.stats", "yaml",
)


def mutants_of(room: str, count: int, seed: int, tree: Path) -> list:
    """Specifications of so many mutants of a room, drawn from all that can be made. tree: a copy of this one."""
    modules = ", ".join(f'"{PACKAGE}/{folder}"' for folder in ROOMS[room][0])
    config, session = tree / f"{room}.toml", tree / f"{room}.sqlite"
    config.write_text(
        f'[cosmic-ray]\nmodule-path = [{modules}]\ntimeout = 1.0\nexcluded-modules = []\ntest-command = ""\n'
        '[cosmic-ray.distributor]\nname = "local"\n'
    )
    subprocess.run([sys.executable, "-m", "cosmic_ray.cli", "init", str(config), str(session)], cwd=tree, check=True)
    with use_db(str(session), WorkDB.Mode.open) as database:
        every = sorted((mutation for item in database.work_items for mutation in item.mutations), key=repr)
    return random.Random(f"{seed}/{room}").sample(every, min(count, len(every)))


def survives(mutation, tests: list[str], tree: Path) -> str | None:
    """The difference that a mutant makes if no test notices it, else None."""
    path = tree / mutation.module_path
    before = path.read_text(encoding="utf-8")
    own = [str(test.relative_to(tree)) for test in (tree / "tests").rglob(f"test_{path.stem}.py")]
    operator = get_operator(mutation.operator_name)(**mutation.operator_args)
    after = mutate_code(before, operator, mutation.occurrence)
    try:
        path.write_text(after, encoding="utf-8")
        passed = all(tests_pass(some, tree) for some in (own, tests) if some)
    finally:
        path.write_text(before, encoding="utf-8")
    if not passed:
        return None
    name, lines = f"{mutation.module_path}:{mutation.start_pos[0]}", (before.splitlines(), after.splitlines())
    return "\n".join(difflib.unified_diff(*lines, name, mutation.operator_name, n=2, lineterm=""))


def tests_pass(tests: list[str], tree: Path) -> bool:
    """Whether the tests pass within LONGEST_S, in a process of their own."""
    sys.stdout.flush()
    child = os.fork()
    if not child:
        _test(tests, tree)
    started = time.monotonic()
    while time.monotonic() < started + LONGEST_S:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status == 0
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def _test(tests, tree):
    """Run the tests in this process, and end it."""
    code = 1
    try:
        os.setpgid(0, 0)
        os.chdir(tree)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        sys.path[:0] = [str(tree / "src"), str(tree / "tests")]
        os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:2])
        sys.dont_write_bytecode = True
        import pytest

        code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests]))
    except BaseException:
        code = 1
    finally:
        os._exit(code)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--mutants", type=int, default=400, help="of all rooms together")
    parser.add_argument("--room", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--list", type=Path, help="file to which survivors are added; left out: printed")
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for name in LIBRARIES:
        __import__(name)
    each, total, alive = -(-options.mutants // len(options.room)), 0, 0
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "__pycache__", "demo", "build"))
        out = stack.enter_context(open(options.list, "a", encoding="utf-8")) if options.list else sys.stdout
        for room in options.room:
            tests = [
                str(test.relative_to(tree)) for name in ROOMS[room][1] for test in
                (sorted((tree / name).glob("test_*.py")) if (tree / name).is_dir() else [tree / name])
            ]
            if not tests_pass(tests, tree):
                sys.exit(f"{room}: its tests fail without any mutant")
            chosen = mutants_of(room, each, options.seed, tree)
            left = 0
            for mutation in chosen:
                if (difference := survives(mutation, tests, tree)) is not None:
                    left += 1
                    print(difference, end="\n\n", file=out, flush=True)
            total, alive = total + len(chosen), alive + left
            print(f"{room}: {len(chosen) - left} of {len(chosen)} killed", flush=True)
    print(f"{total - alive} of {total} mutants killed ({100.0 * (total - alive) / max(total, 1):.0f} %)")


if __name__ == "__main__":
    main()
