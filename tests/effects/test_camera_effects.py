"""Effects of the room's camera: numbers by hand, nothing at neutral, the same in both engines."""

import numpy as np
import pytest
from passing import passed, with_effects

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.noise import stream
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Body, EffectBlock
from drake_ispace.effects.library import library
from drake_ispace.effects.places.camera import hidden
from drake_ispace.robots.library import robots
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate
from drake_ispace.wiring.catalog import build_diagram

BODY = Body(robots()["omni"], None, 4)
#: Effects of the camera -> values away from neutral.
EFFECTS = {
    "camera_latency": {"latency_s": 0.033}, "marker_offset": {"x_m": 0.02, "y_m": -0.01},
    "camera_scale": {"share": 0.03}, "camera_rotation": {"angle_rad": -0.02},
    "camera_offset": {"x_m": 0.01, "y_m": 0.02}, "camera_dropouts": {"share": 0.3},
    "camera_distortion": {"per_m2": 0.02}, "camera_keystone": {"x_per_m": 0.02, "y_per_m": -0.01},
}
SHARP = ["space.localizer.whole_pixels=false", "space.localizer.noise_std_pixels=0"]


def block(name, **values):
    effect = library()[name]
    return EffectBlock(effect, BODY, effect.neutral(BODY) | values)


def along(poses, latency_s):
    """What is reported of a robot that goes through `poses`, one a tick; the update of a tick changes nothing in it."""
    made = block("camera_latency", latency_s=latency_s)
    context, rows = made.CreateDefaultContext(), []
    (update,) = made.spec.updates
    for tick, pose in enumerate(poses):
        context.SetTime(tick * TICK_S)
        made.GetInputPort("pose").FixValue(context, np.asarray(pose, dtype=float))
        rows.append(made.GetOutputPort("pose").Eval(context).copy())
        held, stored = context.get_discrete_state_vector().CopyToVector(), np.empty(len(made.spec.discrete_state))
        update.kernel(tick, held, np.asarray(pose, dtype=float), stored)
        context.SetDiscreteState(stored)
        assert np.array_equal(made.GetOutputPort("pose").Eval(context), rows[-1])
    return np.array(rows)


def omni(effects, *settings):
    return with_effects("omni_multirate", effects, "seconds=4", *settings)


def messages(signals, robot="omni"):
    """The fixes as they came: one row each."""
    rows = signals[f"{robot}_fix"]
    return rows[np.flatnonzero(np.diff(rows[:, 0], prepend=-1.0))]


NEUTRAL = {name: library()[name].neutral(BODY) for name in EFFECTS}
DROPOUTS = NEUTRAL | {"camera_dropouts": {"share": 0.5}}


# By hand



@pytest.mark.parametrize("name, values, warped", [
    ("camera_distortion", {"per_m2": 0.1}, lambda p: p * (1.0 + 0.1 * (p @ p))),
    ("camera_keystone", {"x_per_m": 0.1, "y_per_m": -0.2}, lambda p: p / (1.0 - 0.1 * p[0] + 0.2 * p[1])),
])
def test_a_warped_picture_moves_places_and_turns_headings_with_them(name, values, warped):
    place, phi = np.array([0.8, -0.5]), 0.7
    ahead = 1e-6 * np.array([np.cos(phi), np.sin(phi)])
    x, y, heading = passed(name, BODY, [*place, phi], **values)
    assert [x, y] == pytest.approx(warped(place))
    along = warped(place + ahead) - warped(place - ahead)
    assert heading == pytest.approx(np.arctan2(along[1], along[0]), abs=1e-8)


def test_places_as_a_camera_reports_them():
    assert passed("camera_scale", BODY, [1.0, -2.0, 0.5], share=0.1) == pytest.approx([1.1, -2.2, 0.5])
    assert passed("camera_offset", BODY, [1.0, -2.0, 0.5], x_m=0.1, y_m=0.2) == pytest.approx([1.1, -1.8, 0.5])


def test_a_camera_that_is_turned_turns_places_and_headings():
    c, s = np.cos(0.4), np.sin(0.4)
    assert passed("camera_rotation", BODY, [1.0, 0.0, 0.5], angle_rad=0.4) == pytest.approx([c, s, 0.9])
    assert passed("camera_rotation", BODY, [0.0, 2.0, -0.5], angle_rad=0.4) == pytest.approx([-2.0 * s, 2.0 * c, -0.1])


def test_markers_off_the_middle_turn_with_the_robot():
    facing_y = [1.0, 2.0, 0.5 * np.pi]
    assert passed("marker_offset", BODY, facing_y, x_m=0.1, y_m=0.02) == pytest.approx([0.98, 2.1, 0.5 * np.pi])
    assert passed("marker_offset", BODY, [1.0, 2.0, np.pi], x_m=0.1) == pytest.approx([0.9, 2.0, np.pi])


STEADY = np.column_stack([0.001 * np.arange(80.0), -0.002 * np.arange(80.0), 0.01 * np.arange(80.0)])


@pytest.mark.parametrize("ticks", [0.0, 0.25, 1.0, 6.5, 20.0, 50.0])
def test_of_a_steady_motion_the_pose_of_a_latency_ago_is_reported(ticks):
    rows = along(STEADY, ticks * TICK_S)
    assert rows == pytest.approx(np.maximum(np.arange(80) - ticks, 0.0)[:, None] * STEADY[1], abs=1e-15)


def test_between_two_ticks_headings_go_the_short_way():
    poses = [[0.0, 0.0, 3.0], [0.0, 0.0, 3.0], [0.0, 0.0, 3.1 - 2.0 * np.pi]]
    assert along(poses, 0.5 * TICK_S)[2, 2] == pytest.approx(3.05 - 2.0 * np.pi)


def test_without_latency_not_a_bit_changes():
    poses = np.random.default_rng(0).normal(size=(120, 3))
    assert np.array_equal(along(poses, 0.0), poses)


@pytest.mark.slow
def test_a_robot_is_hidden_for_whole_vision_instants():
    key, out, lost = stream(0, "test"), np.empty(3), []
    for tick in range(19 * 2000 + 1):
        hidden(tick, np.ones(3), 0.3, key, out)
        lost.append(np.isnan(out).any())
    lost = np.array(lost)
    instants = lost[19::19]
    assert np.array_equal(np.repeat(instants, 19), lost[1:])  # the ticks that lead up to an instant share its fate
    assert instants.mean() == pytest.approx(0.3, abs=3.0 * np.sqrt(0.3 * 0.7 / 2000))


# In the Diagram


@pytest.fixture(scope="module")
def base():
    return simulate_compiled(omni({})).signals


@pytest.fixture(scope="module")
def at_neutral():
    return simulate_compiled(omni(NEUTRAL)).signals


def test_at_neutral_every_signal_is_that_of_the_base_model(base, at_neutral):
    assert set(base) == set(at_neutral)
    assert [name for name in base if not np.array_equal(base[name], at_neutral[name])] == []


def test_both_engines_agree_on_effects_of_the_camera(at_neutral):
    assert parity(omni(EFFECTS))["max_abs_difference"] == 0.0


def test_effects_act_from_the_robot_to_the_message():
    straight = {"camera_dropouts": {}, "camera_distortion": {}, "camera_keystone": {}}
    signals = simulate_compiled(omni(EFFECTS | straight, *SHARP)).signals
    fixes, poses = messages(signals), signals["omni_pose"]
    assert len(fixes) > 15
    for tick, seen, x, y, phi in fixes[2:]:
        at = tick - 0.033 / TICK_S
        before = int(at)
        share = at - before
        p = (1.0 - share) * poses[before] + share * poses[before + 1]
        c, s = np.cos(p[2]), np.sin(p[2])
        place = 1.03 * (p[:2] + [c * 0.02 + s * 0.01, s * 0.02 - c * 0.01])
        c, s = np.cos(-0.02), np.sin(-0.02)
        mapped = [c * place[0] - s * place[1] + 0.01, s * place[0] + c * place[1] + 0.02]
        assert [x, y] == pytest.approx(mapped, abs=1e-12)
        assert (seen, phi) == pytest.approx((1.0, p[2] - 0.02), abs=1e-12)


def test_dropouts_are_fixes_in_which_the_robot_is_not_seen(base):
    signals = simulate_compiled(omni(DROPOUTS)).signals
    assert all(np.isfinite(rows).all() for rows in signals.values())
    fixes, all_seen = messages(signals), messages(base)
    assert np.array_equal(fixes[:, 0], all_seen[:, 0]) and all_seen[:, 1].all()
    assert 10 <= fixes[:, 1].sum() <= len(fixes) - 10
    assert not fixes[fixes[:, 1] == 0.0, 2:].any()


def test_dropouts_have_a_stream_of_their_own_under_the_seed_of_a_campaign():
    rollout = compile_diagram(build_diagram(omni(DROPOUTS)))
    lost = {seed: messages(rollout.run(800, rollout.with_seed(seed)))[:, 1].tolist() for seed in (0, 1)}
    assert lost[0] != lost[1]
    key = [rollout.parameters[rollout.index(f"omni_camera_dropouts.noise_stream[{i}]")] for i in range(2)]
    assert np.array_equal(key, stream(0, "omni.camera_dropouts"))


def test_each_robot_is_seen_through_its_own_effects():
    settings = ["omni.effects.camera_offset.x_m=0.1", "pendulum.effects.camera_dropouts.share=0.9"]
    signals = simulate(load_scenario("shared_space", ["seconds=0.2", *settings, *SHARP])).signals
    omni, pendulum = messages(signals, "omni"), messages(signals, "pendulum")
    assert omni[:, 2] - signals["omni_pose"][omni[:, 0].astype(int), 0] == pytest.approx([0.1] * len(omni))
    assert omni[:, 1].all() and not pendulum[:, 1].all()


@pytest.mark.slow
def test_a_hidden_robot_is_in_no_image():
    settings = ["seconds=0.6", "space.localizer.mode=image", "omni.effects.camera_dropouts.share=0.5"]
    omni = messages(simulate(load_scenario("shared_space", settings)).signals)
    pattern = [messages(simulate(with_effects("omni_multirate", DROPOUTS, "seconds=0.6")).signals)[:, 1]]
    assert np.array_equal([omni[:, 1]], pattern) and 0 < omni[:, 1].sum() < len(omni)


@pytest.mark.parametrize("setting, words", [
    ("omni.effects.camera_latency.latency_s=-0.01", "at least 0 \\[s\\]"),
    ("omni.effects.camera_latency.latency_s=0.3", "at most 0.25 \\[s\\]"),
    ("omni.effects.camera_dropouts.share=0.95", "at most 0.9"),
    ("omni.effects.camera_dropouts.share=-0.1", "at least 0"),
    ("omni.effects.camera_offset.z_m=0.1", "unknown parameter"),
    ("omni.effects.camera_turn.angle_rad=0.1", "no such effect"),
])
def test_what_cannot_be_is_refused(setting, words):
    with pytest.raises(InputError, match=words):
        load_scenario("omni_multirate", [setting])
