"""How fast a compiled rollout is, each answer a ratio to something measured beside it in the same run.

Beside Drake's Simulator of the same Diagram, beside the same arithmetic hand-written in C and in plain Python, beside
itself on two threads and in SIMD lanes, and beside other block-diagram simulators. Contenders take turns; a ratio is
the median over the repetitions, with the least and the most. What runs on one core is timed by that core's own clock
(CPU time of the thread or process), so a busy neighbour does not count; threads are timed by the wall. Compile time is
apart.
docs/performance.md holds the results of one machine.

    python benchmarks/rollout_speed.py [--json] [--quick] [--tiny] [--peers-python PYTHON]
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from _runs import options, print_json, print_table
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from rollout_speed import plain_loop as plain
from rollout_speed.hand_written import OPTIONS, HandWritten

import drake_ispace as di
from drake_ispace.blocks.block import in_one_context
from drake_ispace.blocks.rates import MAX_TICK, TICK_S, VISION_TICKS
from drake_ispace.rollout.compile import Rollout
from drake_ispace.rollout.lanes import lanes_of
from drake_ispace.simulation import make_simulator
from drake_ispace.wiring.catalog import CATALOG

_NOISY = ["omni.plant.slip.ratio=[0.1,0.1,0.1]", "omni.plant.slip.noise_std=[0.1,0.1,0.1]"]  # camera noise: by default
_PEERS = {
    "jaxonomy": "right, written here with sensors and computer as one block that counts its ticks",
    "pathsim": "right in this order of registration only: blocks due at one instant act in that order",
    "pathsim_reversed": "the same blocks registered in the opposite order",
    "bdsim": "right only with the camera's first view put in as initial value: events at t = 0 are dropped",
    "bdsim_as_it_is": "without it: the first 19 ticks steer by a camera that has seen nothing",
    "control": "one function for all, the plant sampled by hand: it connects no continuous to a sampled system",
}
_SAME = 1e-8
_REPETITIONS = {"tiny": 1, "quick": 5, "full": 9}
_TICKS = {"tiny": 400, "quick": 4000, "full": 20_000}  # of a run whose speed is compared with another's
_BEFORE_A_FLIP = 2000  # ticks; later the last bit of a sine may decide which count a wheel is at, and the runs part
_OFTEN = 20  # a compiled run of a few ticks is too short for the clock
_FIRST_USE = """
import sys, time
from drake_ispace import build_diagram, compile_diagram
imported = time.process_time()
diagram = build_diagram(sys.argv[1])
built = time.process_time()
compile_diagram(diagram).run(10)
print(imported, built - imported, time.process_time() - built)
"""


def omni_multirate():
    return di.build_diagram(di.load_scenario("omni_multirate", _NOISY))


def pendulum_multirate():
    return di.build_diagram(di.load_scenario("pendulum_multirate", [key.replace("omni", "pendulum") for key in _NOISY]))


_PLAIN = (("plain_loop", plain.plain_loop),)
_ROBOTS = (("omni_multirate", omni_multirate), ("pendulum_multirate", pendulum_multirate))  # what is also there in C


def shared_space():
    return di.build_diagram(di.load_scenario("shared_space", _NOISY))


def unlogged(diagram) -> Rollout:
    """The Diagram compiled with nothing logged but the first row of one output."""
    return di.compile_diagram(diagram, log={diagram.get_output_port(0).get_name(): MAX_TICK})


def on_this_core(function: Callable) -> float:
    """Seconds of this core that `function` takes."""
    started = time.thread_time()
    function()
    return time.thread_time() - started


def in_turns(repetitions: int, contenders: dict[str, Callable[[], float]]) -> dict[str, list[float]]:
    """Seconds of each contender at every repetition, after one turn that does not count."""
    taken: dict[str, list[float]] = {name: [] for name in contenders}
    for repetition in range(repetitions + 1):
        for name, contender in contenders.items():
            seconds = contender()
            if repetition:
                taken[name].append(seconds)
    return taken


def ratio(of: list[float], to: list[float]) -> dict[str, float]:
    """How often `to` fits into `of`: the median over the repetitions, the least and the most."""
    each = [a / b for a, b in zip(of, to, strict=True)]
    return {"ratio": statistics.median(each), "least": min(each), "most": max(each)}


def per_tick(seconds: list[float], ticks: int) -> float:
    """Nanoseconds."""
    return statistics.median(seconds) / ticks * 1e9


def compiled_vs_drake(repetitions, size):
    """The same Diagram in Drake's Simulator and compiled, with every output logged every tick, and with no log."""
    results = {}
    ticks = {"tiny": 100, "quick": 400, "full": 2000}[size]
    for name, make in _PLAIN if size == "tiny" else (*_PLAIN, *_ROBOTS[:1]):
        for logged in (True, False):
            simulator = make_simulator(make())[0] if logged else _bare_simulator(make())
            rollout = di.compile_diagram(make()) if logged else unlogged(make())
            reached = [0]

            def drake(simulator=simulator, reached=reached):
                reached[0] += ticks
                with in_one_context(simulator.get_system(), simulator.get_context()):  # as `simulate` does
                    return on_this_core(lambda: simulator.AdvanceTo(reached[0] * TICK_S))

            def compiled(rollout=rollout):
                return on_this_core(lambda: [rollout.run(ticks) for _ in range(_OFTEN)]) / _OFTEN

            contenders = {"drake": drake, "compiled": compiled}
            if name == "plain_loop" and not logged:
                contenders["python"] = lambda: on_this_core(lambda: plain.scalar_python(ticks))
            taken = in_turns(repetitions, contenders)
            results[f"{name}, {'all outputs logged' if logged else 'no logs'}"] = {
                **ratio(taken["drake"], taken["compiled"]),
                **{f"{who}_ns_per_tick": per_tick(seconds, ticks) for who, seconds in taken.items()},
                **({"python_vs_drake": ratio(taken["drake"], taken["python"])} if "python" in taken else {}),
            }
    return results


def _bare_simulator(diagram):
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", TICK_S).set_fixed_step_mode(True)
    simulator.Initialize()
    return simulator


def compiled_vs_c(repetitions, size):
    """Time beside the faster of two builds of the same arithmetic in C; below 1 the compiled Diagram is faster."""
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, make in _PLAIN if size == "tiny" else (*_PLAIN, *_ROBOTS):
            try:
                builds = {title: HandWritten(name, options, Path(folder)) for title, options in OPTIONS.items()}
            except FileNotFoundError as error:
                return {"skipped": str(error)}
            ticks = {"tiny": 2000, "quick": 20_000, "full": 100_000}[size] * (10 if name == "plain_loop" else 1)
            results[name] = _beside(builds, unlogged(make()), ticks, repetitions)
    return results


def _beside(builds, rollout, ticks, repetitions):
    start = rollout.continuous_state, rollout.discrete_state, rollout.parameters
    contenders = {title: lambda build=build: build.run(ticks, *start)[0] for title, build in builds.items()}
    contenders["compiled"] = lambda: on_this_core(lambda: rollout.run(ticks))
    taken = in_turns(repetitions, contenders)
    fastest = min(builds, key=lambda title: statistics.median(taken[title]))
    final = _final_state(rollout, _BEFORE_A_FLIP)
    return {
        **ratio(taken["compiled"], taken[fastest]), "fastest_c": fastest,
        **{f"{who}_ns_per_tick": per_tick(seconds, ticks) for who, seconds in taken.items()},
        "largest_difference": {
            title: float((np.abs(build.run(_BEFORE_A_FLIP, *start)[1] - final) / (1.0 + np.abs(final))).max())
            for title, build in builds.items()
        },
    }


def _final_state(rollout, ticks):
    x, d = rollout.continuous_state.copy(), rollout.discrete_state.copy()
    logs = [np.zeros((ticks // divisor + 1, size)) for size, divisor in rollout.logged.values()]
    rollout._function(0, ticks, x, d, rollout.parameters, np.empty((0, 0)), *logs)
    return np.concatenate([x, d])


def horizon(repetitions, size):
    """Time per tick and growth of memory with the length of a run; ratio: the longest to the shortest, per tick."""
    rollout = unlogged(omni_multirate())
    longest = 10 if size == "tiny" else 1000  # s
    lengths = {f"{seconds} s": round(seconds / TICK_S) for seconds in (1, 10, 100, 1000) if seconds <= longest}
    often = {name: max(1, round(min(longest, 100) / TICK_S) // ticks) for name, ticks in lengths.items()}

    def run(name):
        return on_this_core(lambda: [rollout.run(lengths[name]) for _ in range(often[name])]) / often[name]

    before = _resident_kib()
    taken = in_turns(repetitions, {name: lambda name=name: run(name) for name in lengths})
    each = {name: [s / lengths[name] for s in seconds] for name, seconds in taken.items()}
    return {
        **ratio(each[f"{longest} s"], each["1 s"]),
        "ns_per_tick": {name: per_tick(seconds, lengths[name]) for name, seconds in taken.items()},
        "memory_growth_kib": _resident_kib() - before,
    }


def _resident_kib():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024


def robots(repetitions, size):
    """A tick of both robots in one room to a tick of the omni robot alone; tiny: of the other robot alone."""
    ticks = _TICKS[size]
    alone, other = _ROBOTS if size == "tiny" else (_ROBOTS[0], ("shared_space", shared_space))
    rollouts = {name: unlogged(make()) for name, make in (alone, other)}
    taken = in_turns(repetitions, {n: lambda r=r: on_this_core(lambda: r.run(ticks)) for n, r in rollouts.items()})
    return {
        **ratio(taken[other[0]], taken[alone[0]]),
        "ns_per_tick": {name: per_tick(seconds, ticks) for name, seconds in taken.items()},
    }


def threads_2_vs_1(repetitions, size):
    """Rollouts a second on two threads to one. `ratio`: by the wall, other programs on this machine count against it;
    `less_waiting`: without the time that a thread was ready to run and had no core."""
    rollout = unlogged(omni_multirate())
    runs, ticks = 16, _TICKS[size]

    def work(count):
        started, waited = time.perf_counter(), _waited_s()
        for _ in range(count):
            rollout.run(ticks)
        return time.perf_counter() - started - (_waited_s() - waited)

    busy: dict[int, list[float]] = {1: [], 2: []}

    def on(threads):
        with ThreadPoolExecutor(threads) as pool:
            started = time.perf_counter()
            busy[threads].append(max(pool.map(work, [runs // threads] * threads)))
            return time.perf_counter() - started

    taken = in_turns(2 * repetitions, {"one": lambda: on(1), "two": lambda: on(2)})
    return {
        **ratio(taken["one"], taken["two"]), "less_waiting": ratio(busy[1], busy[2])["ratio"], "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
    }


def _waited_s():
    """How long this thread has waited for a core so far; Linux only."""
    try:
        return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) * 1e-9
    except (OSError, IndexError):
        return 0.0


def lanes_vs_single(repetitions, size):
    """Runs a second in SIMD lanes to one run after the other: every run with noise of its own, or all parameters."""
    results = {}
    for name, make in _PLAIN if size == "tiny" else (*_PLAIN, *_ROBOTS):
        single = unlogged(make())
        results[name] = _lanes(single, None if name == "plain_loop" else (), repetitions, size)
        if name != "plain_loop":
            results[f"{name}, all parameters differ"] = _lanes(single, None, repetitions, size)
    return results


def _lanes(single, varied, repetitions, size):
    started = time.thread_time()
    lanes = lanes_of(single, varied=varied)
    compile_s, runs, ticks = time.thread_time() - started, lanes.lanes, 2 * _TICKS[size]
    parameters = np.array([single.with_seed(seed) for seed in range(runs)])
    if varied is None:
        parameters *= 1.0 + 0.01 * np.random.default_rng(0).standard_normal(parameters.shape)
    one_by_one = lambda: [single.run(ticks, row) for row in parameters]  # noqa: E731
    taken = in_turns(repetitions, {
        "lanes": lambda: on_this_core(lambda: lanes.run(ticks, parameters)), "runs": lambda: on_this_core(one_by_one),
    })
    return {
        **ratio(taken["runs"], taken["lanes"]), "lanes": runs, "compile_s": compile_s,
        **{f"{who}_ns_per_tick_and_run": per_tick(seconds, ticks * runs) for who, seconds in taken.items()},
    }


def lanes_vs_c(repetitions, size):
    """Runs a second in SIMD lanes to those of the faster of two builds of the same arithmetic in C, on one core."""
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, make in _PLAIN if size == "tiny" else _ROBOTS:
            try:
                builds = {title: HandWritten(name, words, Path(folder)) for title, words in OPTIONS.items()}
            except FileNotFoundError as error:
                return {"skipped": str(error)}
            results[name] = _lanes_beside(builds, unlogged(make()), _TICKS[size], repetitions)
    return results


def _lanes_beside(builds, single, ticks, repetitions):
    lanes = lanes_of(single, varied=())
    parameters = np.array([single.with_seed(seed) for seed in range(lanes.lanes)])
    start = single.continuous_state, single.discrete_state, single.parameters
    contenders = {title: lambda build=build: build.run(ticks, *start)[0] for title, build in builds.items()}
    contenders["lanes"] = lambda: on_this_core(lambda: lanes.run(ticks, parameters)) / lanes.lanes
    taken = in_turns(repetitions, contenders)
    fastest = min(builds, key=lambda title: statistics.median(taken[title]))
    return {
        **ratio(taken[fastest], taken["lanes"]), "fastest_c": fastest,
        **{f"{who}_ns_per_tick": per_tick(seconds, ticks) for who, seconds in taken.items()},
    }


def peers(repetitions, size, python):
    """The plain loop in other simulators: how many times longer, how far the state log is from ours, over all ticks."""
    ticks = {"tiny": 100, "quick": 400, "full": 4000}[size]
    rollout = unlogged(plain.plain_loop())
    many = 200_000
    taken = in_turns(repetitions, {"ours": lambda: on_this_core(lambda: rollout.run(many))})
    ours = statistics.median(taken["ours"]) / many
    rows: list = []
    plain.scalar_python(ticks, rows)
    rows = np.array(rows)[:ticks]
    constants = {
        "mass": plain.MASS, "scale": plain.SCALE, "bias": plain.BIAS, "drift": plain.DRIFT, "goal": plain.GOAL,
        "k_p": plain.K_P, "k_d": plain.K_D,
    }
    request = {
        "ticks": ticks, "repetitions": repetitions if size == "full" else 1,
        "constants": {name: value.tolist() for name, value in constants.items()}
        | {"memory": plain.MEMORY, "tick_s": TICK_S, "vision_ticks": VISION_TICKS},
    }
    results = {}
    for name, words in _PEERS.items():
        module = name.partition("_")[0]
        look = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({module!r}) is None)"
        if subprocess.run([python, "-c", look], capture_output=True).returncode:
            results[name] = {"skipped": f"{module} is not installed, pip install {module}"}
            continue
        script = Path(__file__).with_name("rollout_speed") / "peers.py"
        asked = json.dumps({"peer": name, **request})
        answer = subprocess.run([python, script], input=asked, capture_output=True, text=True)
        if answer.returncode:
            results[name] = {"skipped": f"{module} stopped: {answer.stderr.strip().splitlines()[-1]}"}
            continue
        said = json.loads(answer.stdout.splitlines()[-1])
        apart = np.abs(np.array(said["log"]) - rows).max(axis=1)
        seconds = statistics.median(said["seconds"])
        results[name] = {
            "ratio": seconds / ticks / ours, "ns_per_tick": seconds / ticks * 1e9,
            "largest_difference": float(apart.max()), "final_difference": float(apart[-1]),
            "first_wrong_tick": int(np.argmax(apart > _SAME)) if (apart > _SAME).any() else None,
            "words": words + (f" ({said['said']!r})" if said.get("said") else ""),
        }
    return results


def first_use(size):
    """Name -> seconds to compile in an empty cache; name -> import, build, load in a second process."""
    compile_s, second = {}, {}
    for name in CATALOG if size == "full" else ["velocity_base" if size == "tiny" else "omni_multirate"]:
        with tempfile.TemporaryDirectory() as folder:
            emptied = {} if size == "tiny" else {"DRAKE_ISPACE_CACHE": folder}  # tiny: the cache as it is, for time
            environment = os.environ | emptied
            took = []
            for _ in range(1 if size == "tiny" else 2):
                command = [sys.executable, "-c", _FIRST_USE, name]
                out = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
                took.append([float(word) for word in out.stdout.split()])
        compile_s[name] = took[0][2]
        second[name] = dict(zip(("import", "build", "load"), took[-1], strict=True)) | {"total": sum(took[-1])}
    return compile_s, second


def main():
    python = {"default": sys.executable, "help": "a Python that has the other simulators"}
    asked = options(__doc__, peers_python=python)
    size = "tiny" if asked.tiny else "quick" if asked.quick else "full"
    repetitions, results = _REPETITIONS[size], {}

    def add(name, result, words):
        results[name] = result
        if not asked.json:
            show(name, words, result)

    with ThreadPoolExecutor(1) as beside:  # other processes, timed by their own clocks
        started = beside.submit(first_use, size)
        for part in (compiled_vs_drake, compiled_vs_c, horizon, robots, lanes_vs_single, lanes_vs_c):
            add(part.__name__, part(repetitions, size), part.__doc__)
        add("peers", peers(repetitions, size, asked.peers_python), peers.__doc__)
        compile_s, second_process_s = started.result()
    add("compile_s", compile_s, first_use.__doc__)
    add("second_process_s", second_process_s, first_use.__doc__)
    add("threads_2_vs_1", threads_2_vs_1(repetitions, size), threads_2_vs_1.__doc__)
    if asked.json:
        print_json(results)


def show(name, words, result):
    """A table; an entry that is itself a mapping is a row."""
    rows = result.items() if all(isinstance(value, dict) for value in result.values()) else [(name, result)]
    if not isinstance(next(iter(rows))[1], dict):
        rows = [(name, result)]
    print_table(f"{name}: {words}", ["what", "figures"], [[key, _figures(value)] for key, value in rows])


def _figures(value):
    if isinstance(value, dict):
        return ", ".join(f"{key} {_figures(inner)}" for key, inner in value.items())
    return f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
