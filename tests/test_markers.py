"""Which tests always run."""

from pathlib import Path

import pytest


class Item:
    """A test as far as the choice needs one."""

    def __init__(self, nodeid, *markers):
        self.nodeid, self.markers = nodeid, set(markers)

    def get_closest_marker(self, name):
        return name in self.markers or None

    def add_marker(self, marker):
        self.markers.add(marker.name)


@pytest.fixture
def always(pytestconfig):
    """`always(items)` are the names of those that are not slow."""
    conftest = pytestconfig.pluginmanager.get_plugin(str(Path(__file__).with_name("conftest.py")))

    def always(*items):
        conftest.pytest_collection_modifyitems(items)
        return [item.nodeid for item in items if "slow" not in item.markers]

    return always


def test_the_first_case_that_is_not_slow_stands_for_all(always):
    cases = Item("a.py::f[1]", "first_case", "slow"), Item("a.py::f[2]", "first_case"), Item("a.py::f[3]", "first_case")
    assert always(*cases) == ["a.py::f[2]"]


def test_a_case_that_is_asked_for_alone_runs(always):
    assert always(Item("a.py::f[3]", "first_case")) == ["a.py::f[3]"]


def test_other_tests_and_files_have_first_cases_of_their_own(always):
    first = [Item(f"{file}::{name}[0]", "first_case") for file in ("a.py", "b.py") for name in "fg"]
    every = [Item(f"a.py::every[{i}]") for i in range(2)]
    assert always(*first, *every) == [item.nodeid for item in (*first, *every)]
