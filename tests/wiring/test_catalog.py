"""Every Diagram of the catalog: builds, runs, repeats, hides no state."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.primitives import Demultiplexer, Multiplexer

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError
from drake_ispace.control.estimate.error_estimator import ErrorEstimator
from drake_ispace.control.estimate.odometry import PendulumOdometry
from drake_ispace.control.estimate.position_estimator import PositionEstimator
from drake_ispace.control.feedback.balance_controller import BalanceController
from drake_ispace.control.feedback.friction_compensator import FrictionCompensator
from drake_ispace.control.guide.tracker import TrajectoryTracker
from drake_ispace.control.guide.way_point import WayPoint
from drake_ispace.plants.actuator import TorqueActuator
from drake_ispace.plants.pendulum import PendulumPlant
from drake_ispace.room.link import RoomLink
from drake_ispace.room.localizer import KinectLocalizer
from drake_ispace.scenario import Scenario, load_scenario
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.sensing.imu import InertialSensor
from drake_ispace.sensing.tilt_filter import TiltKalmanFilter
from drake_ispace.simulation import simulate
from drake_ispace.wiring.catalog import CATALOG, build_diagram

EVERY = pytest.mark.parametrize("name", CATALOG)


def run(name, seed=0, seconds=2):
    return simulate(load_scenario(name, [f"seconds={seconds}", f"seed={seed}"]))


def same(a, b):
    assert a.signals.keys() == b.signals.keys()
    return all(np.array_equal(rows, b.signals[signal]) for signal, rows in a.signals.items())


@EVERY
def test_it_runs_without_nan(name):
    result = run(name)
    assert result.diverged_s is None
    for signal, rows in result.signals.items():
        assert len(rows) == 401, signal
        assert np.isfinite(rows).all(), signal


@EVERY
def test_the_same_seed_gives_the_same_run_and_another_seed_another(name):
    first, other, again = run(name, 3, 1), run(name, 4, 1), run(name, 3, 1)
    assert same(first, again)
    assert not same(first, other)


def test_runs_do_not_influence_each_other():
    def both(names):
        return {name: run(name, seconds=1) for name in names}

    forward, backward = both(["omni_multirate", "pendulum_multirate"]), both(["pendulum_multirate", "omni_multirate"])
    assert all(same(forward[name], backward[name]) for name in forward)


@EVERY
def test_it_consists_of_blocks(name):
    diagram = build_diagram(load_scenario(name))
    assert diagram.get_name() == name
    for system in diagram.GetSystems():
        assert isinstance(system, (Block, Multiplexer, Demultiplexer)), system.get_name()


@EVERY
def test_a_new_context_is_a_fresh_robot(name):
    diagram = build_diagram(load_scenario(name))

    def final(ticks_s):
        simulator = Simulator(diagram)
        simulator.AdvanceTo(ticks_s)
        context = simulator.get_context()
        return np.concatenate([diagram.get_output_port(i).Eval(context) for i in range(diagram.num_output_ports())])

    start = final(0.0)
    first = final(0.5)
    assert np.array_equal(final(0.0), start)
    assert np.array_equal(final(0.5), first)
    assert not np.array_equal(first, start)


def test_the_pendulums_loop_has_every_block_of_its_figure():
    diagram = build_diagram(load_scenario("pendulum_multirate"))
    figure = {
        "pendulum_plant": PendulumPlant, "pendulum_actuator": TorqueActuator, "pendulum_encoder": WheelEncoder,
        "pendulum_imu": InertialSensor, "pendulum_tilt_filter": TiltKalmanFilter, "pendulum_odometry": PendulumOdometry,
        "pendulum_estimator": PositionEstimator, "pendulum_way_point": WayPoint, "pendulum_tracker": TrajectoryTracker,
        "pendulum_link": RoomLink, "pendulum_error": ErrorEstimator, "pendulum_controller": BalanceController,
        "pendulum_compensator": FrictionCompensator, "kinect": KinectLocalizer,
    }
    built = {system.get_name(): (type(system).__module__, type(system).__qualname__) for system in diagram.GetSystems()}
    assert built == {name: (kind.__module__, kind.__qualname__) for name, kind in figure.items()}


def test_an_unknown_diagram_is_refused_with_a_hint():
    with pytest.raises(InputError, match="there is no Diagram 'omni_multirat', did you mean 'omni_multirate'"):
        build_diagram(dataclasses.replace(Scenario(), diagram="omni_multirat"))


@pytest.fixture(scope="module")
def shared():
    """Two robots in a room, and what they do there."""
    # without camera noise, whose stream knows the robots by their place in the room
    scenario = load_scenario("shared_space", ["space.localizer.noise_std_pixels=0", "seconds=3", "seed=3"])
    return scenario, simulate(scenario)


@pytest.mark.parametrize("name", ["omni_multirate", "pendulum_multirate"])
def test_in_a_shared_room_each_robot_does_what_it_does_alone(shared, name):
    scenario, together = shared
    alone = simulate(dataclasses.replace(scenario, diagram=name))
    assert len(alone.signals) >= 8
    for signal, rows in alone.signals.items():
        assert np.array_equal(rows, together.signals[signal]), signal
