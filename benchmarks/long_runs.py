"""A million ticks (83 minutes) of every Diagram: do its numbers stay finite, and does memory grow with time?

Each Diagram runs compiled, in a process of its own, once for a tenth of the ticks and once for all of them. Memory is
what the process keeps beyond the logs, which it is asked for. --drake adds one Diagram in Drake's Simulator, at a
hundredth of the ticks.

    python benchmarks/long_runs.py [--json] [--quick] [--tiny] [--ticks TICKS] [--drake]
"""

import sys
from pathlib import Path

import numpy as np
from _runs import apart, options, print_json, print_table

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.simulation import first_divergence, simulate
from drake_ispace.wiring.catalog import CATALOG, build_diagram

_PART = 10_000  # ticks
_TICKS, _QUICK_TICKS, _TINY_TICKS = 1_000_000, 50_000, 400


def resident_mb() -> float:
    """Memory that this process keeps [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1]) if sys.platform == "linux" else 0
    return pages * 4096 / 1e6


def compiled(name: str, ticks: int) -> dict:
    """What a Diagram of the catalog does in so many ticks."""
    scenario = di.load_scenario(name)
    rollout = compile_diagram(build_diagram(scenario))
    rollout.run(10)
    beyond = []
    for length in (ticks // 10, ticks):
        before = resident_mb()
        logs = rollout.run(length)
        size = sum(log.nbytes for log in logs.values()) / 1e6
        lost = None
        for start in range(0, length, _PART):  # what looking at all rows at once needs is not what the run keeps
            part = {name: log[start : start + _PART] for name, log in logs.items()}
            if lost is None and (found := first_divergence(part, scenario.space)) is not None:
                lost = start + found
        finite = all(np.isfinite(log.sum()) for log in logs.values())
        del logs, part
        beyond.append(resident_mb() - before)
    return {"diagram": name, "ticks": ticks, "finite": finite, "lost_s": None if lost is None else lost * TICK_S,
            "logs_mb": size, "kept_after_a_tenth_mb": beyond[0], "kept_mb": beyond[1]}


def in_drake(name: str, ticks: int) -> dict:
    """The same in Drake's Simulator, its own logs included in what it keeps."""
    simulate(di.load_scenario(name, ["seconds=0.1"]))
    before, kept = resident_mb(), []
    for length in (ticks // 10, ticks):
        run = simulate(di.load_scenario(name, [f"seconds={length * TICK_S:.6f}"]))
        kept.append(resident_mb() - before)
    size = sum(log.nbytes for log in run.signals.values()) / 1e6
    finite = all(np.isfinite(log).all() for log in run.signals.values())
    return {"diagram": f"{name} (Drake)", "ticks": ticks, "finite": finite, "lost_s": run.diverged_s, "logs_mb": size,
            "kept_after_a_tenth_mb": kept[0], "kept_mb": kept[1]}


def main():
    asked = options(
        __doc__, ticks={"type": int, "help": f"of every Diagram, default {_TICKS}"},
        drake={"action": "store_true", "help": "omni_multirate in Drake's Simulator, too"},
    )
    ticks = asked.ticks or (_TINY_TICKS if asked.tiny else _QUICK_TICKS if asked.quick else _TICKS)
    names = list(CATALOG)[: 1 if asked.tiny else None]
    jobs = [(compiled, name, ticks) for name in names]
    if asked.drake:
        jobs.append((in_drake, "omni_multirate", max(ticks // 100, 10)))
    rows = []
    for function, name, count in jobs:
        rows.append(function(name, count) if asked.tiny else apart(function, name, count))
    if asked.json:
        print_json({"runs": rows})
        return
    print_table("Long runs", ["Diagram", "ticks", "finite", "lost", "logs [MB]", "kept after a tenth", "kept [MB]"], [[
        row["diagram"], f"{row['ticks']}", "yes" if row["finite"] else "NO",
        "" if row["lost_s"] is None else f"{row['lost_s']:.1f} s", f"{row['logs_mb']:.0f}",
        f"{row['kept_after_a_tenth_mb']:.1f}", f"{row['kept_mb']:.1f}",
    ] for row in rows])


if __name__ == "__main__":
    main()
