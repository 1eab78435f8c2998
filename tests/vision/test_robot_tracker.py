"""Robots that look alike, followed from frame to frame by an eye that is told what it sees."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.vision.finding.patterns import Sighting
from drake_ispace.vision.finding.tracker import Tracker

FRAME_S = 1.0 / 30.0


class ToldEye:
    """Sees what it is told: (names, places) of each pattern; places are x, y."""

    def __init__(self, names):
        targets = [SimpleNamespace(name=name) for name in names]
        self.names, self.looks = names, [SimpleNamespace(top=SimpleNamespace(pixel_m=(0.005, 0.005)), targets=targets)]

    def see(self, places):
        return [(self.names, [Sighting(x, y, 0.0, np.array([x, y])) for x, y in places])]


def followed(names, frames, **settings):
    """Name -> (x, y, sure) or None in every frame."""
    tracker = Tracker(ToldEye(names), **settings)
    return [
        {name: one and (one.x, one.y, one.sure) for name, one in tracker.follow(i * FRAME_S, places).items()}
        for i, places in enumerate(frames)
    ]


def test_robots_that_look_alike_are_named_from_left_to_right():
    assert followed(["a", "b", "c"], [[(1, 0), (-1, 0), (0, 5)]])[0] == {
        "a": (-1, 0, True), "b": (0, 5, True), "c": (1, 0, True)}


def test_or_by_where_they_start():
    found = followed(["a", "b"], [[(1, 0), (-1, 0)]], starts={"a": (0.9, 0.1), "b": (-0.8, 0.0)})[0]
    assert found == {"a": (1, 0, True), "b": (-1, 0, True)}


def test_two_that_cross_keep_their_names():
    t = np.arange(60) * FRAME_S
    frames = [[(-0.5 + 0.5 * s, 0.0), (0.5 - 0.5 * s, 0.05)] for s in t]
    last = followed(["a", "b"], frames)[-1]
    assert last["a"][0] == pytest.approx(frames[-1][0][0]) and last["b"][0] == pytest.approx(frames[-1][1][0])


def test_the_order_in_which_they_are_seen_does_not_matter():
    t = np.arange(60) * FRAME_S
    frames = [[(-0.5 + 0.5 * s, 0.0), (0.5 - 0.5 * s, 0.05)][:: (-1) ** i] for i, s in enumerate(t)]
    assert followed(["a", "b"], frames)[-1]["a"][0] == pytest.approx(-0.5 + 0.5 * t[-1])


@pytest.mark.parametrize("lost", [1, 20, 200])
def test_a_robot_that_is_hidden_keeps_its_name(lost):
    frames = [[(0.0, 0.0), (1.0, 0.0)]] * 5 + [[(0.0, 0.0)]] * lost + [[(0.0, 0.0), (1.2, 0.0)]] * 3
    found = followed(["a", "b"], frames)
    assert all(one["a"] == (0.0, 0.0, True) for one in found)
    assert found[5]["b"] is None and found[-1]["b"] == (1.2, 0.0, True)


def test_both_hidden_for_20_frames_while_they_drive_on():
    t = np.arange(60) * FRAME_S
    frames = [[(0.3 * s, 0.0), (0.3 * s, 1.0)] if not 20 <= i < 40 else [] for i, s in enumerate(t)]
    found = followed(["a", "b"], frames)[-1]
    assert found["a"][1:] == (0.0, True) and found["b"][1:] == (1.0, True)


def test_two_that_come_back_between_their_places_are_no_longer_sure():
    frames = [[(0.0, 0.0), (0.4, 0.0)]] * 5 + [[]] * 20 + [[(0.19, 0.1), (0.21, -0.1)]]
    found = followed(["a", "b"], frames)[-1]
    assert found["a"] is not None and not found["a"][2] and not found["b"][2]


def test_neither_is_the_other_one_that_comes_later():
    frames = [[(0.0, 0.0), (0.4, 0.0)]] * 5 + [[]] * 20 + [[(0.2, 0.1)]] * 2 + [[(0.2, 0.1), (0.3, 0.5)]]
    found = followed(["a", "b"], frames)[-1]
    assert not found["a"][2] and not found["b"][2]


def test_a_robot_is_not_seen_where_it_cannot_have_come_to():
    frames = [[(0.0, 0.0)]] * 5 + [[(1.5, 0.0)]] + [[(0.0, 0.0)]]
    found = [one["a"] for one in followed(["a"], frames)]
    assert found[5] is None and found[6] == (0.0, 0.0, True)


def test_it_is_there_after_it_had_the_time():
    frames = [[(0.0, 0.0)]] * 5 + [[]] * 20 + [[(1.5, 0.0)]]
    assert followed(["a"], frames)[-1]["a"] == (1.5, 0.0, True)


def test_a_thing_that_looks_like_it_is_not_taken_for_the_robot():
    frames = [[(0.0, 0.0)]] * 5 + [[(0.0, 0.0), (0.8, 0.0)]] * 5
    assert followed(["a"], frames)[-1]["a"] == (0.0, 0.0, True)


def test_of_two_things_from_the_start_none_is_the_robot():
    assert followed(["a"], [[(0.0, 0.0), (0.8, 0.0)]])[0] == {"a": None}


def test_a_push_does_not_lose_it():
    places = [(0.0, 0.0)] * 10 + [(0.027 * i, 0.0) for i in range(1, 12)]
    found = followed(["a", "b"], [[place, (0.0, 0.4)] for place in places])
    assert [one["a"][:2] for one in found] == places and all(one["a"][2] for one in found)
