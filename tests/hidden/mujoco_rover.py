"""Recordings of a two-wheeled robot with a caster, or of one on four tyres, in MuJoCo under commanded velocity.

Servos turn the wheels, soft contacts with a friction cone move the body. Nothing of `two_wheels.py` is in it but the
dimensions, the command and the noise of the sensors.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from drake_ispace.files.recording import Channel, Recording
from hidden.two_wheels import COUNTS, FIX_RMS, HALF_TRACK_M, RADIUS_M, wandering

_STEP_S = 1e-3
_ENCODER_HZ, _CAMERA_HZ = 50.0, 30.0
_RAMP_S = 0.3  # that each change of the command takes
_START_RAD = 0.3
_WHEELBASE_M = 0.2  # of four tyres
_CASTER_M = 0.015

_MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="implicitfast" cone="elliptic" impratio="100"/>
  <worldbody>
    <geom type="plane" size="20 20 1" friction="1 0.005 0.0001" solref="0.004 1"/>
    <body pos="1 -0.5 {radius}" euler="0 0 {heading}">
      <freejoint/>
      <inertial pos="{ahead} 0 0.02" mass="4" diaginertia="0.015 0.02 0.03"/>
      {wheels}{caster}
    </body>
  </worldbody>
  <actuator>{servos}</actuator>
</mujoco>
"""
_WHEEL = """
      <body pos="{x} {y} 0">
        <joint name="{name}" type="hinge" axis="0 1 0" armature="0.0005" damping="0.0005"/>
        <geom type="ellipsoid" size="{radius} 0.01 {radius}" mass="0.2" friction="1 0.005 0.0001" solref="0.004 1"/>
      </body>"""
_CASTER = '<geom type="sphere" size="{size}" pos="0.1 0 {z}" mass="0.05" friction="0.01 0 0" priority="1"/>'


@dataclass(frozen=True)
class Truth:
    """What is hidden: a left wheel that is larger, a drive that turns all wheels faster than told, motion capture that
    reports late, four tyres in the place of two wheels and a caster, and the torque of a servo over its error of
    speed."""

    left_share: float = 0.0
    gain_share: float = 0.0
    late_s: float = 0.0
    four: bool = False
    servo_n_m_s: float = 2.0


def drive(seed: int, seconds: float, truth: Truth) -> Recording:
    """A run: two seconds at rest, then speeds and turning rates that change every few seconds.

    seed: of the command and of all noise.
    """
    random = np.random.default_rng([seed, 5])
    n = round(seconds / _STEP_S)
    t = _STEP_S * np.arange(n)
    logged = round(1.0 / _ENCODER_HZ / _STEP_S)
    ramp, held = np.full(round(_RAMP_S / _STEP_S), _STEP_S / _RAMP_S), np.arange(n) // logged * logged
    v, w = (
        np.convolve(ramp, wandering(random, t, *span, 1.0 / _ENCODER_HZ))[held] for span in ((0.1, 0.5), (-1.0, 1.0))
    )
    sent = np.column_stack([v + HALF_TRACK_M * w, v - HALF_TRACK_M * w]) / RADIUS_M * (1.0 + truth.gain_share)
    angles, poses = _moved(sent, truth)
    stamps = np.arange(0.213, seconds - _STEP_S, 1.0 / _CAMERA_HZ)
    seen = np.column_stack([np.interp(stamps - truth.late_s, t, column) for column in poses.T])
    seen += random.standard_normal(seen.shape) * FIX_RMS
    seen[:, 2] = np.mod(seen[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    read, count = np.arange(0, n, logged), 2.0 * np.pi / COUNTS
    counted = count * np.floor(angles[read] / count + random.uniform(0.0, 1.0, 2))
    command = np.column_stack([v, np.zeros(n), w])[read]
    return Recording("mine", "velocity_base", {
        "command": Channel(t[read], ("vx", "vy", "wz"), command, {}, 1.0 / _ENCODER_HZ),
        "encoder": Channel(t[read], ("theta_1", "theta_2"), counted, {}, 1.0 / _ENCODER_HZ),
        "kinect": Channel(np.round(stamps, 6), ("x", "y", "phi"), seen, {}, None),
    }, f"MuJoCo, seed {seed}")


def _moved(sent, truth):
    """(n, 2) angles of the front wheels, right and left, and (n, 3) poses, under the wheel speeds `sent` (n, 2)."""
    model = _model(truth)
    data, axles = mujoco.MjData(model), model.nu // 2
    mujoco.mj_forward(model, data)
    angles, poses = np.empty((len(sent), 2)), np.empty((len(sent), 3))
    for k, speeds in enumerate(sent):
        w, x, y, z = data.qpos[3:7]
        angles[k] = data.qpos[7:9]
        poses[k] = *data.qpos[:2], np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        data.ctrl[:] = np.tile(speeds, axles)
        mujoco.mj_step(model, data)
    poses[:, 2] = np.unwrap(poses[:, 2])
    return angles, poses


def _model(truth):
    axles = (0.5 * _WHEELBASE_M, -0.5 * _WHEELBASE_M) if truth.four else (0.0,)
    radii = {-HALF_TRACK_M: RADIUS_M, HALF_TRACK_M: RADIUS_M * (1.0 + truth.left_share)}
    wheels = [(f"w{i}{j}", x, y, radius) for i, x in enumerate(axles) for j, (y, radius) in enumerate(radii.items())]
    return mujoco.MjModel.from_xml_string(_MODEL.format(
        step=_STEP_S, radius=RADIUS_M, heading=_START_RAD, ahead=0.0 if truth.four else 0.02,
        wheels="".join(_WHEEL.format(name=name, x=x, y=y, radius=radius) for name, x, y, radius in wheels),
        caster="" if truth.four else _CASTER.format(size=_CASTER_M, z=_CASTER_M - RADIUS_M),
        servos="".join(f'<velocity joint="{name}" kv="{truth.servo_n_m_s}"/>' for name, *_ in wheels),
    ))
