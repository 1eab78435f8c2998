"""A robot of one's own in one file outside of the package: a differential drive whose wheels are turned by torque."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import WAY_POINT, WHEEL_PAIR
from drake_ispace.blocks.noise import stream
from drake_ispace.control.feedback.velocity_command import VelocityCommand, VelocityControl
from drake_ispace.control.guide.paths import Trajectory
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.actuator import Actuator
from drake_ispace.plants.friction import Friction, friction_parameters, friction_torque
from drake_ispace.plants.slip import Slip, pose_rates, slip_parameters
from drake_ispace.plants.tick_memory import deflection, remember, slip_noise, tick_memory
from drake_ispace.plants.wheels import differential, rescaled
from drake_ispace.robots.robot import Number, Robot
from drake_ispace.sensing.encoder import Encoder
from drake_ispace.wiring.body import add_body, add_estimator
from drake_ispace.wiring.entry import Entry
from drake_ispace.wiring.room import add_room

X, Y, PHI, SPEED, TURN, THETA = range(6)  # continuous state; THETA: right and left wheel


@dataclass
class CartParameters:
    mass_kg: float = quantity(4.0, "kg", above=0.0)
    inertia_kg_m2: float = quantity(0.08, "kg*m^2", above=0.0)
    radius_m: float = quantity(0.05, "m", above=0.0)
    half_track_m: float = quantity(0.15, "m", above=0.0)
    wheel_radius_shares: list[float] = quantity([0.0, 0.0], above=-0.9, length=2)
    friction: Friction = field(default_factory=Friction)
    slip: Slip = field(default_factory=Slip)

    @property
    def geometry(self):
        return rescaled(differential(self.radius_m, self.half_track_m), self.wheel_radius_shares)


@kernel
def derivatives(xc, xd, torque, ground_force, mass_kg, inertia_kg_m2, wheels, friction, slip, out):
    """m v' = tau_r / r + tau_l / r + F_x, I w' = b (tau_r / r - tau_l / r) + M; wheels: G (2, 3), row by row."""
    force, moment = ground_force[0], ground_force[2]
    for i in range(2):
        rate = wheels[3 * i] * xc[SPEED] + wheels[3 * i + 2] * xc[TURN]
        net = torque[i] - friction_torque(rate, deflection(xc[THETA + i], xd, i), friction)
        force, moment = force + wheels[3 * i] * net, moment + wheels[3 * i + 2] * net
        out[THETA + i] = rate
    out[SPEED], out[TURN] = force / mass_kg, moment / inertia_kg_m2
    noise = (slip_noise(xd, 0), slip_noise(xd, 1), slip_noise(xd, 2))
    pose_rates(xc[SPEED], 0.0, xc[TURN], (xc[X], xc[Y], xc[PHI]), (0.0, 0.0, 0.0), noise, slip, out)


@kernel
def tick_update(tick, xc, xd, noise_stream, friction, slip, out):
    remember(tick, xc[THETA:], xd, noise_stream, friction, slip, out)


@kernel
def pose(xc, out):
    copy(xc[:SPEED], out)


@kernel
def velocity(xc, out):
    out[0], out[1], out[2] = xc[SPEED] * np.cos(xc[PHI]), xc[SPEED] * np.sin(xc[PHI]), xc[TURN]


@kernel
def wheel_angle(xc, out):
    copy(xc[THETA:], out)


@kernel
def wheel_rate(xc, wheels, out):
    for i in range(2):
        out[i] = wheels[3 * i] * xc[SPEED] + wheels[3 * i + 2] * xc[TURN]


@kernel
def driven(velocity, encoder, wheels, gain_n_m_s, out):
    """Torque in proportion to the error of each wheel's speed."""
    for i in range(2):
        wanted = wheels[3 * i] * velocity[0] + wheels[3 * i + 2] * velocity[2]
        out[i] = gain_n_m_s * (wanted - encoder[WHEEL_PAIR.omega_r + i])


@dataclass
class CartSettings:
    plant: CartParameters = field(default_factory=CartParameters)
    actuator: Actuator = field(default_factory=Actuator)
    encoder: Encoder = field(default_factory=lambda: Encoder(counts_per_turn=4000))
    control: VelocityControl = field(default_factory=VelocityControl)
    trajectory: Trajectory = field(default_factory=lambda: Trajectory(heading="tangent"))
    initial_pose: list[float] | None = quantity(None, "m, m, rad", length=3)
    effects: dict = quantity({})


def cart_multirate(scenario, bench):
    """A differential drive: pose estimated every 5 ms, corrected every 95 ms, each wheel held at its speed."""
    settings, wheels = scenario.cart, scenario.cart.plant.geometry.inverse.ravel()
    part, _ = add_body(bench, scenario, Cart(), len(WAY_POINT))
    add_estimator(part, scenario, len(WAY_POINT))
    part.add("command", VelocityCommand(settings.control, holds_sideways=True))
    part.add("controller", Block(Spec(
        inputs={"velocity": 3, "encoder": len(WHEEL_PAIR)}, outputs={"torque": Output(2, driven)},
        parameters={"wheels": wheels, "gain_n_m_s": 0.1})))
    part.wire(
        ("way_point.way_point", "link.order"), ("link.order", "command.way_point"),
        ("estimator.pose", "command.estimate"), ("command.velocity", "controller.velocity"),
        ("encoder.message", "controller.encoder"), ("controller.torque", "actuator.command"),
        ("actuator.torque", "plant.torque"))
    add_room(bench, scenario, [part])


class Cart(Robot):
    name, settings, diagram = "cart", CartSettings, "cart_multirate"
    diagrams = (Entry(cart_multirate, ["cart"], has_feedback=True),)
    wheel_names, first_wheel = ("right", "left"), THETA
    numbers: ClassVar = {
        "mass": Number(("mass_kg",), (0.05, 0.3), 0.005), "inertia": Number(("inertia_kg_m2",), (0.1, 0.5), 0.01),
        "radius": Number(("radius_m",), (0.01, 0.05), 1e-3), "track": Number(("half_track_m",), (0.01, 0.05), 1e-3),
    }
    has_traction_slip = False
    unknown_forces = (0.1, 0.1, 0.01)

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        return Block(Spec(
            inputs={"torque": 2} | ({"ground_force": 3} if ground else {}),
            outputs={"pose": Output(3, pose), "velocity": Output(3, velocity),
                     "wheel_angle": Output(2, wheel_angle), "wheel_rate": Output(2, wheel_rate)},
            parameters=self.block_parameters(plant) | {"noise_stream": stream(seed, "cart.plant/slip")}
            | ({} if ground else {"ground_force": np.zeros(3)}),
            continuous_state=[*start, 0.0, 0.0, 0.0, 0.0], derivatives=derivatives, noise_stream="cart.plant/slip",
            **tick_memory(plant.slip, plant.friction, tick_update, 2),
        ))

    def block_parameters(self, plant):
        return {
            "mass_kg": plant.mass_kg, "inertia_kg_m2": plant.inertia_kg_m2, "wheels": plant.geometry.inverse.ravel(),
            "friction": friction_parameters(plant.friction, self.mobility(plant), "cart.plant.friction"),
            "slip": slip_parameters(plant.slip, plant.half_track_m, "cart.plant.slip"),
        }

    def mass_matrix(self, plant):
        return np.diag([plant.mass_kg, plant.mass_kg, plant.inertia_kg_m2])
