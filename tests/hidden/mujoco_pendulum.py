"""The pendulum in MuJoCo, with its contacts and its dry friction, under the same controller, sensors and camera.

Nothing of the other generators' physics is in it: a free body, two wheels on hinges, soft contacts with a friction
cone, friction of the hinges as a constraint. Wheels therefore creep, and the floor gives way a little.
"""

import mujoco
import numpy as np

from hidden import pendulum_truth as truth
from hidden.control_truth import Camera, Encoder
from hidden.effects_truth import (
    GRAVITY,
    Effects,
    dry_friction,
    ground_force,
    motor_torque,
    rub,
    soft_sign,
    steady_torque,
)
from hidden.motions import TICK_S
from hidden.noise_truth import between

SUBSTEPS = 5
_HALF_WIDTH_M = 0.004  # of a wheel, that of an ellipsoid

_MODEL = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast" cone="elliptic" impratio="20" gravity="0 0 -9.80665"/>
  <worldbody>
    <geom type="plane" size="10 10 1" friction="0.9 0 0" solref="0.004 1"/>
    <body name="body" pos="0 0 {radius}">
      <freejoint/>
      <inertial pos="0 0 {z}" mass="{mass}" diaginertia="{roll} {pitch} {yaw}"/>
      <site name="imu" pos="{ahead} 0 {height}"/>
      <body pos="0 {right} 0">
        <joint name="r" type="hinge" axis="0 1 0" frictionloss="{coulomb}" damping="{viscous}"
          armature="{armature}"/>
        <inertial pos="0 0 0" mass="{wheel}" diaginertia="{wheel_yaw} {wheel_roll} {wheel_yaw}"/>
        <geom type="ellipsoid" size="{radius_r} {width} {radius_r}" friction="0.9 0 0" solref="0.004 1"/>
      </body>
      <body pos="0 {left} 0">
        <joint name="l" type="hinge" axis="0 1 0" frictionloss="{coulomb}" damping="{viscous}"
          armature="{armature}"/>
        <inertial pos="0 0 0" mass="{wheel}" diaginertia="{wheel_yaw} {wheel_roll} {wheel_yaw}"/>
        <geom type="ellipsoid" size="{radius_l} {width} {radius_l}" friction="0.9 0 0" solref="0.004 1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="r"/><motor joint="l"/></actuator>
  <sensor><accelerometer site="imu"/><gyro site="imu"/></sensor>
</mujoco>
"""


def model_of(plant, values: dict, imu_height_m: float, imu_ahead_m: float = 0.0) -> mujoco.MjModel:
    """The robot with the numbers of a scenario's `pendulum.plant` and the effects `values` on them, rotors in its body.
    """
    def more(name):
        return 1.0 + values[name]["share"]

    radii = np.full(2, plant.wheel_radius_m * more("wheel_radius_error"))
    radii[int(values["single_wheel_radius_error"]["wheel"]) - 1] *= more("single_wheel_radius_error")
    track = plant.half_track_m * more("track_error")
    return mujoco.MjModel.from_xml_string(_MODEL.format(
        step=TICK_S / SUBSTEPS, radius=radii.mean(), radius_r=radii[0], radius_l=radii[1],
        z=plant.centre_of_gravity_m + values["centre_of_gravity_offset"]["height_m"],
        mass=plant.body_mass_kg * more("mass_error"),
        roll=plant.body_inertia_roll_kg_m2 * more("yaw_inertia_error"),
        yaw=plant.body_inertia_yaw_kg_m2 * more("yaw_inertia_error") + 2.0 * plant.rotor_inertia_yaw_kg_m2,
        pitch=plant.body_inertia_pitch_kg_m2 * more("inertia_error") + 2.0 * plant.rotor_inertia_kg_m2, right=-track,
        left=track, wheel=plant.wheel_mass_kg, wheel_roll=plant.wheel_inertia_kg_m2,
        wheel_yaw=plant.wheel_inertia_yaw_kg_m2, armature=values["drive_inertia"]["inertia_kg_m2"],
        coulomb=plant.friction.coulomb_n_m, viscous=plant.friction.viscous_n_m_s, width=_HALF_WIDTH_M,
        height=imu_height_m, ahead=imu_ahead_m,
    ))


def run(
    ticks: int, start, way_points, push, model: mujoco.MjModel, law: truth.Law, encoder: Encoder, imu: truth.Imu,
    camera: Camera, e: Effects,
):
    """As pendulum_truth.run, without random slip: the contacts have their own."""
    model.opt.gravity[:2], e = -GRAVITY * e.slope, e._replace(slope=np.zeros(2))
    data = mujoco.MjData(model)
    c, s = np.cos(0.5 * start[2]), np.sin(0.5 * start[2])
    data.qpos[:2], data.qpos[3:7] = start[:2], (c, 0.0, 0.0, s)
    loop, z = truth.fresh(ticks, law, encoder), np.zeros(truth.SIZE)
    torque, force, mass = np.zeros(2), np.zeros(3), float(np.sum(model.body_mass))
    wheels, own_friction = data.qpos[7:9].copy(), model.dof_frictionloss[6:8].copy()
    for tick in range(ticks + 1):
        mujoco.mj_forward(model, data)  # sensors of this instant, not of the step before
        _state(data, z)
        truth.as_read(tick, data.sensordata[:3].copy(), data.sensordata[3:6].copy(), imu, loop.felt)
        shown = data.qpos[7:9] - wheels + loop.gap
        if not truth.sense_and_command(tick, z, shown, loop, way_points, law, encoder, camera, e):
            break
        for step in range(SUBSTEPS):
            share = (step + 0.5) / SUBSTEPS
            time_s = (tick + share) * TICK_S
            motor_torque(loop.held, time_s, TICK_S / SUBSTEPS, TICK_S, e, loop.lagged, loop.gap, torque)
            rub(data.qpos[7:9] - wheels, loop.turned, loop.bent, e, torque)
            between(push, tick, share, force)
            _state(data, z)
            _push(data, z, force, mass, e)
            for i in range(2):
                rate, angle = data.qvel[6 + i], data.qpos[7 + i] - wheels[i]
                dry = dry_friction(i, torque[i], rate, angle, time_s, e)
                data.ctrl[i] = torque[i] + steady_torque(i, rate, angle, e)
                model.dof_frictionloss[6 + i] = own_friction[i] + max(dry, 0.0)
            mujoco.mj_step(model, data)
    return loop.commanded, loop.angles, loop.felt, loop.fixes[: int(loop.numbers[0])], loop.truth


def _state(data, z):
    """Pose, tilt, forward speed, turning rate and tilt rate of the axle's middle, into z[:7]."""
    axes = data.xmat[1].reshape(3, 3)
    phi = np.arctan2(axes[1, 0], axes[0, 0]) if abs(axes[2, 0]) < 0.99 else z[truth.PHI]
    tilt = np.arctan2(-axes[2, 0], axes[2, 2])
    turn = axes @ data.qvel[3:6]
    ahead = np.array([np.cos(phi), np.sin(phi)])
    past = z[truth.PHI]
    phi = past + (phi - past + np.pi) % (2.0 * np.pi) - np.pi
    z[:7] = (*data.qpos[:2], phi, tilt, ahead @ data.qvel[:2], turn[2], turn[1] * ahead[0] - turn[0] * ahead[1])


def _push(data, z, force, mass, e):
    """Outer force along the robot, yaw moment and pitch moment, and what the floor adds."""
    c, s = np.cos(z[truth.PHI]), np.sin(z[truth.PHI])
    speed = z[truth.V]
    gx, gy = ground_force(z[truth.X], z[truth.Y], c * speed, s * speed, mass, e)
    forward = force[0] + c * gx + s * gy
    data.qfrc_applied[0], data.qfrc_applied[1] = c * forward, s * forward
    axes, yaw = data.xmat[1].reshape(3, 3), force[1] - e.scrub_n_m * soft_sign(z[truth.TURN], 0.02)
    data.qfrc_applied[3:6] = axes.T @ np.array([-s * force[2], c * force[2], yaw])
