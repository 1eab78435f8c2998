"""Robot files: wheels of any kind against the motion of their contact points, derived apart from plants.wheels."""

import itertools

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.robots.library import robots
from drake_ispace.robots.robot_file import read_robot
from drake_ispace.scenario import Scenario, read
from drake_ispace.wiring.catalog import build_diagram

DIFFERENTIAL = {"kind": "differential", "wheel_diameter_m": 0.132, "track_m": 0.30, "wheels": ["right", "left"]}
OMNI = {
    "kind": "omni", "wheel_radius_m": 0.05, "centre_distance_m": 0.2, "angles_deg": [60, 130, 230, 300],
    "wheels": ["a", "b", "c", "d"],
}
MECANUM = {"kind": "mecanum", "wheel_diameter_m": 0.1, "track_m": 0.4, "wheelbase_m": 0.5}
ROBOTS = {
    "differential": DIFFERENTIAL, "omni at odd angles": OMNI,
    "three omni": {**OMNI, "angles_deg": [10, 140, 260], "wheels": None},
    "omni on an axis": {**OMNI, "angles_deg": [90, 180, 210, 330]},
    "clockwise": {**OMNI, "forward_turns": "clockwise"}, "mecanum": MECANUM,
}
ROBOTS["three omni"].pop("wheels")


def turned(angle, x, y):
    return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


def wheel_speed(place, drive, roller, radius, velocity):
    """The speed at which a wheel must turn: its contact point moves at v + w x p, which the wheel and its rollers,
    across their axes, make together. Two equations for the speed of the wheel and that of the roller."""
    vx, vy, w = velocity
    contact = np.array([vx - w * place[1], vy + w * place[0]])
    along, rolls = turned(drive, 1.0, 0.0), turned(drive + roller, 0.0, 1.0)  # a roller rolls across its axis
    speed, _ = np.linalg.solve(np.column_stack([radius * along, rolls]), contact)
    return speed


def described(data):
    """(place, drive, roller, radius) of each wheel, read off the file by hand."""
    radius = data.get("wheel_radius_m") or data["wheel_diameter_m"] / 2
    if data["kind"] == "differential":
        return [((0.0, side * data["track_m"] / 2), 0.0, 0.0, radius) for side in (-1, 1)]
    if data["kind"] == "omni":
        side = 90 if data.get("forward_turns") != "clockwise" else -90
        return [
            (tuple(turned(np.radians(a), data["centre_distance_m"], 0.0)), np.radians(a + side), 0.0, radius)
            for a in data["angles_deg"]
        ]
    places = itertools.product(*((data[key] / 2, -data[key] / 2) for key in ("wheelbase_m", "track_m")))
    return [((x, y), 0.0, -np.pi / 4 if x * y > 0 else np.pi / 4, radius) for x, y in places]


@pytest.mark.parametrize("name", ROBOTS)
def test_wheels_turn_as_their_contact_points_move(name):
    geometry, rng = read_robot(ROBOTS[name], "r").geometry, np.random.default_rng(0)
    for _ in range(20):
        velocity = rng.uniform(-1, 1, 3)
        if len(geometry.sideways):
            velocity[1] = 0.0
        expected = [wheel_speed(*wheel, velocity) for wheel in described(ROBOTS[name])]
        assert geometry.inverse @ velocity == pytest.approx(expected, abs=1e-12)
        assert geometry.forward @ expected == pytest.approx(velocity, abs=1e-12)


TRICYCLE = {"kind": "tricycle", "wheel_diameter_m": 0.2, "wheelbase_m": 1.1, "track_m": 0.7}


def test_a_tricycles_rear_wheels_go_with_its_front_wheel():
    """Against the circle on which the front wheel drives at a constant steering angle."""
    robot, front, steering = read_robot(TRICYCLE, "r"), np.linspace(0.0, 9.0, 50), np.full(50, 0.4)
    rear = robot.rear_angles(front, steering)
    radius_of_front = 1.1 / np.sin(0.4)  # of the circle, about a point on the line of the rear axle
    turned = 0.1 * 9.0 / radius_of_front
    middle = 1.1 / np.tan(0.4)
    assert rear[-1] == pytest.approx([turned * (middle + 0.35) / 0.1, turned * (middle - 0.35) / 0.1], abs=1e-12)
    assert robot.cannot() == ["sideways: the tyres hold it"]


def test_wheels_without_names_are_numbered_from_one():
    assert [entry.name for entry in read_robot(ROBOTS["three omni"], "r").wheels] == ["1", "2", "3"]


def test_sizes_may_be_whole_or_half():
    half = {**DIFFERENTIAL, "half_track_m": 0.15, "wheel_radius_m": 0.066}
    half = {key: value for key, value in half.items() if key not in ("track_m", "wheel_diameter_m")}
    assert np.array_equal(read_robot(half, "r").geometry.inverse, read_robot(DIFFERENTIAL, "r").geometry.inverse)


def test_the_order_of_the_wheels_is_that_of_their_names():
    swapped = read_robot({**DIFFERENTIAL, "wheels": ["left", "right"]}, "r")
    assert np.array_equal(swapped.geometry.inverse[::-1], read_robot(DIFFERENTIAL, "r").geometry.inverse)


@pytest.mark.parametrize("names", [["rechts_r", "links_l"], ["wheel_right", "wheel_left"], ["R", "L"], ["fr", "fl"]])
def test_sides_are_told_by_names(names):
    assert [entry.wheel.y_m for entry in read_robot({**DIFFERENTIAL, "wheels": names}, "r").wheels] == [-0.15, 0.15]


def test_a_listed_wheel_has_every_size_of_its_own():
    data = {"kind": "listed", "wheels": {
        "big": {"y_m": 0.2, "diameter_m": 0.2, "tyre": True}, "small": {"y_m": -0.2, "diameter_m": 0.1, "tyre": True},
    }}
    assert read_robot(data, "r").geometry.inverse[:, 0] == pytest.approx([10.0, 20.0])


@pytest.mark.parametrize("name", ROBOTS)
def test_the_scenario_of_a_robot_file_is_that_robot(name):
    robot = read_robot(ROBOTS[name], "r")
    scenario = read(Scenario(), robot.scenario(), "r")
    assert np.array_equal(scenario.rover.plant.geometry.inverse, robot.geometry.inverse)
    labels = robots()["rover"].wheel_labels(scenario.rover.plant)
    assert [names[0] for names in labels] == [entry.name for entry in robot.wheels]
    build_diagram(scenario)


def test_tyres_hold_a_motion_and_rollers_none():
    assert read_robot(DIFFERENTIAL, "r").cannot() == ["sideways: the tyres hold it"]
    assert read_robot(OMNI, "r").cannot() == read_robot(MECANUM, "r").cannot() == []


@pytest.mark.parametrize("change, message", [
    ({"track_m": 0.03}, "larger than its distance"), ({"wheel_diameter_m": 0.004}, "in metres"),
    ({"track_m": 300e-3 / 100}, "in the same place"),
])
def test_sizes_that_look_wrong_are_said(change, message):
    assert any(message in sentence for sentence in read_robot({**DIFFERENTIAL, **change}, "r").doubts())


def test_usual_robots_look_right():
    assert all(read_robot(data, "r").doubts() == [] for data in ROBOTS.values())


def test_rollers_that_leave_a_motion_unseen_are_refused():
    wheels = {n: {"x_m": x, "y_m": y, "roller_deg": 45.0} for n, x, y in (("a", 1, 1), ("b", 1, -1), ("c", -1, 1))}
    with pytest.raises(InputError, match="leave a direction of motion unseen"):
        read_robot({"kind": "listed", "wheels": {**wheels, "c": {**wheels["a"]}}}, "r")


@pytest.mark.parametrize("change, message", [
    ({"kind": "diff"}, "did you mean 'differential'|expected one of"), ({"track_m": None}, "got neither"),
    ({"half_track_m": 0.1}, "got both"), ({"wheelbase_m": 1.0}, "a robot of kind differential has none"),
    ({"wheels": ["left"]}, "expected 2 different names"), ({"wheels": ["a", "b"]}, "neither left nor right"),
    ({"wheels": ["left!", "right"]}, "neither left|letters, digits"), ({"name": "my robot"}, "letters, digits"),
    ({"colour": 1}, "unknown key"), ({"track_m": -0.3}, "more than 0"),
])
def test_what_is_wrong_with_a_robot_file_is_named(change, message):
    with pytest.raises(InputError, match=f"r: .*({message})"):
        read_robot({**DIFFERENTIAL, **change}, "r")


def test_two_mecanum_wheels_of_one_corner_are_refused():
    names = ["front_left", "front_right", "hinten_left", "front_right_2"]
    with pytest.raises(InputError, match="front or rear, left or right of each corner"):
        read_robot({**MECANUM, "wheels": names}, "r")


def test_the_command_shows_it(said, tmp_path):
    (tmp_path / "r.yaml").write_text("kind: differential\nwheel_diameter_m: 0.1\ntrack_m: 0.3\n")
    text = said("robot", tmp_path / "r.yaml", "--out", tmp_path / "r.png")
    assert "cannot move sideways" in text and "left" in text and (tmp_path / "r.png").stat().st_size > 5000
