"""A scenario through the compiled rollout: the same Run as from Drake's Simulator."""

import time

import numpy as np

from drake_ispace.rates import MAX_TICK, ticks_in
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.scenario import Scenario
from drake_ispace.simulation import Run, first_divergence, make_run, simulate
from drake_ispace.wiring.catalog import build_diagram


def simulate_compiled(scenario: Scenario) -> Run:
    """`simulation.simulate` at machine speed; `wall_s` is the rollout alone, compile time apart.

    Raises:
        InputError: values that do not go together.
    """
    rollout = compile_diagram(build_diagram(scenario))
    started = time.perf_counter()
    logs = rollout.run(min(ticks_in(scenario.seconds), MAX_TICK))
    wall_s = time.perf_counter() - started
    return make_run(scenario, logs, first_divergence(logs), wall_s)


def parity(scenario: Scenario) -> dict:
    """The largest difference between Drake's Simulator and the compiled rollout over every output at every tick.

    Returns:
        {"max_abs_difference", "ticks", "signals": name -> largest difference}; runs that diverge are compared up to there.
    """
    drake, compiled = simulate(scenario), simulate_compiled(scenario)
    differences = {}
    for name, rows in drake.signals.items():
        same = compiled.signals[name]
        differences[name] = float(np.abs(rows - same).max()) if rows.shape == same.shape else float("inf")
    return {
        "diagram": scenario.diagram, "max_abs_difference": max(differences.values()),
        "ticks": len(next(iter(drake.signals.values()))) - 1, "signals": differences,
    }
