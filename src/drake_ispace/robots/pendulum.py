"""The two-wheeled inverted pendulum of Fig. 2.1."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.messages import TRACKING_ERROR
from drake_ispace.control.adaptive.adaptive_compensator import Adaptation
from drake_ispace.control.adaptive.online_identifier import Identifier
from drake_ispace.control.adaptive.servo import Servo
from drake_ispace.control.estimate.odometry import PendulumOdometry
from drake_ispace.control.feedback.balance_gains import PendulumControl
from drake_ispace.control.guide.paths import Trajectory
from drake_ispace.files.quantity import quantity
from drake_ispace.plants import pendulum
from drake_ispace.plants.actuator import Actuator
from drake_ispace.plants.impulse import Impulse
from drake_ispace.plants.linear_pendulum import LinearPendulumPlant
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.robot import BALANCING, Coordinate, ErrorSystem, Number, Robot, Truth
from drake_ispace.sensing.encoder import Encoder
from drake_ispace.sensing.imu import Imu
from drake_ispace.sensing.sinusoid_noise import SinusoidNoise
from drake_ispace.sensing.tilt_filter import TiltFilter

AS_PRINTED = "linear_as_printed"


@dataclass
class PendulumSettings:
    """The pendulum's section of a scenario."""

    # nonlinear: (2.48) as corrected; linear_as_printed: (3.41)-(3.42)
    model: str = quantity("nonlinear", choices=("nonlinear", AS_PRINTED))
    plant: pendulum.PendulumPlantParameters = field(default_factory=pendulum.PendulumPlantParameters)
    actuator: Actuator = field(default_factory=Actuator)
    # resolution assumed: the thesis does not give it
    encoder: Encoder = field(default_factory=lambda: Encoder(counts_per_turn=2000))
    imu: Imu = field(default_factory=Imu)
    tilt_filter: TiltFilter = field(default_factory=TiltFilter)
    control: PendulumControl = field(default_factory=PendulumControl)
    trajectory: Trajectory = field(default_factory=lambda: Trajectory(heading="tangent"))
    # x, y, phi at t = 0; null: where the path starts, along it
    initial_pose: list[float] | None = quantity(None, "m, m, rad", length=3)
    initial_tilt_rad: float = quantity(0.0, "rad", minimum=-1.0, maximum=1.0)
    # physical effects beyond the model that the controller was designed with, docs/effects.md: name -> its parameters
    effects: dict = quantity({})
    # of the Diagram pendulum_servo only
    servo: Servo = field(default_factory=Servo)
    sensor_noise: SinusoidNoise = field(default_factory=SinusoidNoise)
    # of the Diagram pendulum_friction_compensation only
    impulse: Impulse = field(default_factory=Impulse)
    adaptation: Adaptation = field(default_factory=Adaptation)
    identifier: Identifier = field(default_factory=Identifier)


class Pendulum(Robot):
    """Two wheels, a torque on each, and a body that must be kept upright; an IMU on it."""

    name = "pendulum"
    settings = PendulumSettings
    diagram = "pendulum_multirate"
    wheel_names = ("r", "l")
    first_wheel = pendulum.THETA_R
    ground = BALANCING
    numbers: ClassVar = {
        "mass": Number(("body_mass_kg",), (0.05, 0.3), 0.005),
        "inertia": Number(("body_inertia_pitch_kg_m2",), (0.3, 1.5), 0.15),  # a tenth of m_b z^2, which hides it
        "yaw_inertia": Number(("body_inertia_yaw_kg_m2", "body_inertia_roll_kg_m2"), (0.1, 0.5), 0.06),
        "radius": Number(("wheel_radius_m",), (0.01, 0.05), 1e-3),
        "track": Number(("half_track_m",), (0.01, 0.05), 1e-3),
    }
    has_drive_inertia = True
    has_centre_of_gravity = True
    has_imu = True
    own_dynamics = True
    unknown_forces = (0.1, 0.01, 0.003)
    order_size = len(TRACKING_ERROR)
    truth = Truth("balance", ("tilt", "s_rate", "yaw_rate", "tilt_rate"), ("rad", "m/s", "rad/s", "rad/s"))
    colours = ("yellow", "green")
    marker_height_m = 0.30
    path_colour = "#f1c40f"

    def check(self, settings, where):
        super().check(settings, where)
        if settings.effects and settings.model == AS_PRINTED:
            raise InputError(f"{where}.effects: expected none with model {AS_PRINTED}")

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        tilt_rad, height_m = settings.initial_tilt_rad, settings.imu.height_m
        if settings.model == AS_PRINTED:
            return LinearPendulumPlant(plant, start, tilt_rad, height_m)
        return pendulum.PendulumPlant(plant, start, tilt_rad, height_m, seed, f"{self.name}.plant", ground)

    def odometry(self, settings, start):
        # the wheels of the linear plant turn with the body
        printed = settings.model == AS_PRINTED
        body_share = 1.0 if printed else float(pendulum.MOTIONS.index(settings.plant.motion))
        return PendulumOdometry(settings.plant.wheel_radius_m, settings.plant.half_track_m, start, body_share)

    def drive_inertia(self, plant):
        of_rotor = plant.gear_ratio**2 * plant.rotor_inertia_kg_m2 + plant.drive_inertia_kg_m2
        mass_kg = plant.body_mass_kg + 2.0 * plant.wheel_mass_kg
        return of_rotor, 0.5 * mass_kg * plant.wheel_radius_m**2

    def geared(self, plant, inertia_kg_m2):
        return replace(plant, drive_inertia_kg_m2=plant.drive_inertia_kg_m2 + inertia_kg_m2)

    def centre_of_gravity(self, plant):
        return (Coordinate("height_m", -0.8 * plant.centre_of_gravity_m, 0.3, (0.003, 0.02), 3e-4),)

    def off_centre(self, plant, by: Mapping[str, float]):
        return replace(plant, centre_of_gravity_m=plant.centre_of_gravity_m + by["height_m"])

    def on_slope(self, plant, slope_x_rad, slope_y_rad):
        return replace(plant, slope_rad=[slope_x_rad, slope_y_rad])

    def weight(self, plant):
        return {
            "mass_kg": plant.body_mass_kg + 2.0 * plant.wheel_mass_kg,
            "lifted_kg_m": plant.body_mass_kg * plant.centre_of_gravity_m,
        }

    def block_parameters(self, plant):
        return pendulum.block_parameters(plant, f"{self.name}.plant")

    def mass_matrix(self, plant):
        return pendulum.linear_terms(plant)[0]

    def effort(self, plant):
        return pendulum.linear_terms(plant)[2]

    @property
    def unweighted(self):
        return [0, 1]

    def rates(self, plant, wheel_rates, lean_rate):
        moved = wheel_rates @ plant.geometry.forward.T
        return np.column_stack([moved[:, 0] + plant.wheel_radius_m * lean_rate, moved[:, 2], lean_rate])

    def turning(self, rates):
        return np.zeros_like(rates)

    def lean_arm(self, settings):
        return settings.plant.wheel_radius_m + settings.imu.height_m

    def error_system(self, plant, imu_height_m=0.0):
        """x = [s, phi, theta and their rates]; e: both wheels, then the IMU's six."""
        a, _ = pendulum.linear_model(plant)
        r, half, kappa = plant.wheel_radius_m, plant.half_track_m, plant.inertias()["kappa"]
        c, d = np.zeros((8, 6)), np.zeros((8, 3))
        c[0, :3], c[1, :3] = (1 / r, half / r, -kappa), (1 / r, -half / r, -kappa)
        c[2] = a[3] + imu_height_m * a[5]
        c[2, 2] -= GRAVITY
        d[2] = -1.0, 0.0, -imu_height_m
        c[6, 5], c[7, 4] = 1.0, 1.0
        return ErrorSystem(a, np.vstack([np.zeros((3, 3)), np.eye(3)]), c, d)

    def followed_plant(self, settings, plant):
        return self.plant_block(replace(settings, model="nonlinear", initial_tilt_rad=0.0), plant, ground=True)

    def ground_force(self, force):
        """Nothing pushes it sideways, nor tilts it."""
        return force[:, [0, 2, 1]] * [1.0, 1.0, 0.0]
