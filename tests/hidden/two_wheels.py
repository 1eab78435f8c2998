"""Recordings of a two-wheeled robot with a velocity command, wheel encoders and motion capture; plain numpy.

Three things may be hidden at once: a left wheel that is larger than believed, motion capture that reports late, and a
drive that lags behind its command. OTHERS lists what else may be.
"""

from collections.abc import Mapping

import numpy as np
from scipy.signal import cont2discrete, lfilter

from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import Scenario, load_scenario

RADIUS_M, HALF_TRACK_M = 0.05, 0.15
COUNTS = 2048
_STEP_S = 1e-3
FIX_RMS = (5e-4, 5e-4, 2e-3)
_SLIP_RMS = 2e-3

#: Neutral values of whatever else may be hidden.
OTHERS = {
    "radius_share": 0.0,  # both wheels larger
    "track_share": 0.0,  # the wheels further apart
    "lost_share": 0.0,  # of the counts of the left wheel
    "slip_share": 0.0,  # of the way
    "marker_x_m": 0.0,  # the marker in front of the middle,
    "marker_y_m": 0.0,  # to the left of it
    "camera_share": 0.0,  # motion capture shows the room larger
    "delay_s": 0.0,  # of the command
    "gain_share": 0.0,  # the drive turns the wheels faster than told
    "ramp_s2_m": 0.0,  # one over the largest acceleration of the drive; that of turns is four times as many rad/s^2
    "skid_s": 0.0,  # the robot slides outwards: sideways velocity over speed times turning rate
    "swing_s2": 0.0,  # the drive overshoots: one over the square of its frequency, damped by a third
    "dead_rad_s": 0.0,  # a wheel that is told less stands still, and is as much slower if told more
    "clipped_s_rad": 0.0,  # one over the largest speed of a wheel, each by itself,
    "slowed_s_rad": 0.0,  # of the faster wheel, the other slowed by the same share
    "turns_s_rad": 0.0,  # one over the largest turning rate of the robot
    "brake_s2_m": 0.0,  # as ramp_s2_m, but only where the robot becomes slower
    "errs_m_s": 0.0,  # each wheel that is told to turn errs by so much, for some 0.3 s at a time
    # what no library names
    "lean_s2_m": 0.0,  # the outer wheel is pressed: share of the radius over speed times turning rate
    "belt_m_s": 0.0,  # the floor moves along x of W
    "deflating_share": 0.0,  # of the left radius, lost until the end of the run
    "punctured_share": 0.0,  # of the left radius, lost at once in the middle of the run
    "patch_share": 0.0,  # slip where x > 1 m
    "fast_slip_s2_m2": 0.0,  # slip over the square of the speed
    "skewed_share": 0.0,  # motion capture's x grows with y
    "warped_rad_m": 0.0,  # its heading with x
    "ripple_rad": 0.0,  # both encoders, twice a turn
    "least_rad_s": 0.0,  # a wheel that is told less stands still, and is as told if told more
    "steps_rad_s": 0.0,  # the drive knows multiples of this speed only
}


def model() -> Scenario:
    """The robot as it is believed to be."""
    return load_scenario("velocity_base", [
        "rover.plant.wheels=differential", f"rover.plant.radius_m={RADIUS_M}",
        f"rover.plant.half_track_m={HALF_TRACK_M}",
    ])


def drive(
    seed: int, seconds: float = 30.0, left_share: float = 0.04, late_s: float = 0.08, lag_s: float = 0.06,
    camera_hz: float = 30.0, encoder_hz: float = 50.0, others: Mapping[str, float] | None = None,
    in_step: bool = False, speeds_m_s: tuple[float, float] = (0.1, 0.5),
    rates_rad_s: tuple[float, float] = (-1.0, 1.0), ramp_s: float = 0.0, seized_s: tuple[float, ...] = (),
    moves: float = 1.0, stopped_s: tuple[float, ...] = (),
) -> Recording:
    """A run: two seconds at rest, then speeds and turning rates that change every few seconds.

    Args:
        seed: of the commands and of all noise. left_share: by which the left wheel is larger than believed.
        late_s: by which motion capture stamps its poses late [s]. lag_s: time constant of the drive [s].
        others: further things that are hidden, by their names in OTHERS. in_step: whether the command changes only when
            it is logged, not at any moment. speeds_m_s, rates_rad_s: between which the commands are drawn. ramp_s: how
            long each change of a command takes [s]. seized_s: between which the left wheel turns a fifth as fast as
            it is told. moves: probability that the robot moves in each two seconds; it rests in the others.
        stopped_s: between which both wheels stand, whatever they are told.
    """
    o = OTHERS | dict(others or {})
    random = np.random.default_rng([seed, 77])
    n = round(seconds / _STEP_S)
    t = _STEP_S * np.arange(n)
    step_s = 1.0 / encoder_hz if in_step else _STEP_S
    v, w = wandering(random, t, *speeds_m_s, step_s), wandering(random, t, *rates_rad_s, step_s)
    if moves < 1.0:
        moves_then = np.random.default_rng([seed, 79]).random(round(seconds)) < moves
        v, w = (rates * moves_then[(t / 2.0).astype(int)] for rates in (v, w))
    if ramp_s > 0.0:
        ramp = np.full(round(ramp_s / _STEP_S), _STEP_S / ramp_s)
        last = np.arange(n) if not in_step else np.arange(n) // round(step_s / _STEP_S) * round(step_s / _STEP_S)
        v, w = lfilter(ramp, [1.0], v)[last], lfilter(ramp, [1.0], w)[last]
    command = np.column_stack([v, np.zeros(n), w])
    if o["turns_s_rad"] > 0.0:
        w = np.clip(w, -1.0 / o["turns_s_rad"], 1.0 / o["turns_s_rad"])
    if o["ramp_s2_m"] > 0.0:
        v, w = _ramped(v, _STEP_S / o["ramp_s2_m"]), _ramped(w, 4.0 * _STEP_S / o["ramp_s2_m"])
    if o["brake_s2_m"] > 0.0:
        v, w = _braked(v, _STEP_S / o["brake_s2_m"]), _braked(w, 4.0 * _STEP_S / o["brake_s2_m"])
    sent = np.column_stack([v + HALF_TRACK_M * w, v - HALF_TRACK_M * w]) / RADIUS_M  # right, left, as it believes
    late = round(o["delay_s"] / _STEP_S)
    sent = (1.0 + o["gain_share"]) * np.vstack([np.zeros((late, 2)), sent[: n - late]])
    sent = np.sign(sent) * np.maximum(np.abs(sent) - o["dead_rad_s"], 0.0)
    if o["clipped_s_rad"] > 0.0:
        sent = np.clip(sent, -1.0 / o["clipped_s_rad"], 1.0 / o["clipped_s_rad"])
    sent /= np.maximum(o["slowed_s_rad"] * np.abs(sent).max(axis=1, keepdims=True), 1.0)
    sent = np.where(np.abs(sent) < o["least_rad_s"], 0.0, sent)
    if o["steps_rad_s"] > 0.0:
        sent = o["steps_rad_s"] * np.round(sent / o["steps_rad_s"])
    if seized_s:
        sent[(t >= seized_s[0]) & (t < seized_s[1]), 1] *= 0.2
    if stopped_s:
        sent[(t >= stopped_s[0]) & (t < stopped_s[1])] = 0.0
    if o["swing_s2"] > 0.0:
        sent = _swung(sent, 1.0 / np.sqrt(o["swing_s2"]))
    keep = np.exp(-_STEP_S / lag_s) if lag_s > 0.0 else 0.0
    rate = lfilter([1.0 - keep], [1.0, -keep], sent, axis=0)
    if o["errs_m_s"] > 0.0:
        rate += _erring(seed, n) * (o["errs_m_s"] / RADIUS_M) * (sent != 0.0)
    angle = np.vstack([np.zeros(2), np.cumsum(rate[:-1] * _STEP_S, axis=0)])
    slip = 1.0 - _SLIP_RMS * lfilter([0.05], [1.0, -0.95], random.standard_normal((n, 2)), axis=0) / 0.16
    left = 1.0 + left_share - o["deflating_share"] * t / seconds - o["punctured_share"] * (2.0 * t > seconds)
    pressed = o["lean_s2_m"] * RADIUS_M**2 / (4.0 * HALF_TRACK_M) * (rate[:, 0] ** 2 - rate[:, 1] ** 2)  # of the right
    ground = rate * slip * (1.0 + o["radius_share"]) * RADIUS_M * np.column_stack([1.0 - pressed, left + pressed])
    turn = (ground[:, 0] - ground[:, 1]) / (2.0 * HALF_TRACK_M * (1.0 + o["track_share"]))
    phi = 0.3 + np.concatenate([[0.0], np.cumsum(turn[:-1] * _STEP_S)])
    forward = ground.mean(axis=1) * (1.0 - o["slip_share"])
    forward *= 1.0 - o["fast_slip_s2_m2"] * forward**2
    x, y = _way(forward, -o["skid_s"] * forward * turn, phi, o["belt_m_s"], o["patch_share"])
    stamps = np.arange(0.013, seconds - _STEP_S, 1.0 / camera_hz)
    c, s = np.cos(phi), np.sin(phi)
    x, y = x + c * o["marker_x_m"] - s * o["marker_y_m"], y + s * o["marker_x_m"] + c * o["marker_y_m"]
    x, y, phi = x * (1.0 + o["camera_share"]), y * (1.0 + o["camera_share"]), phi + o["warped_rad_m"] * x
    x = x + o["skewed_share"] * y
    seen = np.column_stack([np.interp(stamps - late_s, t, column) for column in (x, y, phi)])
    seen += random.standard_normal(seen.shape) * FIX_RMS
    seen[:, 2] = np.mod(seen[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    read = np.arange(0, n, round(1.0 / encoder_hz / _STEP_S))
    count = 2.0 * np.pi / COUNTS
    shown = angle + o["ripple_rad"] * np.sin(2.0 * angle)
    shown[:, 1] *= 1.0 - o["lost_share"]
    counted = count * np.floor(shown[read] / count + random.uniform(0.0, 1.0, 2))
    return Recording("mine", "velocity_base", {
        "command": Channel(t[read], ("vx", "vy", "wz"), command[read], {}, 1.0 / encoder_hz),
        "encoder": Channel(t[read], ("theta_1", "theta_2"), counted, {}, 1.0 / encoder_hz),
        "kinect": Channel(np.round(stamps, 6), ("x", "y", "phi"), seen, {}, None),
    }, f"two wheels, seed {seed}")


def _erring(seed, n):
    """(n, 2) noise of unit variance, alike for some 0.3 s."""
    keep = np.exp(-_STEP_S / 0.3)
    white = np.random.default_rng([seed, 78]).standard_normal((n, 2))
    return lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=0)


def _way(forward, sideways, phi, belt_m_s, patch_share):
    """(n,) x and y [m] of a robot that moves with these velocities along its own axes, and slips where x > 1 m."""
    c, s = np.cos(phi), np.sin(phi)
    if patch_share == 0.0:
        vx, vy = forward * c - sideways * s + belt_m_s, forward * s + sideways * c
        return tuple(np.cumsum(np.append(at, _STEP_S * v[:-1])) for at, v in ((1.0, vx), (-0.5, vy)))
    x, y = np.empty(len(phi)), np.empty(len(phi))
    x[0], y[0] = 1.0, -0.5
    for i in range(len(phi) - 1):
        share = 1.0 - patch_share if x[i] > 1.0 else 1.0
        x[i + 1] = x[i] + _STEP_S * (share * forward[i] * c[i] - sideways[i] * s[i] + belt_m_s)
        y[i + 1] = y[i] + _STEP_S * (share * forward[i] * s[i] + sideways[i] * c[i])
    return x, y


def _ramped(told, most):
    """(n,) what follows `told` by at most so much a step."""
    reached, at = np.empty(len(told)), 0.0
    for i, value in enumerate(told):
        at += min(max(value - at, -most), most)
        reached[i] = at
    return reached


def _braked(told, most):
    """(n,) what comes nearer to rest by at most so much a step, and else is as told."""
    reached, at = np.empty(len(told)), 0.0
    for i, value in enumerate(told):
        least = max(abs(at) - most, 0.0)
        at = np.sign(at) * least if least > 0.0 and value * np.sign(at) < least else value
        reached[i] = at
    return reached


def _swung(told, frequency):
    """(n, 2) what follows `told` like a mass on a spring whose damping is a third of the critical one."""
    system = [frequency**2], [1.0, 2.0 / 3.0 * frequency, frequency**2]
    above, below, _ = cont2discrete(system, _STEP_S)
    return lfilter(above.ravel(), below, told, axis=0)


def wandering(random, t, low, high, step_s):
    """(k,) values that are held for one to four seconds each, a multiple of `step_s`; zero in the first two."""
    values, at = np.zeros(len(t)), 2.0
    while at < t[-1]:
        until = step_s * round((at + random.uniform(1.0, 4.0)) / step_s)
        values[(t >= at - 1e-9) & (t < until - 1e-9)] = random.uniform(low, high)
        at = until
    return values
