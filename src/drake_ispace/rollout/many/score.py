"""The metrics of a campaign, added up tick by tick within the rollout, so that no logs are kept.

Small blocks beside the Diagram read its outputs in the sensing phase, which sees what a log of the tick holds.
"""

import math
from collections.abc import Iterable, Mapping

import numpy as np

from drake_ispace.blocks.block import Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import POSE, WAY_POINT
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.guide.paths import ROW, build_path, to_edge
from drake_ispace.scenario import Scenario
from drake_ispace.simulation import FALLEN_RAD, SPINNING_RAD_S

#: Name of a block -> its Spec, and where its inputs come from: input -> output of the Diagram.
Added = dict[str, tuple[Spec, dict[str, str]]]
BLOCKS = ("watch", "errors", "cross_track", "effort")
COUNT, SUM, SQUARES, LARGEST, LAST = range(5)  # of the position errors


@kernel
def _weight(tick, way_point, start_tick):
    """Return 1 from the tick on in which the way point starts, or 0."""
    return 1.0 if tick >= start_tick and way_point[WAY_POINT.tick] >= 0.0 else 0.0


@kernel
def watch(tick, xd, pose, motion, walls_m, spinning_rad_s, fallen_rad, out):
    """Keep the first tick in which the robot has fallen, spins, is outside of the room or is no number; -1: none."""
    within = abs(pose[POSE.x]) <= walls_m[0] and abs(pose[POSE.y]) <= walls_m[1]
    upright = abs(motion[2]) <= spinning_rad_s and abs(motion[0]) <= fallen_rad
    numbers = 0.0 * pose[POSE.phi] + 0.0 * motion[1] == 0.0
    out[0] = tick if xd[0] < 0.0 and not (within and upright and numbers) else xd[0]


@kernel
def add_errors(tick, xd, pose, way_point, start_tick, out):
    """Add up number, sum, squares, largest and last of the distances to the way point [m]."""
    weight = _weight(tick, way_point, start_tick)
    dx, dy = way_point[WAY_POINT.x] - pose[POSE.x], way_point[WAY_POINT.y] - pose[POSE.y]
    error = np.sqrt(dx * dx + dy * dy)
    out[COUNT] = xd[COUNT] + weight
    out[SUM] = xd[SUM] + weight * error
    out[SQUARES] = xd[SQUARES] + weight * (error * error)
    out[LARGEST] = max(xd[LARGEST], weight * error)
    out[LAST] = error if weight > 0.0 else xd[LAST]


@kernel
def add_cross_track(tick, xd, pose, way_point, start_tick, table, out):
    """Add up the squared distances to the path [m^2]; a step or pulse goes straight from x_d[1:3], the first place."""
    x, y = pose[POSE.x], pose[POSE.y]
    out[1] = x if tick == 0 else xd[1]
    out[2] = y if tick == 0 else xd[2]
    squared = np.inf
    if table.shape[0] == len(ROW):
        ex, ey = table[ROW.x] - out[1], table[ROW.y] - out[2]
        across = (x - out[1]) * ey - (y - out[2]) * ex
        length = ex * ex + ey * ey
        dx, dy = x - table[ROW.x], y - table[ROW.y]
        squared = across * across / length if length > 0.0 else dx * dx + dy * dy
    for edge in range(table.shape[0] // len(ROW) - 1):
        a, b = len(ROW) * edge, len(ROW) * (edge + 1)
        gap, _ = to_edge(table[a + ROW.x], table[a + ROW.y], table[b + ROW.x], table[b + ROW.y], x, y)
        squared = min(squared, gap)
    out[0] = xd[0] + (squared if _weight(tick, way_point, start_tick) > 0.0 else 0.0)


@kernel
def add_effort(tick, xd, torque, way_point, start_tick, out):
    """Add up the squared torques of all wheels [N^2 m^2]."""
    squares = 0.0
    for i in range(torque.shape[0]):
        squares += torque[i] * torque[i]
    out[0] = xd[0] + _weight(tick, way_point, start_tick) * squares


@kernel
def show(xd, out):
    copy(xd, out)


def added_blocks(scenario: Scenario, robots: list[str], outputs: Mapping[str, int]) -> Added:
    """Return the blocks that add up the metrics of `robots`; outputs: those of the Diagram -> size."""
    blocks: Added = {}
    for robot in robots:
        trajectory = getattr(scenario, robot).trajectory
        path = build_path(trajectory, f"{robot}.trajectory")
        own = {name: f"{robot}_{name}" for name in ("pose", "way_point", "torque")}
        leans = f"{robot}_balance" in outputs
        motion = f"{robot}_balance" if leans else f"{robot}_velocity"
        start = {"start_tick": float(ticks_in(trajectory.start_s))}
        walls = 0.5 * np.array([scenario.space.width_m, scenario.space.depth_m])
        limits = {
            "walls_m": walls, "spinning_rad_s": SPINNING_RAD_S, "fallen_rad": FALLEN_RAD if leans else math.inf,
        }
        kernels = {
            "watch": (watch, {"pose": own["pose"], "motion": motion}, limits, [-1.0]),
            "errors": (add_errors, {k: own[k] for k in ("pose", "way_point")}, start, np.zeros(5)),
            "cross_track": (
                add_cross_track, {k: own[k] for k in ("pose", "way_point")}, start | {"table": path.table.ravel()},
                np.zeros(3),
            ),
            "effort": (add_effort, {k: own[k] for k in ("torque", "way_point")}, start, np.zeros(1)),
        }
        if own["torque"] not in outputs:
            del kernels["effort"]
        for name, (update, inputs, parameters, state) in kernels.items():
            blocks[f"{robot}_{name}"] = Spec(
                inputs={name: outputs[output] for name, output in inputs.items()},
                outputs={"sums": Output(len(state), show)}, parameters=parameters, discrete_state=np.array(state),
                updates=(Update(update, Phase.SENSE),),
            ), inputs
    return blocks


def logs_of(blocks: Added) -> dict[str, int | None]:
    """Return what to log: the sums at the end of a tick too many, and at every tick whether a robot is lost."""
    return {f"{name}.sums": 1 if name.endswith("_watch") else None for name in blocks}


def own_names(names: Iterable[str], robots: Iterable[str]) -> list[str]:
    """Return the parameters among `names` that are not of blocks added for `robots`."""
    added = {f"{robot}_{block}" for robot in robots for block in BLOCKS}
    return [name for name in names if name.partition(".")[0] not in added]


def lost_at(logs: Mapping[str, np.ndarray]) -> int | None:
    """Return the first row in which one of the robots is lost, or None."""
    found = []
    for name, rows in logs.items():
        if name.endswith("_watch.sums"):
            lost = rows[np.isfinite(rows[:, 0]) & (rows[:, 0] >= 0.0), 0]
            ended = np.flatnonzero(~np.isfinite(rows[:, 0]))  # the rollout stopped before it could be seen
            found += [int(lost[0])] if len(lost) else [int(ended[0])] if len(ended) else []
    return min(found, default=None)


def metrics_of(robot: str, logs: Mapping[str, np.ndarray]) -> dict[str, float | None]:
    """Return the metrics of a robot that was not lost, by their names in metrics.py; None before its way point starts.
    """
    sums = {name.removeprefix(f"{robot}_").removesuffix(".sums"): rows[-1] for name, rows in logs.items()}
    errors, effort = sums["errors"], sums.get("effort")
    count = errors[COUNT]
    numbers = {
        "rms_position_error_m": math.sqrt(errors[SQUARES] / count) if count else None,
        "max_position_error_m": errors[LARGEST],
        "rms_cross_track_m": math.sqrt(sums["cross_track"][0] / count) if count else None,
        "final_error_m": errors[LAST], "iae_m_s": errors[SUM] * TICK_S,
        "control_effort": None if effort is None else effort[0] * TICK_S,
    }
    return {name: None if value is None or not count else float(value) for name, value in numbers.items()}
