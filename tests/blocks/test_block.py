"""Block: wiring by argument names, phases of an instant, parameters in the Context, plain and compiled kernels."""

import json as a_module
import os
import tempfile

import numba
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update, in_one_context
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import arguments, cache_folder, kernel, plain
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.linear_pendulum import LinearPendulumPlant
from drake_ispace.plants.omni import OmniPlant, OmniPlantParameters
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters
from drake_ispace.plants.slip import Slip
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import make_simulator, simulate
from drake_ispace.wiring.catalog import build_diagram

# -- Kernels as a block would have them; Block takes plain functions too.


def scaled(signal, gain, out):
    out[0] = gain * signal[0]


def stored(xd, out):
    out[:] = xd


def copied(xc, out):
    out[:] = xc


def constant(gain, out):
    out[0] = gain


def stamp(tick, out):
    out[0] = tick


def follow(signal, out):
    out[0] = signal[0]


def count_new(xd, signal, out):
    """x_d = [stamp of the last sample, number of samples met]."""
    is_new = signal[0] != xd[0]
    out[0] = signal[0]
    out[1] = xd[1] + 1.0 if is_new else xd[1]


def recall(xd, signal, gain, out):
    """As `stored`, and it reads more."""
    out[0] = xd[1] + 0.0 * signal[0] * gain


def decay(xc, gain, out):
    out[0] = -gain * xc[0]


def scribble(signal, out):
    signal[0] = 1.0
    out[0] = 0.0


class Gain(Block):
    def __init__(self, gain=2.0):
        super().__init__(Spec(inputs={"signal": 1}, outputs={"y": Output(1, scaled)}, parameters={"gain": gain}))


class Stamp(Block):
    """Stores the number of the tick, in the phase given."""

    def __init__(self, phase):
        super().__init__(Spec(
            outputs={"stamp": Output(1, stored)}, discrete_state=np.array([-1.0]), updates=(Update(stamp, phase),)
        ))


class Follower(Block):
    """Stores its input in the compute phase."""

    def __init__(self, phase=Phase.COMPUTE):
        super().__init__(Spec(
            inputs={"signal": 1}, outputs={"stored": Output(1, stored)}, discrete_state=np.array([-1.0]),
            updates=(Update(follow, phase),),
        ))


class Counter(Block):
    def __init__(self, through):
        super().__init__(Spec(
            inputs={"signal": 1}, outputs={"state": Output(2, stored)}, discrete_state=np.array([-1.0, 0.0]),
            updates=(Update(count_new, Phase.COMPUTE, through=through),),
        ))


def value(block, port, **inputs):
    context = block.CreateDefaultContext()
    for name, numbers in inputs.items():
        block.GetInputPort(name).FixValue(context, numbers)
    return block.GetOutputPort(port).Eval(context)


# -- Wiring by names


def test_argument_names_are_read_without_out():
    assert arguments(scaled) == ("signal", "gain")
    assert arguments(kernel(scaled)) == ("signal", "gain")


def test_a_kernel_reads_the_port_and_the_parameter_of_its_argument_names():
    assert value(Gain(3.0), "y", signal=[4.0])[0] == 12.0


@pytest.mark.parametrize("spec", [
    Spec(outputs={"y": Output(1, scaled)}, parameters={"gain": 1.0}),
    Spec(inputs={"signal": 1}, outputs={"y": Output(1, scaled)}),
    Spec(discrete_state=np.zeros(1), updates=(Update(follow, Phase.COMPUTE),)),
    Spec(continuous_state=np.zeros(1), derivatives=decay),
])
def test_an_argument_that_names_nothing_is_refused(spec):
    with pytest.raises(TypeError, match="is no port, state or parameter"):
        Block(spec)


def test_feed_through_is_what_the_output_kernel_names():
    block = Block(Spec(
        inputs={"signal": 1, "unused": 1}, parameters={"gain": 1.0}, discrete_state=np.zeros(1),
        outputs={"direct": Output(1, scaled), "memory": Output(1, stored), "fixed": Output(1, constant)},
    ))
    feeds = {(i, o) for i in range(2) for o in range(3) if block.HasDirectFeedthrough(i, o)}
    assert feeds == {(0, 0)}


def test_feed_through_of_a_through_block_includes_what_its_update_reads():
    assert Counter(through=True).HasDirectFeedthrough(0, 0)
    assert not Counter(through=False).HasDirectFeedthrough(0, 0)


@pytest.mark.parametrize("plant", [PendulumPlant(PendulumPlantParameters()), OmniPlant(OmniPlantParameters())])
def test_a_plants_only_feed_through_is_from_torque_to_imu_and_floor(plant):
    through = {
        plant.get_output_port(o).get_name() for o in range(plant.num_output_ports()) if plant.HasDirectFeedthrough(0, o)
    }
    assert through == {"body_motion", "contact"} & set(plant.spec.outputs)


def test_an_unconnected_input_is_named():
    block = Gain()
    block.set_name("amplifier")
    with pytest.raises(RuntimeError, match=r"InputPort\[0\] \(signal\) of System ::amplifier .* is not connected"):
        value(block, "y")


def test_what_a_kernel_scribbles_on_its_input_reaches_nobody():
    block = Block(Spec(inputs={"signal": 1}, outputs={"y": Output(1, scribble), "echo": Output(1, follow)}))
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, [3.0])
    assert block.GetOutputPort("y").Eval(context)[0] == 0.0
    assert block.GetOutputPort("echo").Eval(context)[0] == 3.0


def test_parameter_names_spell_out_vectors_and_groups():
    spec = Spec(parameters={"mass_kg": 2.0, "key": np.array([3.0, 4.0]), "slip": {"x": 5.0, "y": 6.0}})
    assert spec.parameter_names == ["mass_kg", "key[0]", "key[1]", "slip.x", "slip.y"]
    assert list(spec.parameter_values) == [2.0, 3.0, 4.0, 5.0, 6.0]


# -- State and parameters live in the Context


@pytest.mark.parametrize("convert", [lambda block: block, lambda block: block.ToAutoDiffXd()])
def test_a_block_has_derivatives_also_after_another_of_its_class_that_had_none(convert):
    still, moving = Spec(), Spec(continuous_state=np.array([3.0]), derivatives=copied)
    found = []
    for block in (convert(Block(still)), convert(Block(moving))):
        found.append(block.EvalTimeDerivatives(block.CreateDefaultContext()).get_vector().CopyToVector())
    assert found[0].size == 0
    assert found[1] == 3.0


def test_the_parameter_in_the_context_is_the_one_used():
    block = Gain(2.0)
    context = block.CreateDefaultContext()
    block.GetInputPort("signal").FixValue(context, [1.0])
    before = block.GetOutputPort("y").Eval(context)[0]
    context.get_mutable_numeric_parameter(0).SetFromVector([7.0])
    assert (before, block.GetOutputPort("y").Eval(context)[0]) == (2.0, 7.0)
    assert value(block, "y", signal=[1.0])[0] == 2.0  # another Context is another robot


def test_every_context_has_its_own_parameters_whichever_was_read_first():
    block = Gain(2.0)
    first, other = block.CreateDefaultContext(), block.CreateDefaultContext()
    other.get_mutable_numeric_parameter(0).SetFromVector([7.0])
    for context in (first, other):
        block.GetInputPort("signal").FixValue(context, [1.0])
    clone = None
    for context, gain in ((first, 2.0), (first, 2.0), (other, 7.0), (first, 2.0), (other, 7.0)):
        clone = clone or context.Clone()
        assert block.GetOutputPort("y").Eval(context)[0] == gain
    assert block.GetOutputPort("y").Eval(clone)[0] == 2.0


def test_in_one_context_other_contexts_have_parameters_and_states_of_their_own():
    block = Block(Spec(
        inputs={"signal": 1}, outputs={"y": Output(1, recall)}, parameters={"gain": 2.0},
        discrete_state=np.array([-1.0, 5.0]), updates=(Update(count_new, Phase.COMPUTE),),
    ))
    kept, other = block.CreateDefaultContext(), block.CreateDefaultContext()
    for context in (kept, other):
        block.get_input_port().FixValue(context, [1.0])
    other.SetDiscreteState([-1.0, 7.0])
    with in_one_context(block, kept):
        assert [block.get_output_port().Eval(context)[0] for context in (kept, other, kept)] == [5.0, 7.0, 5.0]
        kept.SetDiscreteState([-1.0, 6.0])
        assert block.get_output_port().Eval(kept)[0] == 6.0


def test_after_in_one_context_parameters_may_change_again():
    block = Gain(2.0)
    context = block.CreateDefaultContext()
    block.GetInputPort("signal").FixValue(context, [1.0])
    with in_one_context(block, context):
        assert block.GetOutputPort("y").Eval(context)[0] == 2.0
    context.get_mutable_numeric_parameter(0).SetFromVector([7.0])
    assert block.GetOutputPort("y").Eval(context)[0] == 7.0


@pytest.mark.parametrize("name", ["omni_multirate", "pendulum_multirate"])
def test_in_one_context_a_simulation_has_the_same_bits(name):
    scenario = load_scenario(name, ["seconds=0.6"])
    (simulator, sinks), run = make_simulator(build_diagram(scenario)), simulate(scenario)
    simulator.AdvanceTo(0.6)
    for signal, sink in sinks.items():
        assert np.array_equal(sink.FindLog(simulator.get_context()).data().T, run.signals[signal])


def test_a_plants_mass_can_be_changed_in_its_context():
    plant = OmniPlant(OmniPlantParameters(wheel_inertia_kg_m2=0.0))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, -0.024, 0.0, 0.024])  # 2 N along x
    accelerations = []
    for mass in (4.0, 8.0):
        context.get_mutable_numeric_parameter(0)[plant.spec.parameter_names.index("mass_kg")] = mass
        accelerations.append(plant.EvalTimeDerivatives(context).CopyToVector()[3])
    assert accelerations == pytest.approx([0.5, 0.25], rel=1e-14)


def test_a_new_context_is_a_fresh_block():
    block = Follower()
    simulator = Simulator(block)
    block.get_input_port().FixValue(simulator.get_mutable_context(), [5.0])
    simulator.AdvanceTo(TICK_S)
    assert simulator.get_context().get_discrete_state_vector()[0] == 5.0
    assert block.CreateDefaultContext().get_discrete_state_vector()[0] == -1.0


# -- Phases of an instant


def chain(phase):
    """What a follower in the compute phase has stored at tick 3 of a stamp taken in `phase`."""
    builder = DiagramBuilder()
    source, follower = builder.AddSystem(Stamp(phase)), builder.AddSystem(Follower())
    builder.Connect(source.get_output_port(), follower.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(3.5 * TICK_S)
    return follower.get_output_port().Eval(follower.GetMyContextFromRoot(simulator.get_context()))[0]


def test_a_sensor_samples_before_the_controller_computes():
    assert chain(Phase.SENSE) == 3.0


def test_two_blocks_that_compute_in_one_instant_see_each_other_as_before_it():
    assert chain(Phase.COMPUTE) == 2.0


def test_an_update_keeps_its_period_and_offset():
    block = Block(Spec(
        outputs={"stamp": Output(1, stored)}, discrete_state=np.array([-1.0]),
        updates=(Update(stamp, Phase.SENSE, period_ticks=19, offset_ticks=4),),
    ))
    simulator = Simulator(block)
    stamps = []
    for tick in range(60):
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
        stamps.append(block.get_output_port().Eval(simulator.get_context())[0])
    assert [tick for tick in range(1, 60) if stamps[tick] != stamps[tick - 1]] == [4, 23, 42]
    assert (stamps[4], stamps[23], stamps[42]) == (4.0, 23.0, 42.0)


def test_sense_updates_of_one_instant_act_one_after_the_other():
    block = Block(Spec(
        inputs={"signal": 1}, discrete_state=np.array([-1.0, 0.0]),
        updates=(Update(count_new, Phase.SENSE), Update(count_new, Phase.SENSE)),
    ))
    simulator = Simulator(block)
    block.get_input_port().FixValue(simulator.get_mutable_context(), [8.0])
    simulator.Initialize()
    simulator.AdvanceTo(0.5 * TICK_S)
    # one after the other: the second meets the stamp that the first has stored
    assert list(simulator.get_context().get_discrete_state_vector().CopyToVector()) == [8.0, 1.0]


# -- Through


def test_a_through_blocks_output_already_holds_the_new_sample():
    assert list(value(Counter(through=True), "state", signal=[7.0])) == [7.0, 1.0]
    assert list(value(Counter(through=False), "state", signal=[7.0])) == [-1.0, 0.0]


def test_a_through_block_counts_a_repeated_sample_once():
    block = Counter(through=True)
    simulator = Simulator(block)
    context = simulator.get_mutable_context()
    seen = []
    for tick, sample in enumerate([7.0, 7.0, 8.0, 8.0, 8.0]):
        block.get_input_port().FixValue(context, [sample])
        before = block.get_output_port().Eval(context).copy()
        simulator.AdvanceTo((tick + 0.5) * TICK_S)  # over the update of this tick
        after = block.get_output_port().Eval(context).copy()
        assert list(before) == list(after)
        seen.append(after[1])
    assert seen == [1.0, 1.0, 2.0, 2.0, 2.0]


@pytest.mark.parametrize("updates", [
    (Update(count_new, Phase.SENSE, through=True),),
    (Update(count_new, Phase.COMPUTE, through=True), Update(count_new, Phase.SENSE)),
])
def test_a_through_update_stands_alone_in_the_compute_phase(updates):
    with pytest.raises(ValueError, match="through update is its block's only update, in the compute phase"):
        Block(Spec(inputs={"signal": 1}, discrete_state=np.zeros(2), updates=updates))


def test_a_through_blocks_output_kernel_may_read_inputs_and_parameters_too():
    block = Block(Spec(
        inputs={"signal": 1}, outputs={"count": Output(1, recall)}, parameters={"gain": 1.0},
        discrete_state=np.array([-1.0, 0.0]), updates=(Update(count_new, Phase.COMPUTE, through=True),),
    ))
    assert value(block, "count", signal=[7.0])[0] == 1.0


# -- Scalar types


def test_a_converted_block_keeps_its_name_and_its_numbers():
    block = Gain(5.0)
    block.set_name("amplifier")
    other = block.ToAutoDiffXd()
    assert other.get_name() == "amplifier"
    context = other.CreateDefaultContext()
    other.get_input_port().FixValue(context, [2.0])
    assert other.get_output_port().Eval(context)[0].value() == 10.0


# A plant has this many kernels. Each is called with everything switched on.
SLIP = Slip(
    ratio=[0.1, 0.05, 0.02], traction_gain=[0.2, 0.2, 0.1], relaxation_length_m=0.05, noise_std=[0.01, 0.01, 0.01],
    patch_m=[0.0, 1.0, -1.0, 1.0], patch_ratio=[0.3, 0.2, 0.1],
)
PLANTS = {
    "pendulum": PendulumPlant(PendulumPlantParameters(), imu_height_m=0.1),
    "pendulum, wheel only, slip, bristles": PendulumPlant(PendulumPlantParameters(
        motion="wheel_only", slip=SLIP, friction=Friction("elastoplastic", 0.0061, 0.0106))),
    "omni": OmniPlant(OmniPlantParameters(friction=Friction(coulomb_n_m=0.005, viscous_n_m_s=0.001))),
    "omni, slip, bristles": OmniPlant(OmniPlantParameters(slip=SLIP, friction=Friction("elastoplastic", 0.005))),
    "omni, additive slip": OmniPlant(OmniPlantParameters(slip=Slip(frame="additive", ratio=[1.3, 1.3, 1.3]))),
    "linear pendulum": LinearPendulumPlant(PendulumPlantParameters(), imu_height_m=0.1),
}


def kernels(spec):
    """(kernel, size of out) of every kernel that a block has."""
    states = 0 if spec.discrete_state is None else len(spec.discrete_state)
    return [
        (spec.derivatives, len(spec.continuous_state)), *((o.kernel, o.size) for o in spec.outputs.values()),
        *((u.kernel, states) for u in spec.updates),
    ]


@pytest.mark.first_case
@pytest.mark.parametrize("name", PLANTS)
def test_the_plain_form_of_a_plants_kernels_equals_the_compiled_one(name):
    spec, rng = PLANTS[name].spec, np.random.default_rng(7)
    for _ in range(20):
        arrays = {
            "xc": rng.normal(size=len(spec.continuous_state)), "torque": rng.normal(size=spec.inputs["torque"]),
            "xd": np.zeros(0) if spec.discrete_state is None else 0.1 * rng.normal(size=len(spec.discrete_state)),
        }
        for key, group in spec.parameters.items():
            arrays[key] = np.array(list(group.values())) if isinstance(group, dict) else group
        for function, size in kernels(spec):
            values = [arrays.get(argument, 1234) for argument in arguments(function)]  # 1234: the tick
            compiled, interpreted = np.empty(size), np.empty(size)
            function(*values, compiled)
            with np.errstate(over="ignore"):
                plain(function)(*values, interpreted)
            np.testing.assert_allclose(interpreted, compiled, rtol=1e-12, atol=1e-12)


# -- What a kernel is hashed by

TABLE = np.zeros(2000)
TABLE_LIKE_IT = np.zeros(2000)
TABLE_LIKE_IT[1000] = 1.0  # where its repr says "..."


def made(text, name="f", **names):
    """The digest of a function made of `text`, which has no source on disk."""
    namespace = {"np": np, "__name__": __name__, **names}
    exec(text, namespace)
    return kernel(namespace[name]).digest


def helper_one(x):
    return x + 1.0


def helper_two(x):
    return x + 2.0


def reaches_out(x, out):
    out[0] = a_module.loads(x)


def uses_nothing_known(x, out):
    out[0] = defined_nowhere(x)  # noqa: F821


def test_the_digest_follows_arrays_helpers_defaults_and_inner_functions():
    text = "def f(x, out):\n    out[0] = g[3]\n"
    assert made(text, g=TABLE) == made(text, g=TABLE.copy()) != made(text, g=TABLE_LIKE_IT)
    assert made(text, g=TABLE) != made(text, g=TABLE.reshape(2, -1))
    text = "def f(x, out):\n    out[0] = g(x[0])\n"
    assert made(text, g=numba.njit(helper_one)) == made(text, g=numba.njit(helper_one))
    assert made(text, g=numba.njit(helper_one)) != made(text, g=numba.njit(helper_two))
    texts = [f"def f(x, out, step={step}):\n    out[0] = step\n" for step in (1.0, 2.0)]
    assert made(texts[0]) == made(texts[0]) != made(texts[1])
    text = "def f(x, out):\n    out[0] = g(x)\n"
    assert made(text, g=np.linalg.norm) == made(text, g=np.linalg.norm) != made(text, g=np.linalg.det)
    text = "def f(x, out):\n    out[0] = [g for i in range(2)][0]\n"
    assert made(text, g=1.0) != made(text, g=2.0)


def test_the_same_function_of_another_module_is_another_kernel():
    """Cached code asks for its module by name, and one file can be imported by two names."""
    text = "def f(x, out):\n    out[0] = x[0]\n"
    assert made(text, __name__="model") == made(text, __name__="model") != made(text, __name__="robot.model")


def test_a_kernel_without_source_runs_and_is_kept_nowhere():
    namespace = {}
    exec("def f(x, out):\n    out[0] = 2.0 * x[0]\n", namespace)
    function, out = kernel(namespace["f"]), np.zeros(1)
    function(np.array([4.0]), out)
    assert out[0] == 8.0 and not function.stats.cache_path


def test_a_closure_is_refused():
    gain = 2.0

    def inner(x, out):
        out[0] = gain * x[0]

    with pytest.raises(TypeError, match=r"inner uses variables of the function around it, .* module-level function"):
        kernel(inner)


def test_a_module_within_a_kernel_is_refused():
    with pytest.raises(TypeError, match="reaches_out reaches into the module a_module"):
        kernel(reaches_out)


def test_a_name_that_is_not_defined_above_the_kernel_is_refused():
    with pytest.raises(TypeError, match="uses_nothing_known uses defined_nowhere, which is not defined yet"):
        kernel(uses_nothing_known)


@pytest.mark.parametrize("part", ["", "kernels"])
def test_a_cache_that_others_may_write_to_is_refused(tmp_path, monkeypatch, part):
    monkeypatch.setenv("DRAKE_ISPACE_CACHE", str(tmp_path))
    tmp_path.chmod(0o777)
    with pytest.raises(InputError, match=r"DRAKE_ISPACE_CACHE: others may write to .*, expected a folder of your own"):
        cache_folder(part)


def test_a_folder_in_the_cache_that_others_may_write_to_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("DRAKE_ISPACE_CACHE", str(tmp_path))
    assert cache_folder("kernels") == tmp_path / "kernels"
    assert (tmp_path / "kernels").stat().st_mode & 0o777 == 0o700
    (tmp_path / "kernels").chmod(0o770)
    assert cache_folder("kernels") is None


def test_the_fallback_cache_belongs_to_this_user_alone(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("DRAKE_ISPACE_CACHE", str(blocked / "cache"))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    folder = tmp_path / f"drake_ispace-{os.getuid()}"
    assert cache_folder() == folder and folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    assert cache_folder() is None
    folder.chmod(0o700)
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    (tmp_path / f"drake_ispace-{os.getuid()}").mkdir()
    assert cache_folder() is None
