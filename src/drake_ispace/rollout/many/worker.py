"""What a worker of a campaign does, on whichever machine it is: the runs of some numbers of a plan, as rows."""

import json
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import numpy as np

from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.files.typed_tree import read
from drake_ispace.rollout.compile import Rollout, compile_diagram
from drake_ispace.rollout.lanes import LaneRollout, lanes_of
from drake_ispace.rollout.many.draws import Distribution, noise_seed, parse_distribution
from drake_ispace.rollout.many.score import added_blocks, logs_of, lost_at, metrics_of
from drake_ispace.scenario import Scenario, blaming
from drake_ispace.wiring.catalog import build_diagram, entry_of

#: Columns of every robot; metrics.py says what they are.
METRICS = (
    "rms_position_error_m", "max_position_error_m", "rms_cross_track_m", "final_error_m", "iae_m_s", "control_effort",
)
_LANES_PAY_TICKS = 20_000_000  # in a campaign: from there on, compiling for SIMD lanes takes less time than it saves


@dataclass(frozen=True)
class Plan:
    """The task of a campaign, as plain data that can be sent to other machines.

    For every scenario and every parameter set, runs 0 to `runs` - 1. A run's draws depend on its number within its
    scenario and set only, so scenarios and sets are compared on the same random numbers. Numbers of the table go on
    from cell to cell.
    """

    scenarios: dict[str, dict]
    parameter_sets: list[dict[str, float]]
    vary: dict[str, str]
    runs: int
    seed: int
    #: Scenario -> hash of what its rollout computes: rows of other code do not belong into the same table.
    code: dict[str, str]

    def __len__(self) -> int:
        return len(self.scenarios) * len(self.parameter_sets) * self.runs

    def place(self, number: int) -> tuple[str, int, int]:
        """(scenario, number of its parameter set, number of the run within these) of a row."""
        cell, run = divmod(number, self.runs)
        scenario, parameters = divmod(cell, len(self.parameter_sets))
        return list(self.scenarios)[scenario], parameters, run

    @property
    def keys(self) -> list[str]:
        """Parameters that differ between runs."""
        return list(dict.fromkeys([key for parameters in self.parameter_sets for key in parameters] + list(self.vary)))


def run_rows(plan_text: str, numbers: Sequence[int]) -> list[dict]:
    """The rows of the runs of these numbers; what a worker does, on whichever machine it is."""
    plan = _plan(plan_text)
    rows = []
    for name, group in groupby(numbers, lambda number: plan.place(number)[0]):
        rows += _rows_of(plan, plan_text, name, list(group))
    return rows


def _rows_of(plan, plan_text, name, numbers):
    """The rows of these runs of one scenario."""
    text = text_of(plan.scenarios[name])
    rollout, scenario = rollout_of(text), scenario_of(text)
    ticks, seeds, parameters = ticks_in(scenario.seconds) + 1, [], []
    for number in numbers:
        _, parameter_set, run = plan.place(number)
        values = plan.parameter_sets[parameter_set] | {
            key: float(distribution.draws(plan.seed, key, [run])[0])
            for key, distribution in _distributions(plan_text).items()
        }
        seeds.append(noise_seed(plan.seed, run))
        parameters.append(rollout.with_seed(seeds[-1], rollout.with_parameters(values)))
    simulator = rollout_for(plan, text)
    if isinstance(simulator, LaneRollout):
        logs = simulator.run(ticks, np.array(parameters))
        each = [{signal: log[i] for signal, log in logs.items()} for i in range(len(numbers))]
    else:
        each = (simulator.run(ticks, row) for row in parameters)
    return [
        {"run": number, "scenario": name, "seed": seed}
        | {key: float(row[rollout.index(key)]) for key in plan.keys} | _reduced(scenario, logs)
        for number, seed, row, logs in zip(numbers, seeds, parameters, each, strict=True)
    ]


def _reduced(scenario, logs):
    """The metrics of a run, for columns of the table."""
    lost, robots = lost_at(logs), list(entry_of(scenario).robots)
    row = {"diverged": lost is not None, "diverged_at_s": None if lost is None else lost * TICK_S}
    if lost is None:
        for robot in robots:
            metrics = metrics_of(robot, logs)
            row |= {column(robot, name, robots): metrics[name] for name in METRICS}
    return row


def column(robot: str, name: str, robots: Sequence[str]) -> str:
    """The name of a metric's column: with the robot's before it where there are several."""
    return name if len(robots) == 1 else f"{robot}.{name}"


_compiling = threading.Lock()


def rollout_of(scenario_text: str) -> Rollout:
    """The compiled Diagram of a scenario, made once in a process: Drake does not free its Diagrams."""
    with _compiling:
        return _rollout(scenario_text)


@lru_cache(maxsize=64)
def _rollout(scenario_text):
    scenario = scenario_of(scenario_text)
    with blaming(scenario.diagram):
        diagram = build_diagram(scenario)
        outputs = (diagram.get_output_port(i) for i in range(diagram.num_output_ports()))
        sizes = {port.get_name(): port.size() for port in outputs}
        blocks = added_blocks(scenario, list(entry_of(scenario).robots), sizes)
        return compile_diagram(diagram, log=logs_of(blocks), added=blocks)


def rollout_for(plan: Plan, scenario_text: str) -> Rollout | LaneRollout:
    """The compiled Diagram of a scenario, for many runs at once if the plan is so long that it pays."""
    single = rollout_of(scenario_text)
    if len(plan) * ticks_in(scenario_of(scenario_text).seconds) < _LANES_PAY_TICKS:
        return single
    with _compiling:
        return _in_lanes(scenario_text, tuple(plan.keys))


@lru_cache(maxsize=8)
def _in_lanes(scenario_text, keys):
    return lanes_of(_rollout(scenario_text), varied=keys)


@lru_cache(maxsize=64)
def scenario_of(text: str) -> Scenario:
    """The Scenario that a text describes, read once."""
    return read(Scenario(), json.loads(text), "campaign")


@lru_cache(maxsize=4)
def _plan(text) -> Plan:
    return Plan(**json.loads(text))


@lru_cache(maxsize=4)
def _distributions(plan_text) -> dict[str, Distribution]:
    return {key: parse_distribution(text, key) for key, text in _plan(plan_text).vary.items()}


def text_of(data: dict) -> str:
    """The text under which a scenario's data are sent and remembered."""
    return json.dumps(data, sort_keys=True)
