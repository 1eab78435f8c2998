"""Slip as kinematics, (6.4)-(6.5): the wheels turn as the dynamics say, the robot travels otherwise."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.plants.omni import LAG, OmniPlant, OmniPlantParameters
from drake_ispace.plants.pendulum import S_RATE, YAW_RATE, PendulumPlant, PendulumPlantParameters
from drake_ispace.plants.slip import GRAVITY, Slip

PRECISE = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-9, max_step_size=0.1, use_error_control=True)
FORWARD_2_N = np.array([0.0, -0.024, 0.0, 0.024])  # wheel torques of the omni robot at heading 0: 2 N along x


def pose_rates(slip, velocity, pose=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0, 0.0)):
    """d/dt [x, y, phi] of the omni robot at wheel-consistent `velocity` [m/s, m/s, rad/s] in W."""
    plant = OmniPlant(OmniPlantParameters(slip=slip), pose)
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)
    context.get_mutable_continuous_state_vector().SetFromVector([*pose, *velocity, *np.zeros(7)])
    return plant.EvalTimeDerivatives(context).CopyToVector()[:3]


# -- The three readings of (6.4)


def test_in_the_body_frame_each_axis_loses_its_share():
    assert pose_rates(Slip(ratio=[0.1, 0.2, 0.3]), [1.0, 2.0, 3.0]) == pytest.approx([0.9, 1.6, 2.1], rel=1e-14)


def test_in_the_body_frame_slip_turns_with_the_robot():
    # heading along y: motion along y is the robot's x axis
    rates = pose_rates(Slip(ratio=[0.1, 0.2, 0.0]), [1.0, 2.0, 0.0], pose=(0.0, 0.0, np.pi / 2))
    assert rates == pytest.approx([0.8, 1.8, 0.0], rel=1e-14)


def test_in_the_world_frame_slip_does_not_turn_with_the_robot():
    slip = Slip("world", [0.1, 0.2, 0.3])
    rates = pose_rates(slip, [1.0, 2.0, 3.0], pose=(0.0, 0.0, np.pi / 2))
    assert rates == pytest.approx([0.9, 1.6, 2.1], rel=1e-14)


def test_a_world_slip_of_1_3_moves_the_robot_backwards():
    assert pose_rates(Slip("world", [1.3] * 3), [1.0, 2.0, 3.0]) == pytest.approx([-0.3, -0.6, -0.9], rel=1e-14)


def test_additive_slip_of_1_3_moves_the_robot_2_3_times_as_far():
    assert pose_rates(Slip("additive", [1.3] * 3), [1.0, 2.0, 3.0]) == pytest.approx([2.3, 4.6, 6.9], rel=1e-14)


def test_additive_slip_acts_on_the_worlds_axes():
    rates = pose_rates(Slip("additive", [1.0, 0.0, 0.0]), [1.0, 2.0, 0.0], pose=(0.0, 0.0, np.pi / 2))
    assert rates == pytest.approx([2.0, 2.0, 0.0], rel=1e-14)


@pytest.mark.parametrize("frame, slip, factor", [("body", 0.3, 0.7), ("world", 1.3, -0.3), ("additive", 1.3, 2.3)])
def test_distance_travelled_over_a_run(frame, slip, factor):
    """P_act against P_odo: the wheels have rolled the same distance in every reading."""
    plant = OmniPlant(OmniPlantParameters(slip=Slip(frame, [slip] * 3)))
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, FORWARD_2_N)
    simulator.AdvanceTo(1.0)
    rolled = 0.024 * plant.GetOutputPort("wheel_angle").Eval(context)[3]
    assert rolled == pytest.approx(0.5 * 2.0 / 7.3135, rel=1e-3)
    assert plant.GetOutputPort("pose").Eval(context)[0] == pytest.approx(factor * rolled, rel=1e-9)


# -- Neutral slip


@pytest.mark.parametrize("slip", [
    Slip("world"), Slip("additive"), Slip(friction_coefficient=0.1), Slip(relaxation_length_m=0.2),
    Slip(patch_m=[-1.0, 1.0, -1.0, 1.0]),
])
def test_a_switch_with_nothing_to_act_on_changes_no_bit(slip):
    rng = np.random.default_rng(5)
    for _ in range(20):
        velocity, torque = rng.normal(size=3), rng.normal(size=4)
        pose = (*rng.normal(size=2), 0.0 if slip.frame != "body" else rng.normal())
        assert list(pose_rates(slip, velocity, pose, torque)) == list(pose_rates(Slip(), velocity, pose, torque))


def test_without_slip_the_pose_moves_as_the_wheels_say():
    assert list(pose_rates(Slip(), [0.1, -0.7, 0.3])) == [0.1, -0.7, 0.3]


def test_slip_leaves_the_wheels_alone():
    def wheel_rates(slip):
        plant = OmniPlant(OmniPlantParameters(slip=slip))
        context = plant.CreateDefaultContext()
        context.get_mutable_continuous_state_vector().SetFromVector([0, 0, 0, 0.3, -0.2, 1.0, *np.zeros(7)])
        return list(plant.GetOutputPort("wheel_rate").Eval(context))

    assert wheel_rates(Slip(ratio=[0.5, 0.5, 0.5])) == wheel_rates(Slip())


@pytest.mark.parametrize("plant", [
    OmniPlant(OmniPlantParameters(slip=Slip(ratio=[0.1] * 3, traction_gain=[0.1] * 3))),
    PendulumPlant(PendulumPlantParameters(slip=Slip("world", [0.1] * 3, patch_m=[0, 1, 0, 1]))),
])
def test_slip_that_is_not_random_needs_no_discrete_state(plant):
    assert plant.CreateDefaultContext().num_discrete_state_groups() == 0


# -- Another carpet


def test_a_patch_has_its_own_slip_up_to_its_edges():
    slip = Slip(ratio=[0.1, 0.0, 0.0], patch_m=[0.5, 1.0, -0.2, 0.2], patch_ratio=[0.4, 0.0, 0.0])
    speeds = [pose_rates(slip, [1.0, 0.0, 0.0], (x, y, 0.0))[0] for x, y in (
        (0.499, 0.0), (0.5, 0.0), (0.75, 0.2), (1.0, -0.2), (1.001, 0.0), (0.75, 0.201), (0.75, -0.201)
    )]
    assert speeds == pytest.approx([0.9, 0.6, 0.6, 0.6, 0.9, 0.9, 0.9])


# -- Traction


@pytest.mark.parametrize("vx, force, real", [
    # mu M g = 0.6 * 7.31 * 9.80665 = 43.01 N, so 2 N use 4.65 % of the traction
    (1.0, 2.0, 1.0 - 0.5 * 0.046499), (1.0, -2.0, 1.0 + 0.5 * 0.046499),  # driving lags, braking slides on
    (-1.0, -2.0, -1.0 + 0.5 * 0.046499), (-1.0, 2.0, -1.0 - 0.5 * 0.046499),  # the same backwards
    (1.0, 200.0, 0.5), (1.0, -200.0, 1.5),  # never more than the gain
])
def test_traction_slip_lags_when_driving_and_slides_on_when_braking(vx, force, real):
    rates = pose_rates(Slip(traction_gain=[0.5, 0.5, 0.5]), [vx, 0.0, 0.0], torque=0.5 * force * FORWARD_2_N)
    assert 0.6 * 7.31 * GRAVITY * 0.046499 == pytest.approx(2.0, rel=1e-4)
    assert rates == pytest.approx([real, 0.0, 0.0], abs=1e-5)


def test_traction_slip_of_yaw_has_the_wheels_lever():
    # 4 wheels of 0.024 N m: 4 N at 0.18 m = 0.72 N m, of 43.01 N * 0.18 m = 7.742 N m
    rates = pose_rates(Slip(traction_gain=[0.0, 0.0, 0.5]), [0.0, 0.0, 2.0], torque=[0.024] * 4)
    assert rates[2] == pytest.approx(2.0 * (1.0 - 0.5 * 0.72 / 7.742), rel=1e-5)


def test_the_pendulums_traction_slip():
    plant = PendulumPlant(PendulumPlantParameters(slip=Slip(traction_gain=[0.5, 0.0, 0.25])))
    context = plant.CreateDefaultContext()
    # right 3 N, left -1 N at the floor: 2 N forward, 0.2 m * 4 N = 0.8 N m to the left
    plant.get_input_port().FixValue(context, [0.24, -0.08])
    state = context.get_mutable_continuous_state_vector()
    state[S_RATE], state[YAW_RATE] = 1.0, 2.0
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    # mu M g = 0.6 * 4 kg * g = 23.536 N, times the half-track 0.2 m for yaw
    assert rates[0] == pytest.approx(1.0 - 0.5 * 2.0 / 23.536, rel=1e-6)
    assert rates[2] == pytest.approx(2.0 - 2.0 * 0.25 * 0.8 / (23.536 * 0.2), rel=1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_traction_slip_builds_up_over_the_relaxation_length(direction):
    length, target = 0.2, 0.5 * 2.0 / (0.6 * 7.31 * GRAVITY)
    plant = OmniPlant(OmniPlantParameters(slip=Slip(traction_gain=[0.5, 0.0, 0.0], relaxation_length_m=length)))
    simulator = Simulator(plant)
    ApplySimulatorConfig(PRECISE, simulator)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, direction * FORWARD_2_N)
    for seconds in (0.5, 1.0, 2.0, 5.0):
        simulator.AdvanceTo(seconds)
        rolled = direction * 0.024 * plant.GetOutputPort("wheel_angle").Eval(context)[3]
        lagged = direction * context.get_continuous_state_vector()[LAG]
        assert lagged == pytest.approx(target * (1.0 - np.exp(-rolled / length)), rel=1e-6)
    assert lagged > 0.99 * target


def test_a_robot_at_rest_builds_up_no_traction_slip():
    slip = Slip(traction_gain=[0.5, 0.5, 0.5], relaxation_length_m=0.2)
    assert list(pose_rates(slip, [0.0, 0.0, 0.0], torque=FORWARD_2_N)) == [0.0, 0.0, 0.0]


# -- Random slip


def random_slip_poses(seed, ticks=40, samples=1, where="omni.plant"):
    """Speed along x of the pose, `samples` times per tick, while the wheels roll at 1 m/s."""
    plant = OmniPlant(OmniPlantParameters(slip=Slip(noise_std=[0.1, 0.0, 0.0])), seed=seed, where=where)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, np.zeros(4))
    context.get_mutable_continuous_state_vector()[3] = 1.0
    speeds = []
    for step in range(ticks * samples):
        simulator.AdvanceTo((step + 0.5) * TICK_S / samples)
        speeds.append(plant.EvalTimeDerivatives(context).CopyToVector()[0])
    return np.array(speeds).reshape(ticks, samples)


def test_random_slip_repeats_with_its_seed():
    assert np.array_equal(random_slip_poses(seed=1), random_slip_poses(seed=1))
    assert not np.array_equal(random_slip_poses(seed=1), random_slip_poses(seed=2))
    assert not np.array_equal(random_slip_poses(seed=1), random_slip_poses(seed=1, where="other"))


def test_random_slip_is_constant_within_a_tick_and_new_in_the_next():
    speeds = random_slip_poses(seed=1, samples=5)
    assert np.ptp(speeds, axis=1).max() == 0.0
    assert len(set(speeds[:, 0])) == len(speeds)


def test_random_slip_has_the_standard_deviation_asked_for():
    speeds = random_slip_poses(seed=3, ticks=2000)
    assert speeds.std() == pytest.approx(0.1, rel=0.08)
    assert speeds.mean() == pytest.approx(1.0, abs=5.0 * 0.1 / np.sqrt(2000))


def test_the_pendulum_slips_in_yaw_too():
    plant = PendulumPlant(PendulumPlantParameters(slip=Slip(ratio=[0.1, 0.0, 0.25])))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    state = context.get_mutable_continuous_state_vector()
    state[S_RATE], state[YAW_RATE] = 1.0, 2.0
    assert plant.EvalTimeDerivatives(context).CopyToVector()[:3] == pytest.approx([0.9, 0.0, 1.5])


@pytest.mark.parametrize("frame", ["world", "additive"])
def test_traction_slip_on_the_worlds_axes_is_refused(frame):
    with pytest.raises(InputError, match=r"plant.slip\.traction_gain: expected zeros"):
        OmniPlant(OmniPlantParameters(slip=Slip(frame=frame, traction_gain=[0.1, 0.0, 0.0])))


@pytest.mark.parametrize("slip", [Slip(ratio=[1.0, 0.0, 0.0]), Slip(patch_ratio=[0.0, 2.0, 0.0])])
def test_a_slip_that_would_drive_backwards_is_refused_in_the_body_frame(slip):
    with pytest.raises(InputError, match="expected less than 1 with frame body"):
        OmniPlant(OmniPlantParameters(slip=slip))


@pytest.mark.parametrize("frame", ["body", "world", "additive"])
def test_a_patch_slips_where_it_is(frame):
    slip = Slip(frame, patch_m=[0.5, 1.0, -1.0, -0.5], patch_ratio=[0.1] * 3)
    share = 1.1 if frame == "additive" else 0.9
    inside, outside = (pose_rates(slip, [1.0, 2.0, 3.0], pose=pose) for pose in ((0.7, -0.7, 0.0), (-0.7, 0.7, 0.0)))
    assert inside == pytest.approx([share, 2.0 * share, 3.0 * share], rel=1e-12)
    assert outside == pytest.approx([1.0, 2.0, 3.0], rel=1e-12)
    for pose in ((0.7, 0.7, 0.0), (-0.7, -0.7, 0.0)):
        assert pose_rates(slip, [1.0, 2.0, 3.0], pose=pose) == pytest.approx([1.0, 2.0, 3.0], rel=1e-12)


def test_each_axis_has_noise_of_its_own():
    plant = OmniPlant(OmniPlantParameters(slip=Slip(noise_std=[0.1, 0.1, 0.1])))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, np.zeros(4))
    context.get_mutable_continuous_state_vector().SetFromVector([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, *np.zeros(7)])
    memory = context.get_mutable_discrete_state_vector()
    memory.SetFromVector([0.01, 0.02, 0.03, *memory.CopyToVector()[3:]])
    rates = plant.EvalTimeDerivatives(context).CopyToVector()[:3]
    assert rates == pytest.approx([0.99, 0.98, 0.97])


def test_the_omni_robots_velocity_has_three_parts():
    plant = OmniPlant(OmniPlantParameters())
    context = plant.CreateDefaultContext()
    context.get_mutable_continuous_state_vector().SetFromVector([0.0, 0.0, 0.0, 0.1, 0.2, 0.3, *np.zeros(7)])
    assert plant.GetOutputPort("velocity").Eval(context).tolist() == [0.1, 0.2, 0.3]
