"""Somebody else's robot, which takes a body-velocity command, as most bought ones do."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from drake_ispace.control.estimate.odometry import OmniOdometry
from drake_ispace.control.feedback.velocity_command import VelocityControl
from drake_ispace.control.guide.paths import Trajectory
from drake_ispace.files.quantity import quantity
from drake_ispace.plants import rover
from drake_ispace.robots.robot import COMMAND, ErrorSystem, Number, Robot
from drake_ispace.sensing.encoder import Encoder

#: Kind of wheels -> what each may be called besides its number.
_LABELS = {
    "differential": (("right", "r"), ("left", "l")),
    "mecanum": (("front_left", "fl"), ("front_right", "fr"), ("rear_left", "rl"), ("rear_right", "rr")),
}


@dataclass
class RoverSettings:
    """The rover's section of a scenario; of the Diagrams velocity_base and odometry_replay only."""

    plant: rover.RoverPlantParameters = field(default_factory=rover.RoverPlantParameters)
    # resolution assumed
    encoder: Encoder = field(default_factory=lambda: Encoder(counts_per_turn=2000))
    control: VelocityControl = field(default_factory=VelocityControl)
    trajectory: Trajectory = field(default_factory=Trajectory)
    # x, y, phi at t = 0; null: where the path starts
    initial_pose: list[float] | None = quantity(None, "m, m, rad", length=3)
    # physical effects beyond the model that the controller was designed with, docs/effects.md: name -> its parameters
    effects: dict = quantity({})


class Rover(Robot):
    """A robot on any wheels that takes a velocity of its body as command; it answers to any name."""

    name = "rover"
    settings = RoverSettings
    diagram = "velocity_base"
    driven = COMMAND
    first_wheel = rover.THETA
    ground = None
    numbers: ClassVar = {"radius": Number((), (0.01, 0.05), 1e-3), "track": Number((), (0.01, 0.05), 1e-3)}
    has_traction_slip = False
    has_toe = True
    unknown_forces = (0.5, 0.5, 1.0)
    markers_may_turn = True

    def answers_to(self, name):
        return True

    def wheel_labels(self, plant):
        count = len(plant.geometry.wheels)
        if plant.wheels == "listed" and plant.wheel_names:
            return [(name, str(i + 1)) for i, name in enumerate(plant.wheel_names)]
        names = _LABELS.get(plant.wheels, ((),) * count)
        return [(*names[i], str(i + 1)) for i in range(count)]

    def check(self, settings, where):
        super().check(settings, where)
        rover.check(settings.plant, f"{where}.plant")

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        return rover.RoverPlant(plant, start, f"{self.name}.plant")

    def odometry(self, settings, start):
        return OmniOdometry(settings.plant.nominal_geometry, start)

    def called(self, plant, number):
        """A wheel with askew rollers turns as much by its distance ahead of the middle as by that aside."""
        askew = any(wheel.roller_rad for wheel in plant.geometry.wheels)
        return "of length and width together" if number == "track" and askew else ""

    def scaled(self, plant, number: str, share: float):
        """Its drive believes in the numbers of the scenario, so that errors stand beside them."""
        if number == "radius":
            return self.worn(plant, share, range(len(plant.geometry.wheels)))
        return replace(plant, track_share=plant.track_share + share * (1.0 + plant.track_share))

    def block_parameters(self, plant):
        return rover.block_parameters(plant, f"{self.name}.plant")

    def mass_matrix(self, plant):
        return np.eye(3)

    def error_system(self, plant, imu_height_m=0.0):
        """x = [pose, velocity by which it leaves its command] in B."""
        wheels = plant.geometry.inverse
        c = np.hstack([wheels, np.zeros((len(wheels), 3))])
        moves = np.eye(3)
        if len(plant.geometry.sideways):  # tyres hold it: it neither moves that way nor does anything show it
            moves = plant.geometry.forward @ wheels
        a = np.block([[-1e-3 * np.eye(3), moves], [np.zeros((3, 3)), -2.0 * np.eye(3)]])
        return ErrorSystem(a, np.vstack([moves, np.zeros((3, 3))]), c, np.zeros((len(wheels), 3)))
