"""benchmarks/same_answers.py finds what differs between two answers, knows renamed words, and leaves nothing behind."""

import copy
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

TREE = Path(__file__).parents[2]
SCRIPT = TREE / "benchmarks" / "same_answers.py"
ENVIRONMENT = os.environ | {"PYTHONPATH": str(TREE / "src")}
ANSWER = {
    "verdict": "set", "unknown": None, "seconds": 3.0,
    "effects": [{"name": "base_lag", "equivalents": ["delay"], "size": 0.5, "bound": False}],
    "difference": {"base": {"wheels": 3}}, "warnings": [], "text": "the base, a robot",
}
needs_history = pytest.mark.skipif(
    not (TREE / ".git").exists() or not shutil.which("git"), reason="not a checkout of git"
)


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPT.parent)
    import same_answers

    return same_answers


@pytest.fixture
def rules(script):
    return script.Rules({"base": "rover"}, {"size": "extent"}, ("seconds",))


@pytest.fixture
def today():
    """ANSWER after the renaming of `rules`."""
    answer = copy.deepcopy(ANSWER)
    answer["effects"][0]["extent"] = answer["effects"][0].pop("size")
    answer |= {"difference": {"rover": {"wheels": 3}}, "text": "the rover, a robot"}
    return answer


def test_a_renamed_answer_is_the_same(script, rules, today):
    found = script.compare(ANSWER, today, rules)
    assert found == {"largest": 0.0, "at": None, "numbers": 2, "differences": []}


def test_what_may_differ_does_not_count_wherever_it_is(script, rules, today):
    del today["seconds"]
    assert script.compare(ANSWER, today, rules)["differences"] == []


@pytest.mark.parametrize("change, place", {
    "number": (lambda a: a["effects"][0].update(extent=0.5 + 2e-9), "effects.0.extent"),
    "text": (lambda a: a.update(verdict="named"), "verdict"),
    "old word": (lambda a: a.update(text="the base, a robot"), "text"),
    "truth": (lambda a: a["effects"][0].update(bound=0), "effects.0.bound"),
    "nothing": (lambda a: a.update(unknown={}), "unknown"),
    "more": (lambda a: a.update(closed=None), "closed"),
    "longer": (lambda a: a["effects"][0]["equivalents"].append("lag"), "effects.0.equivalents.1"),
}.values())
def test_anything_else_that_differs_is_found(script, rules, today, change, place):
    change(today)
    assert place in [one["at"] for one in script.compare(ANSWER, today, rules)["differences"]]


def test_numbers_may_differ_by_rounding_and_the_largest_difference_is_told(script, rules, today):
    today["effects"][0]["extent"] += 1e-10
    today["difference"]["rover"]["wheels"] = 3.0 * (1.0 + 5e-10)
    found = script.compare(ANSWER, today, rules)
    assert found["differences"] == [] and found["at"] == "difference.rover.wheels"
    assert found["largest"] == pytest.approx(5e-10, rel=1e-5)


def test_the_headline_is_verdict_and_names(script):
    assert script.headline(ANSWER) == "set base_lag or delay"
    odd = ANSWER | {"verdict": "unknown", "effects": [], "unknown": {"link": "force", "driver": "time"}}
    assert script.headline(odd) == "unknown force that goes with time"


@pytest.mark.slow
@needs_history
def test_a_case_is_made_and_explained_by_the_last_commit_and_by_this_tree():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--tiny", "--json"], capture_output=True, text=True, timeout=600, env=ENVIRONMENT,
    )
    (row,) = json.loads(done.stdout)["cases"]
    assert row["error"] is None and row["numbers"] > 5
    assert done.returncode == (0 if row["same"] else 1)


@needs_history
def test_an_interrupted_comparison_leaves_no_tree_behind(tmp_path):
    process = subprocess.Popen(
        [sys.executable, SCRIPT, "--tiny"], env=ENVIRONMENT | {"TMPDIR": str(tmp_path)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    while not list(tmp_path.glob("*/tiny")) and not list(tmp_path.glob("*/before/src")):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert not list(tmp_path.iterdir())
    trees = subprocess.run(["git", "-C", TREE, "worktree", "list"], capture_output=True, text=True, check=True)
    assert str(tmp_path) not in trees.stdout


@needs_history
def test_a_revision_that_is_not_there_is_refused():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--before", "nowhere"], capture_output=True, text=True, timeout=60, env=ENVIRONMENT,
    )
    assert done.returncode == 2 and "--before nowhere: expected a revision" in done.stderr
