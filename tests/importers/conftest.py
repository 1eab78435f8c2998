"""Where the measured data lie."""

from pathlib import Path

import pytest


@pytest.fixture
def measured():
    """`measured("emps/DATA_EMPS.mat")` is that file or folder; the test is skipped where it is absent."""
    return _measured


def _measured(name):
    path = Path(__file__).parents[3] / "shared" / "data" / name
    if not path.exists():
        pytest.skip(f"needs {name} of the measured data in ../shared/data, which is not there")
    return path
