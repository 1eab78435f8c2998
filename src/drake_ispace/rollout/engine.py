"""A scenario through the compiled rollout: the same Run as from Drake's Simulator."""

import math
import time

import numpy as np
from pydrake.systems.framework import Diagram

from drake_ispace.blocks.rates import ticks_in
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.scenario import Scenario
from drake_ispace.simulation import Run, first_divergence, make_run, simulate_diagram
from drake_ispace.wiring.catalog import build_diagram


def simulate_compiled(scenario: Scenario, diagram: Diagram | None = None) -> Run:
    """`simulation.simulate` at machine speed; `wall_s` is the rollout alone, compile time apart.

    diagram: that of the scenario, where it has been built already.

    Raises:
        InputError: values that do not go together.
    """
    rollout = compile_diagram(build_diagram(scenario) if diagram is None else diagram)
    started = time.perf_counter()
    logs = rollout.run(ticks_in(scenario.seconds))
    wall_s = time.perf_counter() - started
    return make_run(scenario, logs, first_divergence(logs, scenario.space), wall_s)


def parity(scenario: Scenario, diagram: Diagram | None = None) -> dict:
    """The largest difference between Drake's Simulator and the compiled rollout over every output at every tick.

    diagram: that of the scenario, where it has been built already; Drake's Simulator takes it over.

    Returns:
        {"max_abs_difference", "ticks", "signals": name -> largest difference}; runs that diverge are compared up to
        there. A difference is None where the runs are of different lengths or a number is not finite in one of them;
        so is the largest then.
    """
    diagram = build_diagram(scenario) if diagram is None else diagram
    compiled, drake = simulate_compiled(scenario, diagram), simulate_diagram(diagram, scenario)
    differences = {name: _difference(rows, compiled.signals[name]) for name, rows in drake.signals.items()}
    comparable = None not in differences.values()
    return {
        "diagram": scenario.diagram, "max_abs_difference": max(differences.values()) if comparable else None,
        "ticks": len(next(iter(drake.signals.values()))) - 1, "signals": differences,
    }


def _difference(rows, others):
    if np.array_equal(rows, others, equal_nan=True):
        return 0.0
    largest = float(np.abs(rows - others).max()) if rows.shape == others.shape else math.inf
    return largest if math.isfinite(largest) else None
