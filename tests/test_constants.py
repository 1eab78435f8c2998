"""The list of numbers that can change a verdict."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "tools" / "constants.py"


def test_a_number_of_a_module_is_listed_with_its_comment(tmp_path):
    (tmp_path / "one.py").write_text("_LEAST = 24.0  # drop in deviance\n_PAIR = (1, -2)\nname = 3\nTEXT = 'x'\n")
    done = subprocess.run([sys.executable, SCRIPT, tmp_path], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["one.py: _LEAST (1) drop in deviance", "one.py: _PAIR (2) ", "3 numbers"]


def test_the_package_has_some():
    done = subprocess.run([sys.executable, SCRIPT], capture_output=True, text=True, check=True)
    assert "levels.py: CHANCE (1)" in done.stdout
