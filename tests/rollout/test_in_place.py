"""Memories that are written in place hold what they would hold if they were copied at every tick."""

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.kernels import arguments
from drake_ispace.effects.effect import BlockEffect, body_of
from drake_ispace.explain.predict.room_view import RoomView
from drake_ispace.robots.library import robots

SCENARIO = di.load_scenario("omni_multirate")
BODY = body_of(SCENARIO, robots()["omni"])
KEPT = {
    e.card.name: e.spec(BODY, e.neutral(BODY)) for e in di.effects().values()
    if isinstance(e, BlockEffect) and e.in_place and e.applies_to(BODY)
} | {"view": RoomView().spec}


def test_the_long_memories_are_among_them():
    assert KEPT.keys() >= {"command_delay", "camera_latency", "view"}


@pytest.mark.parametrize("name", KEPT)
def test_a_kernel_may_write_into_the_memory_itself(name):
    spec, rng = KEPT[name], np.random.default_rng(0)
    (update,) = spec.updates
    assert update.in_place
    parameters = dict(zip(spec.parameter_names, spec.parameter_values, strict=True))
    for tick in (0, 7, 300):
        memory = rng.standard_normal(len(spec.discrete_state))

        def value(argument, memory, tick=tick):
            if argument == "xd":
                return memory
            if argument == "tick":
                return tick
            if argument in spec.inputs:
                return np.arange(1.0, spec.inputs[argument] + 1.0)
            several = [v for key, v in parameters.items() if key.startswith(f"{argument}[")]
            return np.array(several) if several else parameters[argument]

        beside, own = np.empty(len(memory)), memory.copy()
        update.kernel(*(value(a, memory) for a in arguments(update.kernel)), beside)
        update.kernel(*(value(a, own) for a in arguments(update.kernel)), own)
        assert np.array_equal(beside, own) and not np.array_equal(beside, memory)
