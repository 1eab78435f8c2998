"""The radio link: delay and losses."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.link import Link, RoomLink, delay_ticks

FIX, WAY_POINT = 5, 10


@pytest.mark.parametrize("baud, size, ticks", [
    # 9 bytes of frame and 4 a number, 10 bits a byte: 690 bits with a way point, 490 with a tracking error
    (9600, WAY_POINT, 15),  # 71.9 ms
    (9600, 5, 11),  # 51.04 ms
    (115200, WAY_POINT, 2),  # 5.99 ms
    (1_000_000, WAY_POINT, 1),  # any line takes a tick
    (0, WAY_POINT, 0),
])
def test_the_line_needs_whole_ticks_for_a_frame(baud, size, ticks):
    assert delay_ticks(Link(baud_rate=baud), size) == ticks
    assert delay_ticks(Link(baud_rate=baud, delay_ticks=3), size) == ticks + 3


def sent(tick, stamp=None, order=0.0):
    """Inputs of one tick: a fix captured at `stamp` and an order of one number."""
    stamp = tick if stamp is None else stamp
    return {"fix": [stamp, 1.0, 0.1 * stamp, 0.0, 0.0], "order": [order], "robot_tick": tick}


def test_without_delay_a_frame_arrives_in_the_tick_it_is_sent(drive):
    ticks = [sent(k, 19 * (k // 19), 5.0) for k in range(40)]
    assert np.array_equal(drive(RoomLink(Link(), 1), "fix", ticks), [tick["fix"] for tick in ticks])
    assert (drive(RoomLink(Link(), 1), "order", ticks) == 5.0).all()


def test_it_is_feed_through():
    block = RoomLink(Link(), 1)
    assert block.HasDirectFeedthrough(0, 0)
    assert block.HasDirectFeedthrough(1, 1)


@pytest.mark.parametrize("delay", [1, 15, 30])
def test_a_frame_arrives_its_delay_later(drive, delay):
    rows = drive(RoomLink(Link(delay_ticks=delay), 1), "fix", [sent(k, 19 * (k // 19)) for k in range(80)])
    for tick, (stamp, _, x, _, _) in enumerate(rows):
        expected = 19 * ((tick - delay) // 19) if tick >= delay else -1
        assert stamp == expected
        assert x == (0.1 * expected if expected >= 0 else 0.0)


def test_a_new_order_travels_with_the_fix_of_its_tick(drive):
    ticks = [sent(k, 0, order=float(k >= 10)) for k in range(30)]
    assert list(drive(RoomLink(Link(delay_ticks=7), 1), "order", ticks)[:, 0]) == [-1.0] * 7 + [0.0] * 10 + [1.0] * 13


def test_frames_under_way_keep_their_order(drive):
    # a new frame every tick, 20 under way at once
    rows = drive(RoomLink(Link(delay_ticks=20), 1), "fix", [sent(k) for k in range(60)])
    assert list(rows[:, 0]) == [-1.0] * 20 + list(range(40))


def test_before_the_first_frame_there_is_nothing(drive):
    block = RoomLink(Link(), 2)
    context = block.CreateDefaultContext()
    for name, value in (("fix", [-1.0, 0, 0, 0, 0]), ("order", [-1.0, 0.0]), ("robot_tick", [-1.0])):
        block.GetInputPort(name).FixValue(context, value)
    assert list(block.GetOutputPort("fix").Eval(context)) == [-1, 0, 0, 0, 0]
    assert list(block.GetOutputPort("order").Eval(context)) == [-1, 0]


@pytest.mark.parametrize("link, share", [
    (Link(loss=0.2), 0.2), (Link(corruption=0.1), 0.1), (Link(loss=0.2, corruption=0.1), 0.28), (Link(loss=1.0), 1.0),
])
def test_the_share_of_frames_that_are_lost(drive, link, share):
    stamps = drive(RoomLink(link, 1), "fix", [sent(k) for k in range(1500)])[:, 0]
    lost = np.mean(stamps != np.arange(1500))
    assert lost == pytest.approx(share, abs=0.06)  # five standard deviations


def test_a_lost_frame_leaves_the_last_one_in_force(drive):
    stamps = drive(RoomLink(Link(loss=0.5), 1), "fix", [sent(k) for k in range(300)])[:, 0]
    assert (np.diff(stamps) >= 0.0).all()
    assert set(stamps) <= {-1.0, *range(300)}


def test_losses_repeat_with_the_seed_and_differ_between_robots(drive):
    def stamps(**stream):
        return list(drive(RoomLink(Link(loss=0.5), 1, **stream), "fix", [sent(k) for k in range(64)])[:, 0])

    assert stamps(seed=1) == stamps(seed=1)
    assert stamps(seed=1) != stamps(seed=2)
    assert stamps(where="omni.link") != stamps(where="pendulum.link")


def test_a_line_slower_than_a_frame_a_second_is_refused():
    with pytest.raises(InputError, match=r"space\.link\.baud_rate: 1 bit/s, expected at least 690"):
        delay_ticks(Link(baud_rate=1), 10)
