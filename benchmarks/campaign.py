"""Monte Carlo at machine speed: 10,000 runs of 20 s of omni_multirate on two cores.

Measures wall time, rate and peak memory (also of a tenth of the runs: it should not grow with them), and two threads
against one, alternating. Then a campaign is killed with SIGKILL in the middle and called again, and the same campaign
runs on a Dask cluster of two worker processes on this machine: all must give the same table.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from pathlib import Path

from _runs import options, peak_mb, print_json, print_table

import drake_ispace as di
from drake_ispace.rollout.many.campaign import Campaign
from drake_ispace.rollout.many.table import read_campaign

VARY = {"omni_plant.mass_kg": "normal(7.31, 0.4)", "omni_plant.slip.ratio_x": "uniform(0, 0.2)"}
SECONDS, TINY_S = 20.0, 0.5

_CHILD = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from campaign import measured
runs, seconds, seed, out, cluster = json.loads(sys.argv[1])
print(json.dumps(measured(runs, seconds, seed, Path(out), cluster)))
"""


def campaign(
    runs: int, seconds: float, seed: int, out: Path | None = None, cluster: str | None = None, threads: int = 2,
) -> Campaign:
    """The campaign that all of this is about."""
    scenario = di.load_scenario("omni_multirate", [f"seconds={seconds}"])
    threads = None if cluster else threads
    return di.montecarlo(scenario, runs, vary=VARY, seed=seed, out=out, threads=threads, cluster=cluster)


def measured(runs: int, seconds: float, seed: int, out: Path, cluster: str | None = None) -> dict:
    """The campaign in this process: its wall time, the runs that it did, and the most memory of the process."""
    done = campaign(runs, seconds, seed, out, cluster)
    return {"wall_s": done.wall_s, "runs_now": done.runs_now, "peak_mb": peak_mb()}


def start(runs: int, seconds: float, seed: int, out: Path, cluster: str | None = None) -> subprocess.Popen:
    """The campaign in a process of its own, so that its memory is its own and it can be killed."""
    asked = json.dumps([runs, seconds, seed, str(out), cluster])
    words = [sys.executable, "-c", _CHILD, asked, str(Path(__file__).parent)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def finished(process: subprocess.Popen) -> dict:
    """What the process printed."""
    printed, _ = process.communicate()
    if process.returncode:
        raise SystemExit(process.returncode)
    return json.loads(printed)


def thread_ratio(runs: int, seconds: float, rounds: int) -> tuple[float, dict[int, float]]:
    """(median over rounds of the rate with two threads by that with one, median seconds), alternating."""
    wall: dict[int, list[float]] = {1: [], 2: []}
    for number in range(rounds):
        for threads in (1, 2) if number % 2 else (2, 1):
            wall[threads].append(campaign(runs, seconds, number, threads=threads).wall_s)
    ratios = [one / two for one, two in zip(wall[1], wall[2], strict=True)]
    return statistics.median(ratios), {threads: statistics.median(walls) for threads, walls in wall.items()}


def apart(*asked) -> dict:
    """As `measured`, in a process of its own."""
    return finished(start(*asked))


def killed_and_resumed(runs: int, seconds: float, seed: int, out: Path, whole: Path, again: Callable) -> dict:
    """Kill the campaign about half-way, call it `again`, compare with the uninterrupted one in `whole`."""
    process = start(runs, seconds, seed, out)
    while process.poll() is None and 500 * len(list(out.glob("part-*.parquet"))) < runs // 2:
        time.sleep(0.01)
    process.kill()
    process.communicate()
    kept = read_campaign(out).num_rows
    resumed = again(runs, seconds, seed, out)
    return {
        "rows_kept": kept, "rows_done_again": resumed["runs_now"],
        "same_table": read_campaign(out).equals(read_campaign(whole)),
    }


@contextmanager
def cluster_of_two(folder: Path):
    """The address of a Dask scheduler on the loopback interface, with two worker processes of one thread."""
    file, common = folder / "scheduler.json", ["--host", "127.0.0.1", "--no-dashboard"]
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:
        def launch(*words):
            process = subprocess.Popen([*dask, *words, *common, "--scheduler-file", str(file)], **quiet)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        launch("scheduler", "--port", "0")
        while not file.exists():
            time.sleep(0.05)
        for number in (1, 2):
            launch("worker", "--nthreads", "1", "--name", f"worker-{number}", "--local-directory", str(folder))
        yield json.loads(file.read_text())["address"]


def main() -> None:
    chosen = options(__doc__)
    runs, seconds = 1000 if chosen.quick or chosen.tiny else 10_000, TINY_S if chosen.tiny else SECONDS
    rounds = 1 if chosen.tiny else 3 if chosen.quick else 5
    of = measured if chosen.tiny else apart
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        campaign(2, seconds, chosen.seed)  # compiled and cached from here on
        whole = of(runs, seconds, chosen.seed, folder / "whole")
        tenth = of(runs // 10, seconds, chosen.seed, folder / "tenth")
        ratio, walls = thread_ratio(runs // 10, seconds, rounds)
        data = {
            "runs": runs, "seconds": seconds, "cores": os.cpu_count(), "wall_s": whole["wall_s"],
            "runs_per_s": runs / whole["wall_s"], "realtime_factor": runs * seconds / whole["wall_s"],
            "peak_memory_mb": whole["peak_mb"], "peak_memory_of_a_tenth_mb": tenth["peak_mb"], "threads_2_vs_1": ratio,
            "run_1_thread_ms": 1e3 * walls[1] / (runs // 10), "run_2_threads_ms": 1e3 * walls[2] / (runs // 10),
            "killed": killed_and_resumed(runs, seconds, chosen.seed, folder / "killed", folder / "whole", of),
        }
        try:
            import dask.distributed  # noqa: F401

            with cluster_of_two(folder) as address:
                remote = of(runs, seconds, chosen.seed, folder / "remote", address)
            same = read_campaign(folder / "remote").equals(read_campaign(folder / "whole"))
            data["dask"] = {"wall_s": remote["wall_s"], "same_table": same}
        except ImportError:
            data["dask"] = None
        if chosen.figures:
            from drake_ispace.report.pictures.montecarlo_plot import plot_campaign

            plot_campaign(campaign(runs, seconds, chosen.seed, folder / "whole"), chosen.figures / "montecarlo.png")
    if chosen.json:
        print_json(data)
        return
    rows = [[key, f"{value:,.4g}" if isinstance(value, float) else value] for key, value in data.items()]
    print_table(f"{runs:,} runs of {seconds:g} s of omni_multirate", ["quantity", "value"], rows)


if __name__ == "__main__":
    main()
