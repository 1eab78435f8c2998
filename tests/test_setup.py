"""tools/setup.sh, with which `make demo` and `make test` begin."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def setup(tmp_path):
    """`setup(NAME=value)` runs the script in a copy of the project, where apt-get does nothing."""
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / "tools", tmp_path / "tools")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "apt-get").write_text("#!/bin/sh\n")
    (tmp_path / "bin" / "apt-get").chmod(0o755)

    def setup(**variables):
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PIP_")}
        environment |= {"PYTHON": sys.executable, "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}", **variables}
        return subprocess.run(["sh", "tools/setup.sh"], cwd=tmp_path, env=environment, capture_output=True, text=True)

    return setup


@pytest.mark.slow
def test_without_network_it_says_what_pip_said_last(setup):
    done = setup(PIP_NO_INDEX="1", PIP_CONFIG_FILE=os.devnull)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "setup: pip could not install the package; it said last: No matching distribution found for setuptools>=77"
    )


def test_a_python_that_drake_does_not_support_is_refused(setup):
    done = setup(PYTHON="/bin/false")
    assert done.returncode == 1
    assert done.stderr.startswith("setup: PYTHON=/bin/false does not run one of the Python versions Drake supports")
