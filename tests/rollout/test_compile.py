"""compile_diagram: nested Diagrams, exported inputs, Drake's primitives, run-time parameters, the cache on disk."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Demultiplexer,
    DiscreteTimeDelay,
    Gain,
    Integrator,
    MatrixGain,
    Multiplexer,
    Saturation,
    ZeroOrderHold,
)

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import cache_folder, kernel
from drake_ispace.blocks.rates import MAX_TICK, TICK_S
from drake_ispace.rollout import compile as compile_module
from drake_ispace.rollout.compile import compile_diagram, kernel_text
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import make_simulator
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import build_diagram


@kernel
def fall(xc, force, mass, out):
    out[0], out[1] = xc[1], force[0] / mass


@kernel
def show_state(xc, out):
    out[0], out[1] = xc[0], xc[1]


@kernel
def count(tick, xd, out):
    out[0], out[1] = np.sin(0.01 * tick), xd[1] + 1.0


@kernel
def show_memory(xd, out):
    out[0], out[1] = xd[0], xd[1]


@kernel
def double(xd, out):
    out[0] = 2.0 * xd[0]


@kernel
def add_one(xd, out):
    out[0] = xd[0] + 1.0


@kernel
def show_one(xd, out):
    out[0] = xd[0]


@kernel
def weighted(xc, d, x, next, out):
    out[0] = d[0] * xc[0] + 10.0 * x + 100.0 * next


@kernel
def decay(xc, xd, d, k1, out):
    out[0] = -d[0] * xc[0] + k1 + xd[0]


@kernel
def scaled(u, gain, out):
    out[0] = gain * u[0]


@kernel
def scaled_b(u, b_gain, out):
    out[0] = b_gain * u[0]


@numba.njit
def not_a_kernel(xd, out):
    out[0] = xd[0]


class Mass(Block):
    """A mass that a force pushes."""

    def __init__(self, mass=2.0):
        super().__init__(Spec(
            inputs={"force": 1}, outputs={"state": Output(2, show_state)}, parameters={"mass": mass},
            continuous_state=np.array([0.3, 0.0]), derivatives=fall,
        ))


class Counter(Block):
    """A sine and a count, sampled every 3 ticks from tick 2 on."""

    def __init__(self):
        super().__init__(Spec(
            outputs={"count": Output(2, show_memory)}, discrete_state=np.zeros(2),
            updates=(Update(count, Phase.SENSE, 3, 2),),
        ))


def drake_log(diagram, ticks):
    simulator, sinks = make_simulator(diagram)
    simulator.AdvanceTo(ticks * TICK_S)
    return {name: sink.FindLog(simulator.get_context()).data().T for name, sink in sinks.items()}


def primitives_diagram():
    """Every primitive of Drake that a rollout knows, in one loop around a mass, with a nested Diagram."""
    inner = DiagramBuilder()
    mass = inner.AddNamedSystem("mass", Mass())
    hold = inner.AddNamedSystem("hold", ZeroOrderHold(2 * TICK_S, 1))
    inner.Connect(hold.get_output_port(), mass.get_input_port())
    inner.ExportInput(hold.get_input_port(), "force")
    inner.ExportOutput(mass.get_output_port(), "state")
    plant = inner.Build()
    plant.set_name("plant")
    bench = Bench()
    bench.add("plant", plant)
    bench.add("counter", Counter())
    bench.add("split", Demultiplexer([1, 1]))
    bench.add("join", Multiplexer([1, 1, 2]))
    bench.add("gain", Gain([-3.0, -1.5]))
    bench.add("mix", MatrixGain(np.array([[1.0, 0.5, 0.25, 0.01]])))
    bench.add("limit", Saturation([-0.4], [0.5]))
    bench.add("late", DiscreteTimeDelay(TICK_S, 3, 1))
    bench.add("bias", ConstantVectorSource([0.05]))
    bench.add("sum", Adder(2, 1))
    bench.wire(
        ("plant.state", "gain.u0"), ("gain.y0", "split.u0"), ("split.y0", "join.u0"), ("split.y1", "join.u1"),
        ("counter.count", "join.u2"), ("join.y0", "mix.u0"), ("mix.y0", "limit.u0"), ("limit.y0", "late.u"),
        ("late.delayed_u", "sum.u0"), ("bias.y0", "sum.u1"), ("sum.sum", "plant.force"),
    )
    bench.show(state="plant.state", force="sum.sum", count="counter.count", mixed="mix.y0")
    return bench.build("primitives")


def one_block(spec, name="block", port="y"):
    bench = Bench()
    bench.add(name, Block(spec))
    bench.show(y=f"{name}.{port}")
    return bench.build("one_block")


@pytest.mark.parametrize(("updates", "expected"), [
    ((Update(double, Phase.SENSE, 2), Update(add_one, Phase.SENSE, 1)), [0, 1, 2, 5, 6, 13]),
    ((Update(add_one, Phase.SENSE, 2, 2), Update(double, Phase.SENSE, 1)), [0, 0, 0, 2, 4, 10]),
])
def test_updates_of_one_block_act_in_the_order_declared(updates, expected):
    def diagram():
        return one_block(Spec(outputs={"y": Output(1, show_one)}, discrete_state=np.zeros(1), updates=updates))

    assert drake_log(diagram(), 5)["y"].ravel().tolist() == expected
    assert compile_diagram(diagram()).run(5)["y"].ravel().tolist() == expected


def test_parameters_may_have_any_name():
    def diagram():
        return one_block(Spec(
            outputs={"y": Output(1, weighted)}, continuous_state=np.array([0.7]), derivatives=decay,
            discrete_state=np.zeros(1), updates=(Update(add_one, Phase.COMPUTE),),
            parameters={"d": np.array([3.0]), "x": 5.0, "next": 7.0, "k1": 0.25},
        ), name="1st.block")

    np.testing.assert_array_equal(compile_diagram(diagram()).run(40)["y"], drake_log(diagram(), 40)["y"])


def test_names_that_read_alike_stay_apart():
    def diagram():
        bench = Bench()
        bench.add("source", ConstantVectorSource([1.0]))
        bench.add("a", Block(Spec(inputs={"u": 1}, outputs={"y": Output(1, scaled_b)}, parameters={"b_gain": 2.0})))
        for name, gain in (("a_b", 3.0), ("a.b", 5.0), ("test_compile", 7.0), ("log_a", 11.0), ("np", 13.0)):
            bench.add(name, Block(Spec(
                inputs={"u": 1}, outputs={"y": Output(1, scaled)}, parameters={"gain": gain, "scaled": 0.0},
            )))
        bench.wire(*(("source.y0", f"{name}.u") for name in names))
        return bench.build("alike")

    names = ("a", "a_b", "a.b", "test_compile", "log_a", "np")
    log = {f"{name}.y": 1 for name in names}
    logs = compile_diagram(diagram(), log=log).run(1)
    assert [rows[1, 0] for rows in logs.values()] == [2.0, 3.0, 5.0, 7.0, 11.0, 13.0]


def test_logs_that_read_alike_stay_apart():
    bench = Bench()
    bench.add("a", ConstantVectorSource([1.0]))
    bench.add("b", ConstantVectorSource([2.0]))
    bench.show(**{"a.y0": "b.y0", "a_y0": "a.y0"})
    logs = compile_diagram(bench.build("alike")).run(1)
    assert (logs["a.y0"][1, 0], logs["a_y0"][1, 0]) == (2.0, 1.0)


def test_two_systems_with_one_path_are_refused():
    inner = DiagramBuilder()
    inner.AddNamedSystem("b", ConstantVectorSource([1.0]))
    plant = inner.Build()
    plant.set_name("a")
    outer = DiagramBuilder()
    outer.AddSystem(plant)
    outer.AddNamedSystem("a/b", ConstantVectorSource([2.0]))
    with pytest.raises(InputError, match="two systems are called a/b"):
        compile_diagram(outer.Build())


def unnamed_diagram():
    inner = DiagramBuilder()
    source, gain = inner.AddSystem(ConstantVectorSource([1.5])), inner.AddSystem(Gain(2.0, 1))
    inner.Connect(source.get_output_port(), gain.get_input_port())
    inner.ExportOutput(gain.get_output_port())
    outer = DiagramBuilder()
    outer.ExportOutput(outer.AddSystem(inner.Build()).get_output_port())
    return outer.Build()


def test_systems_without_a_name_are_named_after_their_type():
    one, other = unnamed_diagram(), unnamed_diagram()
    rollout, again = compile_diagram(one), compile_diagram(other)
    assert "@" not in rollout.source + "".join(rollout.parameter_names) + "".join(rollout.logged)
    assert rollout.source == again.source and rollout.parameter_names == again.parameter_names
    (rows,) = rollout.run(1).values()
    assert rows[1, 0] == 3.0


def test_a_function_of_njit_alone_is_refused():
    spec = Spec(outputs={"y": Output(1, not_a_kernel)}, discrete_state=np.zeros(1))
    with pytest.raises(InputError, match=r"block: not_a_kernel is compiled with numba\.njit alone, .*@kernel"):
        compile_diagram(one_block(spec))


@pytest.mark.parametrize(("arguments", "words"), [
    ({"ticks": -1}, "run of -1 ticks"),
    ({"ticks": MAX_TICK + 1}, "expected 0 to"),
    ({"ticks": 1, "parameters": [1.0, 2.0]}, r"parameters: is an array \(2,\), expected \(1,\)"),
    ({"ticks": 1, "continuous_state": np.zeros((2, 1))}, "continuous_state"),
    ({"ticks": 1, "discrete_state": [0.0]}, "discrete_state"),
    ({"ticks": 2, "inputs": {"force": np.zeros((1, 2))}}, r"is an array \(1, 2\), expected \(2, 1\)"),
    ({"ticks": 2, "inputs": {"force": np.zeros((2, 1, 1))}}, "is an array"),
])
def test_arrays_of_another_size_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        driven_mass().run(**{"inputs": {"force": np.zeros(2)}, **arguments})


def driven_mass():
    bench = Bench()
    bench.add("mass", Mass())
    bench.show(state="mass.state")
    bench.let_in(force="mass.force")
    return compile_diagram(bench.build("driven"))


def test_read_only_arrays_are_taken_without_compiling_again():
    rollout, force = driven_mass(), np.ones((5, 1))
    parameters = rollout.parameters.copy()
    for array in (force, parameters):
        array.flags.writeable = False
    rollout.run(5, parameters, inputs={"force": force})
    assert len(rollout._function.signatures) == 1


def test_a_log_shows_the_input_of_its_own_tick():
    bench = Bench()
    bench.add("gain", Block(Spec(inputs={"u": 1}, outputs={"y": Output(1, scaled)}, parameters={"gain": 2.0})))
    bench.show(y="gain.y")
    bench.let_in(u="gain.u")
    rows = compile_diagram(bench.build("through")).run(4, inputs={"u": [1.0, 2.0, 3.0, 4.0]})["y"]
    assert rows.ravel().tolist() == [2.0, 4.0, 6.0, 8.0, 8.0]


def late_counter(ticks):
    bench = Bench()
    bench.add("counter", Counter())
    bench.add("late", DiscreteTimeDelay(TICK_S, ticks, 2))
    bench.wire(("counter.count", "late.u"))
    bench.show(late="late.delayed_u")
    return bench.build("delay")


def test_a_long_delay_delays():
    rows = compile_diagram(late_counter(4000)).run(4100)["late"]
    assert np.ptp(rows[4010:, 1]) > 0.0
    np.testing.assert_array_equal(rows, drake_log(late_counter(4000), 4100)["late"])


def test_a_longer_delay_is_no_longer_text_to_compile():
    short, long = (kernel_text(late_counter(ticks)) for ticks in (4, 4000))
    assert long.count("\n") == short.count("\n")


def test_no_logs_means_none():
    assert compile_diagram(primitives_diagram(), log={}).run(3) == {}


@pytest.mark.parametrize("divisor", [0, -1, 1.5, True, "2"])
def test_a_divisor_is_a_whole_number(divisor):
    with pytest.raises(InputError, match="expected a whole number from 1 on"):
        compile_diagram(primitives_diagram(), log={"state": divisor})


def test_the_text_is_there_without_compiling(monkeypatch):
    expected = small_rollout().source
    monkeypatch.setattr(compile_module, "machine_code", lambda *arguments: pytest.fail("compiled"))
    bench = Bench()
    bench.add("counter", Counter())
    bench.show(count="counter.count")
    assert kernel_text(bench.build("small")) == expected


def test_without_a_folder_to_write_to_it_compiles_all_the_same(monkeypatch):
    expected = small_rollout().run(20)["count"]
    monkeypatch.setattr(compile_module, "cache_folder", lambda part: None)
    assert np.array_equal(small_rollout().run(20)["count"], expected)


def test_drakes_primitives_and_nested_diagrams_agree():
    drake = drake_log(primitives_diagram(), 300)
    compiled = compile_diagram(primitives_diagram()).run(300)
    assert np.ptp(drake["state"][:, 0]) > 0.05
    for name, rows in drake.items():  # MatrixGain multiplies through Eigen, whose order of additions may differ
        np.testing.assert_allclose(compiled[name], rows, rtol=0, atol=1e-12, err_msg=name)


def test_an_exported_input_is_driven_by_a_recorded_signal():
    bench = Bench()
    bench.add("mass", Mass(mass=2.0))
    bench.show(state="mass.state")
    bench.let_in(force="mass.force")
    rollout = compile_diagram(bench.build("driven"))
    force = np.where(np.arange(100) < 50, 1.0, 0.0)
    state = rollout.run(100, inputs={"force": force})["state"]
    speed = 0.5 * 50 * TICK_S  # v = F t / m
    np.testing.assert_allclose(state[[50, 100], 1], speed, rtol=1e-12)
    packed = rollout.packed(100, {"force": force})
    assert np.array_equal(rollout.run(100, inputs=packed)["state"], state)


@pytest.mark.parametrize(("inputs", "words"), [
    ({}, "no signal"), ({"force": np.zeros(3)}, "3 rows"), ({"pull": np.zeros(9)}, "'pull'"),
    (np.zeros((9, 2)), "packed inputs"),
])
def test_a_wrong_recorded_signal_is_refused(inputs, words):
    bench = Bench()
    bench.add("mass", Mass())
    bench.show(state="mass.state")
    bench.let_in(force="mass.force")
    rollout = compile_diagram(bench.build("driven"))
    with pytest.raises(InputError, match=words):
        rollout.run(9, inputs=inputs)


def test_an_unknown_system_is_named():
    bench = Bench()
    bench.add("mass", Mass())
    bench.add("sum_up", Integrator(2))
    bench.add("zero", ConstantVectorSource([0.0]))
    bench.wire(("mass.state", "sum_up.u0"), ("zero.y0", "mass.force"))
    bench.show(state="mass.state")
    with pytest.raises(InputError, match="sum_up is a Integrator, which a compiled rollout does not know"):
        compile_diagram(bench.build("unknown"))


def test_an_input_that_nothing_feeds_is_named():
    bench = Bench()
    bench.add("mass", Mass())
    bench.show(state="mass.state")
    with pytest.raises(InputError, match="mass: nothing feeds the input port 'force'"):
        compile_diagram(bench.build("loose"))


def test_a_period_off_the_tick_is_refused():
    bench = Bench()
    bench.add("zero", ConstantVectorSource([0.0]))
    bench.add("hold", ZeroOrderHold(0.0123, 1))
    bench.wire(("zero.y0", "hold.u"))
    bench.show(held="hold.y")
    with pytest.raises(InputError, match=r"hold: period 0\.0123 s"):
        compile_diagram(bench.build("odd"))


@kernel
def follow(xc, target, out):
    out[0] = 5.0 * (target[0] - xc[0])


@kernel
def saw(tick, out):
    out[0] = 0.1 * (tick % 7)


@kernel
def show_place(xc, out):
    out[0] = xc[0]


def follower():
    return Block(Spec(
        inputs={"target": 1}, outputs={"place": Output(1, show_place)}, continuous_state=np.ones(1), derivatives=follow,
    ))


@pytest.mark.parametrize("led_by", ["a continuous state", "the tick"])
def test_what_moves_within_a_step_is_evaluated_at_every_stage(led_by):
    bench = Bench()
    bench.add("one", follower())
    bench.add("other", follower())
    bench.add("saw", Block(Spec(outputs={"y": Output(1, saw)})))
    bench.wire(("saw.y", "one.target"), ("one.place" if led_by == "a continuous state" else "saw.y", "other.target"))
    bench.show(place="other.place")
    diagram = bench.build("led")
    np.testing.assert_array_equal(compile_diagram(diagram).run(40)["place"], drake_log(diagram, 40)["place"])


@pytest.mark.parametrize("offset", [0, 1])
def test_a_hold_with_an_offset_samples_as_in_drake(offset):
    bench = Bench()
    bench.add("counter", Counter())
    bench.add("hold", ZeroOrderHold(2 * TICK_S, 2, offset * TICK_S))
    bench.wire(("counter.count", "hold.u"))
    bench.show(held="hold.y")
    diagram = bench.build("later")
    held = compile_diagram(diagram).run(12)["held"]
    np.testing.assert_array_equal(held, drake_log(diagram, 12)["held"])
    assert np.ptp(held[:, 0]) > 0.0


def test_a_new_mass_needs_no_new_compilation(monkeypatch):
    scenario = load_scenario("omni_multirate", ["seconds=2", "omni.control.gains=given"])
    rollout = compile_diagram(build_diagram(scenario))
    monkeypatch.setattr(compile_module, "machine_code", lambda *arguments: pytest.fail("compiled again"))
    heavy = rollout.run(400, rollout.with_parameters({"omni_plant.mass_kg": 9.0}))
    assert np.abs(heavy["omni_pose"] - rollout.run(400)["omni_pose"]).max() > 1e-4
    built = load_scenario("omni_multirate", ["seconds=2", "omni.control.gains=given", "omni.plant.mass_kg=9.0",
                                             "omni.control.acceleration_feed_forward=false"])
    monkeypatch.undo()
    same = compile_diagram(build_diagram(built))
    light = same.run(400, same.with_parameters({"omni_plant.mass_kg": 7.31}))
    assert not np.array_equal(light["omni_pose"], same.run(400)["omni_pose"])


def test_a_changed_parameter_equals_a_diagram_built_with_it():
    base = load_scenario("pendulum_multirate", ["seconds=2"])
    rollout = compile_diagram(build_diagram(base))
    varied = rollout.run(400, rollout.with_parameters({"pendulum_plant.slip.ratio_x": 0.2}))
    built = load_scenario("pendulum_multirate", ["seconds=2", "pendulum.plant.slip.ratio=[0.2, 0, 0]"])
    expected = compile_diagram(build_diagram(built)).run(400)
    assert np.array_equal(varied["pendulum_pose"], expected["pendulum_pose"])


def test_a_seed_at_run_time_equals_a_diagram_built_with_it():
    rollout = compile_diagram(build_diagram(load_scenario("omni_multirate", ["seed=1"])))
    expected = compile_diagram(build_diagram(load_scenario("omni_multirate", ["seed=7"]))).run(400)
    assert np.array_equal(rollout.run(400, rollout.with_seed(7))["omni_pose"], expected["omni_pose"])


def test_values_of_the_context_are_taken():
    bench = Bench()
    mass = bench.add("mass", Mass())
    bench.add("push", ConstantVectorSource([4.0]))
    bench.wire(("push.y0", "mass.force"))
    bench.show(state="mass.state")
    diagram = bench.build("moving")
    context = diagram.CreateDefaultContext()
    own = mass.GetMyMutableContextFromRoot(context)
    own.SetContinuousState([1.0, 2.0])
    own.get_mutable_numeric_parameter(0).SetFromVector([8.0])
    state = compile_diagram(diagram, context).run(1)["state"]
    np.testing.assert_allclose(state[:, 1], [2.0, 2.0 + 0.5 * TICK_S], rtol=1e-12)


def test_logs_at_a_divisor_are_rows_of_the_full_log():
    diagram = build_diagram(load_scenario("omni_multirate"))
    full = compile_diagram(diagram).run(100)["omni_pose"]
    sparse = compile_diagram(diagram, log={"omni_plant.pose": 19, "omni_pose": 50}).run(100)
    assert np.array_equal(sparse["omni_plant.pose"], full[::19])
    assert np.array_equal(sparse["omni_pose"], full[::50])


def test_an_unknown_signal_or_parameter_is_refused_with_a_suggestion():
    diagram = build_diagram(load_scenario("omni_multirate"))
    with pytest.raises(InputError, match="did you mean 'omni_pose'"):
        compile_diagram(diagram, log={"omni_pos": 1})
    with pytest.raises(InputError, match=r"did you mean 'omni_plant\.mass_kg'"):
        compile_diagram(diagram).with_parameters({"omni_plant.mass": 1.0})


def test_threads_give_the_same_numbers():
    rollout = compile_diagram(build_diagram(load_scenario("omni_multirate")))
    alone = [rollout.run(400, rollout.with_seed(seed))["omni_pose"] for seed in range(6)]
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(lambda seed: rollout.run(400, rollout.with_seed(seed))["omni_pose"], range(6)))
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))


def test_the_function_reads_like_the_diagram():
    source = compile_diagram(build_diagram(load_scenario("omni_multirate"))).source
    assert source.index("# sense") < source.index("encoder_sample(") < source.index("# compute")
    assert source.index("# compute") < source.index("actuator_hold(") < source.index("# integrate")


def small_rollout():
    bench = Bench()
    bench.add("counter", Counter())
    bench.show(count="counter.count")
    return compile_diagram(bench.build("small"))


@pytest.mark.parametrize("damage", ["truncate", "garbage", "stale"])
def test_damaged_cache_entries_are_made_anew(damage, tmp_path, monkeypatch):
    monkeypatch.setenv("DRAKE_ISPACE_CACHE", str(tmp_path))
    expected = small_rollout().run(20)["count"]
    files = [f for f in (cache_folder() / "rollouts").rglob("*") if f.is_file()]
    assert any(f.suffix == ".nbc" for f in files)
    for file in files:
        if damage == "truncate":
            file.write_bytes(file.read_bytes()[:20])
        elif damage == "garbage":
            file.write_bytes(b"\x00garbage" * 50)
        elif file.suffix == ".py":
            file.write_text("def rollout(*arguments):\n    return 0\n")
    assert np.array_equal(small_rollout().run(20)["count"], expected)


@pytest.mark.slow
def test_two_processes_may_race_for_one_entry(tmp_path):
    text = (
        "from drake_ispace.rollout.compile import compile_diagram\n"
        "from drake_ispace.scenario import load_scenario\n"
        "from drake_ispace.control.feedback.omni_gains import linearised\n"
        "from drake_ispace.wiring.bench import Bench\n"
        "from drake_ispace.control.guide.way_point import WayPoint\n"
        "from drake_ispace.control.guide.paths import Trajectory, build_path\n"
        "t = Trajectory(); bench = Bench(); bench.add('way', WayPoint(t, build_path(t, 't')))\n"
        "bench.show(way='way.way_point')\n"
        "print(repr(compile_diagram(bench.build('race')).run(400)['way'][-1].tolist()))\n"
    )
    environment = {**os.environ, "DRAKE_ISPACE_CACHE": str(tmp_path)}
    processes = [
        subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(2)
    ]
    outputs = [process.communicate(timeout=120)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert outputs[0] == outputs[1] != ""


def test_a_second_process_loads_what_the_first_compiled(tmp_path):
    text = (
        "from drake_ispace.rollout.compile import compile_diagram\n"
        "from drake_ispace.control.guide.way_point import WayPoint\n"
        "from drake_ispace.control.guide.paths import Trajectory, build_path\n"
        "from drake_ispace.wiring.bench import Bench\n"
        "bench = Bench(); bench.add('way', WayPoint(Trajectory(), build_path(Trajectory(), 't')))\n"
        "bench.show(way='way.way_point')\n"
        "rollout = compile_diagram(bench.build('twice')); rollout.run(1)\n"
        "print(sum(rollout._function.stats.cache_hits.values()))\n"
    )
    environment = {**os.environ, "DRAKE_ISPACE_CACHE": str(tmp_path)}
    hits = [subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, env=environment).stdout.strip()
            for _ in range(2)]
    assert hits == ["0", "1"]


@pytest.mark.slow
def test_a_kernel_from_the_cache_is_called_in_a_second_process(tmp_path):
    environment = {**os.environ, "DRAKE_ISPACE_CACHE": str(tmp_path)}
    code = "from drake_ispace.blocks.noise import stream, normal; print(normal(stream(0, 'name'), 3, 0))"
    printed = [
        subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert printed[0] == printed[1] and float(printed[0])
