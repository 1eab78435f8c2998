"""What several tests share."""

import json
import os
import signal
import subprocess
import sys
from functools import partial
from importlib import resources
from pathlib import Path

# Threads of OpenBLAS spin while they wait for a core that another test has: on a busy machine `explain` takes four
# times as long. The variable is read when NumPy is imported, here and in every program that a test starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Workers that share the cores evenly do not take turns on them.
if "PYTEST_XDIST_WORKER" in os.environ and hasattr(os, "sched_setaffinity"):
    number, count = int(os.environ["PYTEST_XDIST_WORKER"][2:]), int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    own = sorted(os.sched_getaffinity(0))[number::count]
    if own:
        os.sched_setaffinity(0, own)

import hypothesis
import numpy as np
import pytest

import drake_ispace
from drake_ispace.cli.app import main

hypothesis.settings.register_profile("whatever_else_the_machine_does", deadline=None, derandomize=True)
hypothesis.settings.load_profile("whatever_else_the_machine_does")


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their markers
def pytest_collection_modifyitems(items):
    """Of a test marked `first_case` the first case that is collected and not slow runs every time; others are slow."""
    met = set()
    for item in items:
        if item.get_closest_marker("first_case") and not item.get_closest_marker("slow"):
            test = item.nodeid.partition("[")[0]
            if test in met:
                item.add_marker(pytest.mark.slow)
            met.add(test)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A new folder, the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def said(capsys):
    """`said("list", "--json")` is what a command that succeeds prints; it says nothing on standard error."""

    def said(*words):
        code, out, err = _ended(capsys, words)
        assert code in (0, None) and err == ""
        return out

    return said


@pytest.fixture
def document(said):
    """`document("list")` is the JSON document of a command that succeeds, without NaN."""
    return lambda *words: json.loads(said(*words, "--json"), parse_constant=pytest.fail)


@pytest.fixture
def refused(capsys):
    """`refused("draw", "x")` is the one sentence with which a command is refused."""

    def refused(*words):
        code, out, err = _ended(capsys, words)
        assert code == 2 and out == ""
        assert err.startswith("drake-ispace: ") and err.count("\n") == 1 and err.endswith("\n")
        assert "Traceback" not in err and len(err) < 600
        return err

    return refused


@pytest.fixture
def launched():
    """`launched("-c", program)` is another Python with this package, that Ctrl-C stops whatever started the tests."""
    processes = []

    def launched(*words, **how):
        piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | how
        environment = os.environ | {"PYTHONPATH": str(Path(drake_ispace.__file__).parents[1])}
        interruptible = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell's background job ignores it
        words = [sys.executable, *map(str, words)]
        processes.append(subprocess.Popen(words, env=environment, preexec_fn=interruptible, **piped))
        return processes[-1]

    yield launched
    for process in processes:
        process.kill()
        process.wait()


def _ended(capsys, words):
    """(exit code, standard output, standard error) of a command line."""
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    return stopped.value.code, *capsys.readouterr()


@pytest.fixture
def drive():
    """Feeds a block tick after tick, without a Simulator."""
    return _drive


def _drive(block, port, ticks):
    """The output `port` (ticks, size) of a new `block`, given its inputs by name for each tick.

    After each tick's update the same inputs are met once more: neither the output nor the state may change.
    """
    context = block.CreateDefaultContext()
    output, rows = block.GetOutputPort(port), []
    for inputs in ticks:
        for name, value in inputs.items():
            block.GetInputPort(name).FixValue(context, np.atleast_1d(np.asarray(value, dtype=float)))
        rows.append(output.Eval(context).copy())
        if context.num_discrete_state_groups():
            context.SetDiscreteState(block.EvalUniquePeriodicDiscreteUpdate(context))
            after = context.get_discrete_state_vector().CopyToVector()
            again = block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()
            assert np.array_equal(again, after)
            assert np.array_equal(output.Eval(context), rows[-1])
    return np.array(rows)


@pytest.fixture
def own_effect_file(tmp_path):
    """The file that `drake-ispace new effect torque_fade` writes."""
    text = (resources.files("drake_ispace.cli") / "templates" / "effect.py").read_text(encoding="utf-8")
    file = tmp_path / "torque_fade.py"
    file.write_text(text.replace("NAME", "torque_fade"), encoding="utf-8")
    return file
