"""The schedule says what Drake's Simulator really executes."""

from collections import Counter, defaultdict

import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Adder, ConstantVectorSource, DiscreteTimeDelay, ZeroOrderHold

from drake_ispace.blocks.rates import TICK_S, tick_at
from drake_ispace.report.pictures.schedule import schedule
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import make_simulator
from drake_ispace.wiring.catalog import CATALOG, build_diagram

TICKS = 60


@pytest.fixture
def executed(monkeypatch):
    """(block, phase) -> Counter of the ticks at which Drake called an update of that block."""
    calls = defaultdict(Counter)

    def spy_on(method, phase):
        declare = getattr(LeafSystem, method)

        def declare_spied(self, period_s, offset_s, update):
            def spied(context, state):
                time_s = context.get_time()
                assert time_s == tick_at(time_s) * TICK_S
                calls[self.get_name(), phase][tick_at(time_s)] += 1
                return update(context, state)

            return declare(self, period_s, offset_s, spied)

        monkeypatch.setattr(LeafSystem, method, declare_spied)

    spy_on("DeclarePeriodicUnrestrictedUpdateEvent", "sense")
    spy_on("DeclarePeriodicDiscreteUpdateEvent", "compute")
    return calls


def ticks_of(rows):
    """(block, phase) -> Counter of the ticks before TICKS at which `rows` announce an update."""
    announced = defaultdict(Counter)
    for row in rows:
        offset = round(row["offset_s"] / TICK_S)
        announced[row["block"], row["phase"]].update(range(offset, TICKS, row["period_ticks"]))
    return announced


@pytest.mark.parametrize("overrides", [
    ("omni_multirate", []),
    ("omni_multirate", ["space.localizer.latency_ticks=7"]),
    ("shared_space", ["space.localizer.latency_ticks=23"]),
], ids=["omni_multirate", "vision_latency", "shared_space_latency"])
def test_drake_executes_the_schedule(executed, overrides):
    diagram = build_diagram(load_scenario(*overrides))
    simulator, _ = make_simulator(diagram)
    simulator.AdvanceTo(TICKS * TICK_S)
    assert executed == ticks_of(schedule(diagram))


@pytest.mark.parametrize("name", CATALOG)
def test_both_periods_to_the_bit(name):
    rows = schedule(build_diagram(load_scenario(name)))
    assert {(row["period_ticks"], row["period_s"]) for row in rows} == {(1, TICK_S), (19, 19 * TICK_S)}


def test_the_room_updates_at_95_ms():
    rows = schedule(build_diagram(load_scenario("pendulum_multirate")))
    slow = {row["block"] for row in rows if row["period_ticks"] == 19}
    assert slow == {"kinect", "pendulum_way_point", "pendulum_tracker"}


def test_latency_is_the_offset_of_delivery():
    rows = schedule(build_diagram(load_scenario("omni_multirate", ["space.localizer.latency_ticks=7"])))
    assert [row["offset_s"] for row in rows if row["block"] == "kinect"] == [0.0, 7 * TICK_S]


def nested():
    inner = DiagramBuilder()
    hold = inner.AddSystem(ZeroOrderHold(0.25, 1, offset_sec=0.125))
    hold.set_name("hold")
    delay = inner.AddSystem(DiscreteTimeDelay(3 * TICK_S, 2, 1))
    inner.Connect(hold.get_output_port(), delay.get_input_port())
    inner.ExportInput(hold.get_input_port(), "u")
    outer = DiagramBuilder()
    room = inner.Build()
    room.set_name("room")
    outer.AddSystem(room)
    source = outer.AddSystem(ConstantVectorSource([1.0]))
    outer.Connect(source.get_output_port(), room.get_input_port())
    return outer.Build()


def test_drakes_own_systems_in_a_nested_diagram():
    hold, delay = schedule(nested())
    assert hold == {
        "block": "room::hold", "phase": "compute", "period_ticks": 0.25 / TICK_S, "period_s": 0.25, "offset_s": 0.125,
    }
    assert (delay["period_ticks"], delay["phase"]) == (3, "compute")


def test_a_block_without_a_name_has_no_address():
    assert schedule(nested())[1]["block"] == "room::DiscreteTimeDelay"


def test_a_single_block_has_a_schedule():
    hold = ZeroOrderHold(2 * TICK_S, 1)
    hold.set_name("hold")
    assert [row["period_ticks"] for row in schedule(hold)] == [2]


def test_a_system_without_updates_has_none():
    assert schedule(Adder(2, 1)) == []
