"""Many runs of one or several scenarios: on the threads of this machine, or on a Dask cluster.

Every run becomes a row at once, so memory does not grow with the number of runs. What a run draws depends only on its
number (draws.py): the table does not depend on threads, machines, or interruptions.
"""

import contextlib
import dataclasses
import json
import logging
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import joblib
import numpy as np
import pyarrow as pa

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.blocks.rates import ticks_in
from drake_ispace.control.guide.paths import build_path
from drake_ispace.files.typed_tree import read
from drake_ispace.robots.library import robots
from drake_ispace.rollout.many.draws import find_parameter, parse_distribution, variable
from drake_ispace.rollout.many.score import own_names
from drake_ispace.rollout.many.table import Rows, campaign_folder
from drake_ispace.rollout.many.worker import (
    METRICS,
    Plan,
    column,
    rollout_for,
    rollout_of,
    run_rows,
    scenario_of,
    text_of,
)
from drake_ispace.scenario import Scenario, difference, named_scenarios
from drake_ispace.wiring.catalog import CATALOG, entry_of

_CLUSTER_S = 10.0  # to wait for a scheduler, and for its first worker
_MOST_RUNS = 1_000_000
_BATCH_TICKS = 400_000  # simulated by one call of a worker: some tenths of a second


class CampaignStopped(KeyboardInterrupt):
    """Ctrl-C in a campaign; its text says what was kept."""


@dataclass(frozen=True)
class Campaign:
    """The results of a campaign.

    Attributes:
        table: a row per run, sorted by number: run, scenario, seed (of the noise; `simulate --seed` repeats it), every
            parameter that differs between runs, diverged, diverged_at_s, and METRICS for each robot (null in a run
            that diverged), prefixed "robot." where a scenario has several.
        metrics: names of the columns of METRICS.
        runs_now, wall_s: runs of this call, and how long they took, compiling apart.
        damaged: files of rows that could not be read; their runs were computed again.
    """

    table: pa.Table
    metrics: list[str]
    runs_now: int
    wall_s: float
    damaged: Sequence[Path] = ()


def montecarlo(
    scenarios: Scenario | str | Path | Mapping[str, Scenario | str | Path], runs: int, *,
    vary: Mapping[str, str] | None = None, parameter_sets: Sequence[Mapping[str, float]] = ({},), seed: int = 0,
    out: Path | None = None, threads: int | None = None, cluster: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Campaign:
    """Roll out every scenario with every parameter set under `runs` seeds.

    Args:
        scenarios: one (or its name or file), or several by names of your own; each is compiled once.
        runs: per scenario and parameter set.
        vary: parameter -> "normal(mean, std)", "uniform(a, b)", "loguniform(a, b)" or "choice(a, b, ...)", in the
            parameter's own unit. Parameters are those of the compiled blocks (`Rollout.parameter_names`), so a varied
            "omni_plant.mass_kg" changes the robot and not what its controller believes of it.
        parameter_sets: parameter -> value, over those of the scenario and below `vary`.
        seed: of all draws and all noise.
        out: folder for the plan and the rows. A call with the plan of an existing folder does what is missing there.
        threads: rollouts at once on this machine, default one per core.
        cluster: address of a Dask scheduler, as "tcp://host:8786", instead of threads.
        progress: is told (rows done, rows in all).

    Raises:
        InputError: as `named_scenarios`, unknown parameters or distributions, values out of range, a folder with
            another plan, a cluster that does not answer or a missing library.
        CampaignStopped: Ctrl-C; rows done so far are in `out`.
    """
    plan = make_plan(scenarios, runs, vary or {}, parameter_sets, seed)
    text = json.dumps(dataclasses.asdict(plan))
    robots = _robots(plan)
    with contextlib.ExitStack() as stack:
        workers = stack.enter_context(_workers(threads, cluster))
        if out is not None:
            stack.enter_context(campaign_folder(out, dataclasses.asdict(plan)))
        rows = Rows(_schema(plan, robots), out)
        if cluster is None and len(rows.done) < len(plan):
            for data in plan.scenarios.values():  # compiling is no part of the time below
                rollout_for(plan, text_of(data))
        before, started = len(rows.done), time.perf_counter()
        tell = progress or (lambda done, total: None)
        tell(before, len(plan))
        try:
            if len(rows.done) < len(plan):
                _run(plan, text, rows, workers, tell)
        except KeyboardInterrupt:
            rows.flush()
            raise CampaignStopped(_stopped(len(rows.done), len(plan), out)) from None
        finally:
            rows.flush()
        wall_s = time.perf_counter() - started
        return Campaign(rows.table(), _columns(robots), len(rows.done) - before, wall_s, rows.damaged)


def make_plan(
    scenarios: Scenario | str | Path | Mapping[str, Scenario | str | Path], runs: int, vary: Mapping[str, str],
    parameter_sets: Sequence[Mapping[str, float]], seed: int,
) -> Plan:
    """The Plan of `montecarlo`, every name and number checked.

    Raises:
        InputError: as `montecarlo`.
    """
    named = named_scenarios(scenarios)
    if not 1 <= runs <= _MOST_RUNS:
        raise InputError(f"--runs: expected 1 to {_MOST_RUNS} runs, got {runs}")
    if not parameter_sets:
        raise InputError("a campaign needs at least one parameter set, got none")
    data = {name: _plain(scenario) for name, scenario in named.items()}
    rollouts = {name: rollout_of(text_of(scenario)) for name, scenario in data.items()}

    def known(key, where):
        found = [find_parameter(key, _variable(named[name], rollout), where) for name, rollout in rollouts.items()]
        return found[0]

    drawn = {
        known(key, "--vary"): parse_distribution(distribution, f"--vary {key}") for key, distribution in vary.items()
    }
    if len(drawn) < len(vary):
        raise InputError("--vary: the same parameter is named twice, expected once")
    sets = [{known(key, "parameter_sets"): float(value) for key, value in one.items()} for one in parameter_sets]
    for scenario in named.values():
        for key, distribution in drawn.items():
            draws = distribution.draws(seed, key, range(runs))
            _check_range(scenario, key, (draws.min(), draws.max()), f"--vary {key}={distribution}")
        for key in {key for one in sets for key in one}:
            values = [one[key] for one in sets if key in one]
            _check_range(scenario, key, (min(values), max(values)), "parameter_sets")
    code = {name: rollout.digest[:16] for name, rollout in rollouts.items()}
    return Plan(data, sets, {key: str(distribution) for key, distribution in drawn.items()}, runs, seed, code)


def parameters_of(scenario: Scenario) -> dict[str, float]:
    """name -> value of what a campaign of `scenario` can vary.

    Raises:
        InputError: values that do not go together.
    """
    rollout = rollout_of(text_of(_plain(scenario)))
    values = dict(zip(rollout.parameter_names, map(float, rollout.parameters), strict=True))
    return {name: values[name] for name in variable(_variable(scenario, rollout))}


# -- where the work is done ----------------------------------------------------------------------------------------


@contextlib.contextmanager
def _workers(threads: int | None, cluster: str | None) -> Iterator[joblib.Parallel]:
    """The workers that run batches: threads here (the compiled function holds no lock), or those of a Dask cluster."""
    options = {"return_as": "generator_unordered", "batch_size": 1, "pre_dispatch": "3 * n_jobs"}
    if cluster is None:
        if threads is not None and not 1 <= threads <= 1024:
            raise InputError(f"--threads: expected 1 to 1024, got {threads}")
        yield joblib.Parallel(threads or joblib.cpu_count(), backend="threading", **options)
        return
    if threads is not None:
        raise InputError("--threads: is for this machine, expected it left out with --cluster")
    try:
        from dask.distributed import Client, KilledWorker
    except ImportError:
        raise InputError("--cluster: needs Dask, expected `pip install drake_ispace[cluster]`") from None
    if not re.fullmatch(r"(tcp|tls|ws|wss|ucx)://\S+:\d+", cluster):
        raise InputError(f"--cluster {shown(cluster)}: expected the address of a Dask scheduler, as tcp://host:8786")
    try:
        client = Client(cluster, timeout=_CLUSTER_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--cluster {shown(cluster)}: expected a Dask scheduler, none answers ({_first_line(error)})"
        ) from None
    for name in ("distributed.client", "distributed.utils", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is said below
    try:
        with client, joblib.parallel_config("dask", client=client, wait_for_workers_timeout=_CLUSTER_S):
            yield joblib.Parallel(-1, **options)
    except (OSError, ImportError, CancelledError, KilledWorker) as error:
        raise InputError(
            f"--cluster {shown(cluster)}: the runs failed there ({_first_line(error)}), expected workers that stay and "
            "have drake_ispace installed; with --out the same call does the rest"
        ) from None


def _run(plan: Plan, text: str, rows: Rows, parallel: joblib.Parallel, tell: Callable[[int, int], None]) -> None:
    """Do what is missing in `rows`, some runs at a time."""
    longest = max(scenario_of(text_of(data)).seconds for data in plan.scenarios.values())
    size = max(1, min(100, _BATCH_TICKS // ticks_in(longest)))
    missing = (number for number in range(len(plan)) if number not in rows.done)
    batches = iter(lambda: list(islice(missing, size)), [])
    results = parallel(joblib.delayed(run_rows)(text, numbers) for numbers in batches)
    try:
        for batch in results:
            rows.add(batch)
            tell(len(rows.done), len(plan))
    finally:
        results.close()


def _stopped(done, total, out):
    kept = f"they are kept in {out} and the same call does the rest" if out else "with --out they would be kept"
    return f"stopped after {done} of {total} runs, {kept}"


def _plain(scenario):
    """The scenario as plain data that means the same on every machine; the seed is the campaign's."""
    sections = {}
    for name in robots():
        section = getattr(scenario, name)
        if section.trajectory.csv is not None:
            vertices = build_path(section.trajectory, f"{name}.trajectory").points_m
            points = np.vstack([vertices[0::2], vertices[-1:]]).tolist()  # an edge of a Path is two rows
            trajectory = dataclasses.replace(section.trajectory, csv=None, points_m=points)
            sections[name] = dataclasses.replace(section, trajectory=trajectory)
    data = difference(dataclasses.replace(scenario, seed=0, **sections))
    return {"diagram": scenario.diagram, "seconds": scenario.seconds} | data


# -- the columns -----------------------------------------------------------------------------------------------------


def _variable(scenario, rollout):
    """Parameters of the scenario's own blocks."""
    return own_names(rollout.parameter_names, entry_of(scenario).robots)


def _robots(plan):
    """Names of the robots of every scenario."""
    return [list(CATALOG[data["diagram"]].robots) for data in plan.scenarios.values()]


def _columns(robots):
    return list(dict.fromkeys(column(robot, name, group) for group in robots for robot in group for name in METRICS))


def _schema(plan, robots):
    fields = [("run", pa.int64()), ("scenario", pa.string()), ("seed", pa.int64())]
    fields += [(key, pa.float64()) for key in plan.keys]
    fields += [("diverged", pa.bool_()), ("diverged_at_s", pa.float64())]
    return pa.schema(fields + [(name, pa.float64()) for name in _columns(robots)])


def _check_range(scenario, key, values, where):
    """Refuse values that the scenario's own field, where it has one of that name, would not take."""
    names = key.replace("_", ".", 1).split(".")
    target, kind = scenario, None
    for name in names:
        fields = {f.name: f for f in dataclasses.fields(target)} if dataclasses.is_dataclass(target) else {}
        if name not in fields:
            return
        kind, target = fields[name].type, getattr(target, name)
    if kind not in (int, float, float | None):
        return
    for value in values:
        value = int(value) if kind is int and float(value).is_integer() else float(value)
        for name in reversed(names):
            value = {name: value}
        read(scenario, value, where)


def _first_line(error):
    return (str(error).splitlines() or [type(error).__name__])[0]
