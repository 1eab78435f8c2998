"""A few kills of every quick writer; `python -m fuzz.kills` has hundreds, and the slow writers."""

import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


@pytest.mark.parametrize("writer", [
    "recording", *(pytest.param(writer, marks=pytest.mark.slow) for writer in ("parquet", "hide", "json")),
])
def test_a_killed_writer_leaves_one_version_and_no_trace(writer):
    command = [sys.executable, "-m", "fuzz.kills", "--kills", "2", "--writer", writer, "--seed", "1"]
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
