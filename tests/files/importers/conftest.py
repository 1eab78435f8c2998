"""Where the measured data lie."""

import pytest

from measurements import ABSENT, DATA


@pytest.fixture
def measured():
    """`measured("emps/DATA_EMPS.mat")` is that file or folder; the test is skipped where it is absent."""
    return _measured


def _measured(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"needs {name}: {ABSENT}")
    return path
