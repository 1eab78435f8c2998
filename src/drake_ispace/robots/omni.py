"""The four-wheeled omni-directional robot of Fig. 2.2."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from drake_ispace.control.feedback.friction_compensator import FrictionCompensation
from drake_ispace.control.feedback.omni_gains import OmniControl
from drake_ispace.control.guide.paths import Trajectory
from drake_ispace.files.quantity import quantity
from drake_ispace.plants import omni
from drake_ispace.plants.actuator import Actuator
from drake_ispace.robots.robot import Coordinate, Number, Robot
from drake_ispace.sensing.encoder import Encoder


@dataclass
class OmniSettings:
    """The omni robot's section of a scenario."""

    plant: omni.OmniPlantParameters = field(default_factory=omni.OmniPlantParameters)
    actuator: Actuator = field(default_factory=Actuator)
    encoder: Encoder = field(default_factory=Encoder)
    control: OmniControl = field(default_factory=OmniControl)
    # neutral, because the omni robot's plant has no friction by default
    friction_compensation: FrictionCompensation = field(default_factory=lambda: FrictionCompensation(enabled=False))
    trajectory: Trajectory = field(default_factory=Trajectory)
    # x, y, phi at t = 0; null: where the path starts
    initial_pose: list[float] | None = quantity(None, "m, m, rad", length=3)
    # physical effects beyond the model that the controller was designed with, docs/effects.md: name -> its parameters
    effects: dict = quantity({})


class Omni(Robot):
    """Four omni wheels, a torque on each; no IMU."""

    name = "omni"
    settings = OmniSettings
    diagram = "omni_multirate"
    wheel_names = ("1", "2", "3", "4")
    first_wheel = omni.THETA
    numbers: ClassVar = {
        "mass": Number(("mass_kg",), (0.05, 0.3), 0.005),
        "inertia": Number(("inertia_kg_m2",), (0.1, 0.5), 0.01),
        "radius": Number(("wheel_radius_m",), (0.01, 0.05), 1e-3),
        "track": Number(("wheel_distance_m",), (0.01, 0.05), 1e-3),
    }
    has_drive_inertia = True
    has_centre_of_gravity = True
    has_toe = True
    unknown_forces = (0.15, 0.15, 0.02)

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        return omni.OmniPlant(plant, start, seed, f"{self.name}.plant", ground)

    def drive_inertia(self, plant):
        return plant.wheel_inertia_kg_m2, plant.mass_kg * plant.wheel_radius_m**2 / len(plant.geometry.wheels)

    def geared(self, plant, inertia_kg_m2):
        return replace(plant, wheel_inertia_kg_m2=plant.wheel_inertia_kg_m2 + inertia_kg_m2)

    def centre_of_gravity(self, plant):
        return tuple(Coordinate(f"{axis}_m", -0.15, 0.15, (0.005, 0.03), 5e-4) for axis in "xy")

    def off_centre(self, plant, by: Mapping[str, float]):
        x, y = plant.centre_of_gravity_m
        return replace(plant, centre_of_gravity_m=[x + by["x_m"], y + by["y_m"]])

    def weight(self, plant):
        return {"mass_kg": plant.mass_kg, "centre_of_gravity_m": np.array(plant.centre_of_gravity_m)}

    def block_parameters(self, plant):
        return omni.block_parameters(plant, f"{self.name}.plant")

    def mass_matrix(self, plant):
        return omni.mass_matrix(plant)
