"""benchmarks/rollout_speed.py runs and gives finite ratios; what they are depends on the machine."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "rollout_speed.py"


@pytest.mark.slow
def test_the_quick_benchmark_gives_finite_ratios():
    done = subprocess.run([sys.executable, SCRIPT, "--quick", "--json"], capture_output=True, text=True, check=True)
    results = json.loads(done.stdout)
    assert set(results) == {
        "compiled_vs_drake", "compiled_vs_c", "horizon", "robots", "threads_2_vs_1", "lanes_vs_runs", "peers",
        "compile_s", "second_process_s",
    }
    ratios = [results[name]["ratio"] for name in ("horizon", "robots", "threads_2_vs_1", "lanes_vs_runs")]
    for name in ("compiled_vs_drake", "compiled_vs_c"):
        ratios += [entry["ratio"] for entry in results[name].values()]
    ratios += [entry["ratio"] for entry in results["peers"].values() if "skipped" not in entry]
    assert all(math.isfinite(ratio) and ratio > 0.0 for ratio in ratios)
    for entry in results["compiled_vs_c"].values():  # the C does what the Diagram does
        assert max(entry["largest_difference"].values()) <= 1e-12
