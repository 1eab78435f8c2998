"""Runs a Diagram in Drake's Simulator and collects its outputs, one row a tick."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import VectorLogSink

from drake_ispace.blocks.block import in_one_context
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.room.room import Space
from drake_ispace.scenario import Scenario, as_scenario
from drake_ispace.wiring.catalog import build_diagram, entry_of

FALLEN_RAD = np.pi / 2.0  # the body lies on the floor
SPINNING_RAD_S = 50.0  # eight turns a second
_CHUNK = 200  # ticks between looks at progress and divergence


@dataclass(frozen=True)
class Run:
    """Outputs of a simulated Diagram.

    Attributes:
        scenario: what was run.
        signals: name of the Diagram's output -> (ticks + 1, size). Row k is the value *before* the updates of tick k
            (x-), so row k of a sampled signal shows the sample of tick k - 1. docs/semantics.md.
        diverged_s: when the robot fell, spun or left the room, else None; rows after it are left away.
        wall_s: duration of the simulation itself.
    """

    scenario: Scenario
    signals: dict[str, np.ndarray]
    diverged_s: float | None
    wall_s: float

    @property
    def time_s(self) -> np.ndarray:
        """(ticks + 1,) times of the rows [s]."""
        rows = len(next(iter(self.signals.values())))
        return np.arange(rows) * TICK_S

    @property
    def robots(self) -> list[str]:
        """Names of the robots in it."""
        return list(entry_of(self.scenario).robots)


def simulate(scenario: Scenario | str | Path, progress: Callable[[float], None] | None = None) -> Run:
    """Build the Diagram of a scenario, its name or its file, and run it for the scenario's seconds.

    progress: is told the simulated time [s] now and then.

    Raises:
        InputError: as `load_scenario`, or values that do not go together.
    """
    scenario = as_scenario(scenario)
    return simulate_diagram(build_diagram(scenario), scenario, progress)


def simulate_diagram(diagram: Diagram, scenario: Scenario, progress: Callable[[float], None] | None = None) -> Run:
    """Run a Diagram whose outputs are named as those of the catalog."""
    simulator, sinks = make_simulator(diagram)
    ticks = ticks_in(scenario.seconds)
    started = time.perf_counter()
    diverged = None
    with in_one_context(simulator.get_system(), simulator.get_context()):
        for tick in range(min(_CHUNK, ticks), ticks + _CHUNK, _CHUNK):
            simulator.AdvanceTo(min(tick, ticks) * TICK_S)
            if progress:
                progress(simulator.get_context().get_time())
            start = max(tick - _CHUNK - 1, 0)
            latest = {name: _log(simulator, sink)[start:] for name, sink in sinks.items()}
            diverged = first_divergence(latest, scenario.space)
            if diverged is not None:
                diverged += start
                break
    wall_s = time.perf_counter() - started
    return make_run(scenario, {name: _log(simulator, sink) for name, sink in sinks.items()}, diverged, wall_s)


def make_run(scenario: Scenario, logs: dict[str, np.ndarray], diverged: int | None, wall_s: float) -> Run:
    """The Run of these logs, cut where the robot was lost (`diverged`: row, None if it was not)."""
    rows = slice(0, None if diverged is None else max(diverged, 1))
    signals = {name: log[rows].copy() for name, log in logs.items()}
    return Run(scenario, signals, None if diverged is None else diverged * TICK_S, wall_s)


def make_simulator(diagram: Diagram) -> tuple[Simulator, dict[str, VectorLogSink]]:
    """A Simulator with Drake's fixed-step Runge-Kutta 3 at one step a tick, and a log of every output per tick."""
    builder = DiagramBuilder()
    builder.AddSystem(diagram)
    sinks = {}
    for i in range(diagram.num_output_ports()):
        port = diagram.get_output_port(i)
        sink = builder.AddSystem(VectorLogSink(port.size(), publish_period=TICK_S))
        builder.Connect(port, sink.get_input_port())
        sinks[port.get_name()] = sink
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta3", TICK_S).set_fixed_step_mode(True)
    simulator.Initialize()
    return simulator, sinks


def _log(simulator, sink):
    return sink.FindLog(simulator.get_context()).data().T


def first_divergence(logs: dict[str, np.ndarray], space: Space) -> int | None:
    """The first row in which a robot has fallen, spins, is outside of the room or is no number; None if there is none.
    """
    first, walls = None, 0.5 * np.array([space.width_m, space.depth_m])
    for name, rows in logs.items():
        finite = np.isfinite(rows)
        bad = np.zeros(len(rows), bool) if finite.all() else ~finite.all(axis=1)  # the first of both is the fast one
        if name.endswith("_pose"):
            bad |= (np.abs(rows[:, :2]) > walls).any(axis=1)
        if name.endswith(("_velocity", "_balance")):
            bad |= np.abs(rows[:, 2]) > SPINNING_RAD_S
        if name.endswith("_balance"):
            bad |= np.abs(rows[:, 0]) > FALLEN_RAD
        if bad.any():
            first = int(np.argmax(bad)) if first is None else min(first, int(np.argmax(bad)))
    return first
