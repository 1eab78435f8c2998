"""`compare`: what the runs of a comparison share."""

from drake_ispace.comparison import on_one_reference
from drake_ispace.scenario import load_scenario

POSE = [0.1, 0.2, 0.3]


def test_the_same_robot_starts_where_the_first_one_does():
    first = load_scenario("omni_multirate", [f"omni.initial_pose={POSE}"])
    same = on_one_reference([first, load_scenario("omni_vision_feedback", ["omni.initial_pose=[0, 0, 0]"])])
    assert [scenario.omni.initial_pose for scenario in same] == [POSE, POSE]


def test_another_robot_starts_where_the_path_does():
    first = load_scenario("omni_multirate", [f"omni.initial_pose={POSE}"])
    _, other = on_one_reference([first, load_scenario("pendulum_multirate", ["pendulum.initial_pose=[0, 0, 0]"])])
    assert other.pendulum.initial_pose is None


def test_two_robots_in_one_room_keep_their_own_starts():
    first, both = load_scenario("omni_multirate"), load_scenario("shared_space", [f"omni.initial_pose={POSE}"])
    assert on_one_reference([first, both])[1].omni.initial_pose == POSE
