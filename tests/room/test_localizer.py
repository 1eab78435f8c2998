"""The room's camera: pixel grid, noise, drop-outs, latency, and the instants at which a fix acts."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import VectorLogSink, ZeroOrderHold

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.control.estimate.position_estimator import PositionEstimator
from drake_ispace.room.link import Link, RoomLink
from drake_ispace.room.localizer import KinectLocalizer, Localizer, see
from drake_ispace.room.room import Space

EXACT = {"whole_pixels": False, "noise_std_pixels": 0.0}
PIXEL_X, PIXEL_Y = 0.00487, 0.00551


def seen(x, y, phi, localizer=None, tick=0, robot=0, seed=0):
    """One message: tick, seen, x, y, phi."""
    return all_seen(x, y, phi, localizer or Localizer(noise_std_pixels=0.0), [tick], robot, seed)[0]


def all_seen(x, y, phi, localizer, ticks, robot=0, seed=0):
    """A message for each of the ticks."""
    parameters = KinectLocalizer(Space(localizer=localizer), seed=seed).spec.parameters
    camera, rows = np.array(list(parameters["camera"].values())), np.empty((len(ticks), 5))
    for tick, row in zip(ticks, rows, strict=True):
        see(tick, robot, x, y, phi, camera, parameters["noise_stream"], row)
    return rows


class Walker(Block):
    """True poses, far from each other, that change with every tick."""

    def __init__(self, robots=1):
        super().__init__(Spec(outputs={"poses": Output(3 * robots, walk)}))


def walk(tick, out):
    for i in range(out.shape[0]):
        out[i] = 1e-6 * tick + 0.1 * i


def fixes(localizer, ticks, robots=1):
    """(ticks, 5 robots): the room's message as a block that computes in tick 0, 1, ... sees it."""
    builder = DiagramBuilder()
    walker = builder.AddSystem(Walker(robots))
    kinect = builder.AddSystem(KinectLocalizer(Space(localizer=localizer), robots))
    reader = builder.AddSystem(ZeroOrderHold(TICK_S, 5 * robots))
    log = builder.AddSystem(VectorLogSink(5 * robots, TICK_S))
    builder.Connect(walker.get_output_port(), kinect.get_input_port())
    builder.Connect(kinect.get_output_port(), reader.get_input_port())
    builder.Connect(reader.get_output_port(), log.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(ticks * TICK_S)
    return log.FindLog(simulator.get_context()).data().T[1:]  # a log's row k + 1 shows what was stored at tick k


def test_markers_are_found_in_the_middle_of_pixels():
    # facing y: markers at y = +-0.1 m = +-18.15 pixels, found at +-18.5; both at x = 1 mm = 0.2 pixels, found at 0.5
    assert seen(0.001, 0.0, np.pi / 2.0) == pytest.approx([0.0, 1.0, 0.5 * PIXEL_X, 0.0, np.pi / 2.0], abs=1e-15)


def test_the_pose_is_the_middle_and_the_direction_of_the_markers():
    # facing x at (0.3, 0.2): x = 0.4 -> pixel 82, x = 0.2 -> 41; y = 0.2 -> 36 for both
    x = PIXEL_X * (82.5 + 41.5) / 2.0
    assert seen(0.3, 0.2, 0.0) == pytest.approx([0.0, 1.0, x, 36.5 * PIXEL_Y, 0.0], abs=1e-15)
    # turned by 1 degree the front marker moves by 1.7 mm, into the next row: 1 of 41 pixels, at their sizes
    turned = seen(0.3, 0.2, np.radians(1.0))
    assert turned[4] == pytest.approx(np.arctan2(PIXEL_Y, 41 * PIXEL_X), abs=1e-12)


def test_rounding_is_at_most_half_a_pixel():
    rng = np.random.default_rng(1)
    for x, y, phi in rng.uniform([-1.1, -0.9, -np.pi], [1.1, 0.9, np.pi], (300, 3)):
        _, found, seen_x, seen_y, seen_phi = seen(x, y, phi)
        assert found == 1.0
        assert abs(seen_x - x) <= PIXEL_X / 2.0 + 1e-12
        assert abs(seen_y - y) <= PIXEL_Y / 2.0 + 1e-12
        # both markers half a pixel off, in opposite directions, across 0.2 m
        assert abs(np.angle(np.exp(1j * (seen_phi - phi)))) < 1.05 * np.hypot(PIXEL_X, PIXEL_Y) / 0.2


def test_without_pixels_and_noise_the_pose_is_exact():
    assert list(seen(0.1234, -0.4321, 7.0, Localizer(**EXACT), tick=38)) == [38.0, 1.0, 0.1234, -0.4321, 7.0]


def test_noise_of_the_pose_follows_from_that_of_two_markers():
    localizer = Localizer(whole_pixels=False, noise_std_pixels=0.3)
    rows = all_seen(0.0, 0.0, 0.0, localizer, range(3000))[:, 2:]
    # 0.3 pixels / sqrt(2); heading from y: 0.3 pixels * sqrt(2) / 0.2 m
    expected = [0.3 * PIXEL_X / np.sqrt(2), 0.3 * PIXEL_Y / np.sqrt(2), 0.3 * PIXEL_Y * np.sqrt(2) / 0.2]
    assert rows.std(axis=0) == pytest.approx(expected, rel=0.065)
    assert (np.abs(rows.mean(axis=0)) < 5.0 * rows.std(axis=0) / np.sqrt(3000)).all()


def test_noise_differs_between_robots_ticks_and_seeds():
    localizer = Localizer(whole_pixels=False)
    one = seen(0.0, 0.0, 0.0, localizer)
    assert np.array_equal(one, seen(0.0, 0.0, 0.0, localizer))
    for other in ({"robot": 1}, {"tick": 19}, {"seed": 1}):
        assert (one[2:] != seen(0.0, 0.0, 0.0, localizer, **other)[2:]).all()


@pytest.mark.parametrize("x, y, found", [
    (1.25, 1.0, 1.0), (1.2501, 0.0, 0.0), (-1.2501, 0.0, 0.0), (0.0, 1.0001, 0.0), (0.0, -1.0001, 0.0),
    (np.nan, 0.0, 0.0),
])
def test_a_robot_outside_of_the_space_is_not_seen(x, y, found):
    message = seen(x, y, 0.5, tick=57)
    assert list(message[:2]) == [57.0, found]
    assert found or list(message[2:]) == [0.0, 0.0, 0.0]


def test_the_share_of_drop_outs():
    messages = all_seen(0.0, 0.0, 0.0, Localizer(dropout=0.3), range(0, 19 * 4000, 19))
    assert np.mean(messages[:, 1] == 0.0) == pytest.approx(0.3, abs=0.036)  # five standard deviations


def test_all_captures_dropped_and_none():
    assert seen(0.0, 0.0, 0.0, Localizer(dropout=1.0))[1] == 0.0
    assert seen(0.0, 0.0, 0.0, Localizer(dropout=0.0))[1] == 1.0


@pytest.mark.parametrize("latency", [0, 1, 7, 18, 19, 20, 38, 40])
def test_a_message_arrives_its_latency_after_capture(latency):
    rows = fixes(Localizer(**EXACT, latency_ticks=latency), 150)
    for tick, (stamp, found, x, _, _) in enumerate(rows):
        capture = 19 * ((tick - latency) // 19)
        assert (stamp, found, x) == ((capture, 1.0, 1e-6 * capture) if tick >= latency else (-1.0, 0.0, 0.0)), tick


@pytest.mark.parametrize("latency, captures", [(0, 1), (1, 1), (18, 1), (19, 2), (20, 2), (37, 2), (38, 3), (40, 3)])
def test_only_as_many_captures_are_kept_as_are_under_way(latency, captures):
    block = KinectLocalizer(Space(localizer=Localizer(latency_ticks=latency)), 2)
    assert len(block.spec.discrete_state) == 10 * (1 + captures)  # and the one delivered


def test_several_robots_are_seen_at_once():
    rows = fixes(Localizer(**EXACT, latency_ticks=20), 60, robots=3)
    pose = 1e-6 * 19 + 0.1 * np.arange(9)
    assert list(rows[39]) == [19, 1, *pose[:3], 19, 1, *pose[3:6], 19, 1, *pose[6:]]


def test_one_robot_out_of_sight_does_not_hide_the_other():
    block = KinectLocalizer(Space(), 2)
    simulator = Simulator(block)
    block.get_input_port().FixValue(simulator.get_mutable_context(), [9.0, 0.0, 0.0, 0.1, 0.1, 0.1])
    simulator.AdvanceTo(TICK_S)
    assert list(block.get_output_port().Eval(simulator.get_context())[[1, 6]]) == [0.0, 1.0]


class Clock(Block):
    """A robot that does not move, on its own odometry."""

    def __init__(self):
        super().__init__(Spec(outputs={"tick": Output(1, stamped), "odometry": Output(4, stamped)}))


def stamped(tick, out):
    out[:] = 0.0
    out[0] = tick


@pytest.mark.slow
def test_every_fix_of_2000_acts_in_its_own_tick():
    builder = DiagramBuilder()
    walker, clock = builder.AddSystem(Walker()), builder.AddSystem(Clock())
    kinect = builder.AddSystem(KinectLocalizer(Space(localizer=Localizer(**EXACT))))
    link = builder.AddSystem(RoomLink(Link(), 1))
    estimator = builder.AddSystem(PositionEstimator())
    torque = builder.AddSystem(ZeroOrderHold(TICK_S, 4))  # computes as the torque hold does
    log = builder.AddSystem(VectorLogSink(4, TICK_S))
    builder.Connect(walker.get_output_port(), kinect.get_input_port())
    builder.Connect(kinect.get_output_port(), link.GetInputPort("fix"))
    builder.Connect(clock.GetOutputPort("tick"), link.GetInputPort("order"))
    builder.Connect(clock.GetOutputPort("tick"), link.GetInputPort("robot_tick"))
    builder.Connect(link.GetOutputPort("fix"), estimator.GetInputPort("fix"))
    builder.Connect(clock.GetOutputPort("odometry"), estimator.GetInputPort("odometry"))
    builder.Connect(estimator.get_output_port(), torque.get_input_port())
    builder.Connect(torque.get_output_port(), log.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2001 * VISION_TICKS * TICK_S)
    held = log.FindLog(simulator.get_context()).data().T[1:]
    assert len(held) == 2001 * VISION_TICKS
    expected = 1e-6 * VISION_TICKS * (np.arange(len(held)) // VISION_TICKS)
    assert np.abs(held[:, 1] - expected).max() < 1e-15
    assert np.array_equal(held[:, 0], np.arange(len(held)))
