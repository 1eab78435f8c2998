"""What several tests share."""

import os

# Threads of OpenBLAS spin while they wait for a core that another test has: on a busy machine `explain` takes four
# times as long. The variable is read when NumPy is imported, here and in every program that a test starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import numpy as np
import pytest

hypothesis.settings.register_profile("whatever_else_the_machine_does", deadline=None, derandomize=True)
hypothesis.settings.load_profile("whatever_else_the_machine_does")


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
