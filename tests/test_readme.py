"""The README's commands run from top to bottom in a folder that holds the committed examples."""

import shlex
import shutil

import pytest

from drake_ispace.cli.app import main
from test_docs import COMMANDS, ROOT

LINES = [line for page, line in COMMANDS if page == "README.md"]
#: Commands that look at every effect of the library or draw a whole page.
SLOW = ("explain", "demo", "vision")
#: Command -> its options in the cheap form; others stay as they are.
CHEAP = {
    "simulate": {"--seconds": "0.5"}, "compare": {"--seconds": "0.5"}, "parity": {"--seconds": "0.5"},
    "montecarlo": {"--seconds": "0.5", "--runs": "2"}, "hide": {"--seconds": "0.5", "--runs": "1"},
}


def cheap(line):
    """The words of a command after `drake-ispace`, with the options of CHEAP instead of its own."""
    words = shlex.split(line)[1:]
    for option, value in CHEAP.get(words[0], {}).items():
        if option in words:
            words[words.index(option) + 1] = value
        else:
            words += [option, value]
    return words


def failures(commands):
    """Those of the commands that do not end with exit code 0."""
    failed = []
    for words in commands:
        with pytest.raises(SystemExit) as stopped:
            main(words)
        if stopped.value.code not in (0, None):
            failed.append(words)
    return failed


@pytest.fixture
def clone(here):
    """A new folder, the current one, with what the README's commands may read."""
    shutil.copytree(ROOT / "examples", here / "examples")


@pytest.mark.usefixtures("clone")
def test_the_commands_run_in_their_order():
    assert failures(cheap(line) for line in LINES if line.split()[1] not in SLOW) == []


@pytest.mark.slow
@pytest.mark.usefixtures("clone")
@pytest.mark.parametrize("page", ["README.md", "docs/vision.md", "docs/identification.md", "docs/your_robot.md"])
def test_the_commands_run_in_their_order_as_they_stand(page):
    assert failures(shlex.split(line)[1:] for there, line in COMMANDS if there == page) == []
