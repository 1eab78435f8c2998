"""The generator of runs with hidden effects: its equations against the package's, its loops, and every effect."""

import numpy as np
import pytest

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.control.feedback import balance_gains, omni_gains
from drake_ispace.robots.recordings import load
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import load_scenario
from hidden import motions, omni_truth, pendulum_truth
from hidden.effect_sizes import TYPICAL, TYPICAL_UNKNOWN, effects_of, scaled, scaled_unknown
from hidden.effects_truth import NEUTRAL, ROBOTS, UNKNOWN, complete, drive, motor_torque, of_one_wheel, pack
from hidden.generator import FOREIGN, OWN, RobotLost, follow, generate
from hidden.motions import MOTIONS, path_of
from hidden.noise_truth import coloured

EFFECTS = [(robot, name) for robot in ROBOTS for name in effects_of(robot)]
OUTSIDERS = [(robot, name) for robot in ROBOTS for name in UNKNOWN]
EXACT = ["space.localizer.noise_std_pixels=0", "pendulum.imu.accelerometer_noise_density=0",
         "pendulum.imu.gyro_noise_density=0"]


def gaps_m(run, robot, motion):
    """Distance of the true path from the reference path after 2 s."""
    truth = run.channels["truth"].values
    return path_of(robot, motion).nearest(np.ascontiguousarray(truth[400:, :2]))[0]


def body_of(robot, effects=None):
    values = complete(robot, effects or {})
    plant = getattr(load_scenario(f"{robot}_multirate"), robot).plant
    plant.friction.coulomb_n_m = plant.friction.viscous_n_m_s = 0.0
    return (omni_truth if robot == "omni" else pendulum_truth).true_body(plant, values), pack(robot, values, None)


def jacobians(rates, size, inputs, body, e):
    """(A, B) of `rates` at rest by central differences."""
    def at(z, u):
        out = np.zeros(size)
        rates(0.0, z, u, np.zeros(3), np.zeros(3), body, e, out)
        return out
    step = 1e-6
    a = [(at(d, np.zeros(inputs)) - at(-d, np.zeros(inputs))) / (2 * step) for d in step * np.eye(size)]
    b = [(at(np.zeros(size), d) - at(np.zeros(size), -d)) / (2 * step) for d in step * np.eye(inputs)]
    return np.array(a).T, np.array(b).T


# ------------------------------------------------------------------------------------------------------- equations


def test_the_pendulum_linearises_to_the_model_of_the_package():
    a, b = jacobians(pendulum_truth.rates, pendulum_truth.SIZE, 2, *body_of("pendulum"))
    plant = load_scenario("pendulum_multirate").pendulum.plant
    nominal_a, nominal_b = balance_gains.linearised(plant)
    rows = [pendulum_truth.V, pendulum_truth.TURN, pendulum_truth.NOD]
    assert a[rows, pendulum_truth.TILT] == pytest.approx(nominal_a[3:, 2], rel=1e-6, abs=1e-6)
    assert b[rows] == pytest.approx(nominal_b[3:], rel=1e-6)


def test_the_omni_robot_linearises_to_the_model_of_the_package():
    _, b = jacobians(omni_truth.rates, omni_truth.SIZE, 4, *body_of("omni"))
    plant = load_scenario("omni_multirate").omni.plant
    _, nominal_b = omni_gains.linearised(plant)  # input: force
    assert b[3:6] @ plant.geometry.inverse == pytest.approx(nominal_b[3:] @ (
        plant.geometry.inverse.T @ plant.geometry.inverse), rel=1e-6, abs=1e-9)


def pendulum_energy(z, body):
    v = z[pendulum_truth.V:pendulum_truth.NOD + 1]
    height = body.body_kg * body.z_m * 9.80665 * np.cos(z[pendulum_truth.TILT])
    return 0.5 * v @ pendulum_truth.mass_matrix(body, z[pendulum_truth.TILT]) @ v + height


def test_a_pendulum_without_friction_keeps_its_energy():
    body, e = body_of("pendulum", {"single_wheel_radius_error": {"wheel": 1, "share": 0.1}})
    z, work = np.zeros(pendulum_truth.SIZE), np.zeros((5, pendulum_truth.SIZE))
    z[pendulum_truth.TILT], z[pendulum_truth.V], z[pendulum_truth.TURN] = 0.5, 0.3, 1.0
    before = pendulum_energy(z, body)
    for _ in range(1000):
        pendulum_truth.advance(0.0, z, np.zeros(2), np.zeros(3), np.zeros(2), body, e, work)
    assert abs(z[pendulum_truth.NOD]) > 1.0  # it fell and swings
    assert pendulum_energy(z, body) == pytest.approx(before, rel=1e-6)


def test_an_omni_robot_with_a_heavy_corner_keeps_energy_and_momentum():
    body, e = body_of("omni", {"centre_of_gravity_offset": {"x_m": 0.05, "y_m": -0.03}})
    z, work = np.zeros(omni_truth.SIZE), np.zeros((5, omni_truth.SIZE))
    z[3:6] = 0.3, -0.2, 2.0
    mass = np.linalg.inv(body.inverse)
    before = 0.5 * z[3:6] @ mass @ z[3:6]

    def centre():
        c, s = np.cos(z[2]), np.sin(z[2])
        return z[:2] + np.array([[c, -s], [s, c]]) @ body.centre_m
    places = []
    for step in range(2000):
        if step % 500 == 0:
            places.append(centre())
        omni_truth.advance(0.0, z, np.zeros(4), np.zeros(3), np.zeros(3), body, e, work)
    assert 0.5 * z[3:6] @ mass @ z[3:6] == pytest.approx(before, rel=1e-9)
    moves = np.diff([*places, centre()], axis=0)  # straight on, but for the wheels' 1e-6 kg m^2
    assert moves == pytest.approx(np.tile(moves[0], (4, 1)), abs=1e-4)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_run_without_effects_is_the_scenario_of_the_package(robot):
    """Same way points, same law, no noise: the paths agree, though neither code knows the other."""
    seconds = 8.0
    scenario = load_scenario(f"{robot}_multirate", [f"seconds={seconds}", *EXACT])
    run = simulate_compiled(scenario)
    theirs = to_recording(run, robot)
    points = run.signals[f"{robot}_way_point"][1:]
    points = points[np.flatnonzero(np.diff(points[:, 0], prepend=-1.0))]
    ours = follow(robot, points, seconds=seconds, process_noise=0.0, sensor_noise=0.0)
    for name, channel in theirs.channels.items():
        assert np.array_equal(ours.channels[name].t, channel.t), name
        assert ours.channels[name].columns == channel.columns
        assert ours.channels[name].period_s == channel.period_s
    gap = ours.channels["truth"].values[:, :2] - theirs.channels["truth"].values[:, :2]
    assert np.hypot(*gap.T).max() < (1e-6 if robot == "omni" else 3e-3)


# ------------------------------------------------------------------------------------------------------------ runs


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_without_effects_a_robot_stays_near_its_path(robot, motion):
    run = generate(robot, motion, seed=1)
    gaps = gaps_m(run, robot, motion)
    most, rms = (0.06, 0.012) if robot == "omni" else (0.08, 0.025)
    assert gaps.max() < most and np.sqrt(np.mean(gaps**2)) < rms
    if robot == "pendulum":
        assert np.abs(run.channels["truth"].column("tilt")).max() < 0.25


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_recording_is_saved_and_read_back(robot, tmp_path):
    run = generate(robot, "eight", {"camera_dropouts": {"share": 0.3}}, seconds=3.0)
    run.save(tmp_path / "run")
    again = load(tmp_path / "run")
    assert (again.robot, again.scenario, again.settings) == (robot, f"{robot}_multirate", None)
    for name, channel in run.channels.items():
        assert np.array_equal(again.channels[name].values, channel.values)
    assert ("imu" in run.channels) == (robot == "pendulum")


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(robot):
    effects = {"encoder_lost_counts": scaled("encoder_lost_counts", robot)}
    one, two, other = (generate(robot, "spin", effects, seconds=3.0, seed=s) for s in (3, 3, 4))
    for name, channel in one.channels.items():
        assert channel.values.tobytes() == two.channels[name].values.tobytes()
        assert name == "reference" or channel.values.tobytes() != other.channels[name].values.tobytes()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_clock_that_is_behind_delivers_late_and_in_order(robot):
    run = generate(robot, "circle", {"clock_offset": {"offset_s": -0.042}}, seconds=3.0)
    late = run.channels["kinect"].column("t_received") - run.channels["kinect"].t
    assert late == pytest.approx(np.full(len(late), 9 * TICK_S), abs=2e-6)


def test_camera_latency_shows_where_the_robot_was():
    run = generate("omni", "circle", {"camera_latency": {"latency_s": 0.08}}, sensor_noise=0.0)
    truth, kinect = run.channels["truth"], run.channels["kinect"]
    def miss(age_s):
        places = [np.interp(kinect.t - age_s, truth.t, truth.values[:, i]) for i in range(2)]
        return np.hypot(*(kinect.values[:, :2] - np.transpose(places)).T).mean()
    assert miss(0.08) < 0.004 < 0.012 < miss(0.0)


def test_lost_counts_are_lost_on_one_wheel_only():
    whole = generate("omni", "spin", process_noise=0.0, sensor_noise=0.0)
    share = {"encoder_lost_counts": {"wheel": 3, "share": 0.2}}
    short = generate("omni", "spin", share, process_noise=0.0, sensor_noise=0.0)
    turned = [run.channels["truth"].values[-1, 2] for run in (whole, short)]
    ends = [run.channels["encoder"].values[-1] for run in (whole, short)]
    ratio = ends[1] / ends[0] * turned[0] / turned[1]
    assert ratio[2] == pytest.approx(0.8, abs=0.05)
    assert ratio[[0, 1, 3]] == pytest.approx(np.ones(3), abs=0.08)


def test_the_play_of_a_transmission_shows_in_the_encoder():
    """A still robot whose motors change direction: the encoder moves by the gap, the wheel does not."""
    gap_rad = 0.3
    run = generate("omni", "back_and_forth", {"transmission_backlash": {"gap_rad": gap_rad}}, sensor_noise=0.0)
    truth, theta = run.channels["truth"].values, run.channels["encoder"].values
    body, _ = body_of("omni")
    c, s = np.cos(truth[:, 2]), np.sin(truth[:, 2])
    v = np.column_stack([c * truth[:, 3] + s * truth[:, 4], -s * truth[:, 3] + c * truth[:, 4], truth[:, 5]])
    wheel = np.cumsum(v[:-1] @ body.g.T, axis=0) * TICK_S
    off = theta - wheel
    assert np.percentile(np.abs(off), 99) < gap_rad / 2 + 0.1
    assert np.ptp(off, axis=0).min() > 0.7 * gap_rad


def test_a_floor_that_slopes_is_felt_by_the_imu():
    tilt = {"floor_tilt": {"slope_x_rad": 0.03, "slope_y_rad": 0.0}}
    run = generate("pendulum", "back_and_forth", tilt, process_noise=0.0, sensor_noise=0.0)
    truth, imu = run.channels["truth"], run.channels["imu"]
    standing = (np.abs(truth.column("s_rate")[:-1]) < 0.02) & (imu.t > 3.0)
    lean = truth.column("tilt")[:-1][standing].mean()
    # both wheels hold m g slope, and the body leans up the slope against their reaction
    assert lean == pytest.approx(0.03 * (1.0 + 0.08 * 4.0 / (3.5 * 0.04)), abs=0.02)
    felt = np.arctan2(-imu.column("ax"), imu.column("az"))[standing].mean()
    assert felt == pytest.approx(lean - 0.03, abs=0.005)  # the IMU knows the tilt from the vertical


# --------------------------------------------------------------------------------------------------------- effects


def packed(**effects):
    return pack("pendulum", complete("pendulum", effects), None)


@pytest.mark.parametrize(("effects", "held"), [
    ({}, [0.3, -0.1]),
    ({"torque_saturation": {"limit_n_m": 0.2}}, [0.2, -0.1]),
    ({"torque_slew_limit": {"rate_n_m_s": 10.0}}, [0.05, -0.05]),
    ({"actuator_dead_zone": {"width_n_m": 0.15}}, [0.15, 0.0]),
    ({"torque_gain_error": {"share": -0.5}}, [0.15, -0.05]),
    ({"weak_motor": {"wheel": 1, "loss": 1.0 / 3.0}}, [0.2, -0.1]),
    ({"battery_sag_load": {"share_per_n_m": 1.0}}, [0.18, -0.06]),
])
def test_what_a_driver_makes_of_a_command(effects, held):
    out = np.zeros(2)
    drive(0, np.array([0.3, -0.1]), np.zeros(2), 0.005, packed(**effects), out)
    assert out == pytest.approx(np.array(held))


def torques(effects, ticks=40):
    """Torque of a motor, ten times a tick, for a command of 0.1 N m from tick 1 on."""
    held = np.full((ticks, 2), 0.1)
    held[0] = 0.0
    lagged, gap, out, rows = np.zeros(2), np.zeros(2), np.zeros(2), []
    for step in range(10 * ticks):
        motor_torque(held, (step + 0.5) * 5e-4, 5e-4, 0.005, packed(**effects), lagged, gap, out)
        rows.append(out[0])
    return np.array(rows)


def test_delay_lag_sag_and_play_act_between_the_ticks():
    assert np.flatnonzero(torques({}))[0] == 10
    assert np.flatnonzero(torques({"command_delay": {"delay_s": 0.012}}))[0] == 34
    lagged = torques({"motor_lag": {"time_constant_s": 0.02}})
    assert lagged[10 + 39] == pytest.approx(0.1 * (1.0 - np.exp(-1.0)), rel=1e-9)
    sagged = torques({"battery_sag_time": {"rate_per_s": 1.0}})
    assert sagged[-1] == pytest.approx(0.1 * (1.0 - 0.2), abs=1e-4)
    # 0.1 N m drive the motor alone at 50 rad/s through 0.1 rad: half of the play in a fifth of a tick
    assert 12 <= np.flatnonzero(torques({"transmission_backlash": {"gap_rad": 0.1}}))[0] <= 13


@pytest.mark.parametrize(("effects", "ratio"), [
    ({"constant_slip": {"ratio": 0.08}}, 0.92),
    ({"wheel_radius_error": {"share": 0.06}}, 1.06),
    ({"encoder_scale": {"share": -0.05}}, 1.0 / 0.95),
])
def test_the_robot_travels_otherwise_than_its_encoders_say(effects, ratio):
    run = generate("pendulum", "back_and_forth", effects, process_noise=0.0, sensor_noise=0.0)
    turned = run.channels["encoder"].values.mean(axis=1) + run.channels["truth"].column("tilt")[:-1]
    travelled = np.ptp(run.channels["truth"].values[:, 0]) / np.cos(np.arctan2(0.2, 1.3))
    assert travelled / (0.08 * np.ptp(turned)) == pytest.approx(ratio, abs=0.01)


@pytest.fixture(scope="module")
def plain():
    return {robot: generate(robot, "eight", seconds=12.0, seed=2) for robot in ROBOTS}


def changed(run, plain):
    """Whether any measured channel differs by more than a thousandth of its rms, before feedback can hide it."""
    for name in ("torque", "encoder", "kinect", "imu"):
        if name in plain.channels:
            a, b = run.channels[name].values, plain.channels[name].values
            if a.shape != b.shape or np.abs(a - b).max() > 1e-3 * np.sqrt(np.mean(b**2)):
                return True
    return False


def is_safe(run):
    truth = run.channels["truth"]
    inside = np.abs(truth.values[:, 0]).max() < 1.25 and np.abs(truth.values[:, 1]).max() < 1.0
    return inside and (run.robot == "omni" or np.abs(truth.column("tilt")).max() < 0.5)


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "name"), EFFECTS)
def test_an_effect_is_felt_and_survived(robot, name, plain):
    run = generate(robot, "eight", {name: scaled(name, robot)}, seconds=12.0, seed=2)
    assert is_safe(run) and changed(run, plain[robot])


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "name"), OUTSIDERS)
def test_an_unknown_effect_is_felt_and_survived(robot, name, plain):
    run = generate(robot, "eight", unknown=scaled_unknown(name, robot), seconds=12.0, seed=2)
    assert is_safe(run) and changed(run, plain[robot])


@pytest.mark.parametrize(("robot", "name"), EFFECTS)
def test_an_effect_at_its_neutral_value_does_nothing(robot, name):
    plain = generate(robot, "square", seconds=1.0)
    run = generate(robot, "square", {name: scaled(name, robot, 0.0)}, seconds=1.0)
    assert not any((run.channels[c].values != plain.channels[c].values).any() for c in plain.channels)


def test_every_effect_has_a_typical_size():
    for robot in ROBOTS:
        assert TYPICAL[robot].keys() == NEUTRAL[robot].keys()
        assert TYPICAL_UNKNOWN[robot].keys() == UNKNOWN.keys()
        for name, parameters in TYPICAL[robot].items():
            assert parameters.keys() == NEUTRAL[robot][name].keys()


def test_scaling_divides_limits_and_keeps_choices():
    typical = TYPICAL["omni"]["torque_saturation"]["limit_n_m"]
    assert scaled("torque_saturation", "omni", 2.0)["limit_n_m"] == typical / 2.0
    half = scaled("weak_motor", "omni", 0.5)
    assert half == {"wheel": 2, "loss": 0.2}
    assert of_one_wheel("omni", half, "loss").tolist() == [0.0, 0.2, 0.0, 0.0]


@pytest.mark.parametrize("case", [
    {"robot": "boat"}, {"motion": "dance"}, {"effects": {"gremlins": {}}},
    {"effects": {"gyro_bias": {"pitch_rad_s": 1.0}}}, {"effects": {"weak_motor": {"wheel": 5, "loss": 0.5}}},
    {"effects": {"weak_motor": {"strength": 0.5}}}, {"unknown": ("gremlins", 1.0)},
])
def test_what_there_is_not_is_refused(case):
    with pytest.raises(ValueError):
        generate(**{"robot": "omni", "motion": "square", "seconds": 1.0} | case)


def test_a_fallen_pendulum_is_reported():
    with pytest.raises(RobotLost, match="fell"):
        generate("pendulum", "circle", {"torque_saturation": {"limit_n_m": 0.03}})


# ---------------------------------------------------------------------------------------------- noise and reference


def test_noise_has_its_level_and_its_colour():
    noise = coloured(0, "force/0", 0.15, 400_000, TICK_S)
    assert noise.std() == pytest.approx(0.15, rel=0.05)
    later = [np.corrcoef(noise[:-lag], noise[lag:])[0, 1] for lag in (1, 40)]
    assert later[0] > 0.8 and 0.02 < later[1] < 0.35


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_way_points_move_as_they_say(robot, motion):
    """The rates of a way point are those of the path it slides on, except within a corner."""
    rows = motions.way_points(robot, motion, 4000)
    assert np.abs(rows[:, 1]).max() < 1.25 and np.abs(rows[:, 2]).max() < 1.0
    period = VISION_TICKS * TICK_S
    for place, speed in ((1, 4), (2, 5), (3, 6)):
        change = np.diff(rows[:, place])
        if place == 3:
            change = np.angle(np.exp(1j * change))
        said = 0.5 * period * (rows[1:, speed] + rows[:-1, speed])
        assert np.quantile(np.abs(change - said), 0.85) < 2e-3


# ------------------------------------------------------------------------------------------------- other physics


def robot_in(physics, robot, motion="square"):
    if robot == "pendulum" and physics == FOREIGN:
        pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'drake_ispace[physics]')")
    return generate(robot, motion, {}, 6.0, 4, process_noise=0.0, sensor_noise=0.0, physics=physics)


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ROBOTS)
def test_other_physics_makes_nearly_the_same_run(robot):
    own, foreign = (robot_in(physics, robot).channels["truth"].values for physics in (OWN, FOREIGN))
    way = np.linalg.norm(np.diff(own[:, :2], axis=0), axis=1).sum()
    apart = np.abs(own[:, :3] - foreign[:, :3]).max()
    assert 0.0 < apart < 0.02 * way


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ROBOTS)
def test_wheels_creep_a_little_in_other_physics(robot):
    run = robot_in(FOREIGN, robot, "spin")
    truth, angles = run.channels["truth"].values, run.channels["encoder"].values
    plant = getattr(load_scenario(f"{robot}_multirate"), robot).plant
    turned = (angles[-1] - angles[0]) @ plant.geometry.forward[2]
    assert 1e-6 < abs(turned - (truth[len(angles) - 1, 2] - truth[0, 2])) < 0.05
