"""The interface of a robot: all that the rest of the package may ask about it.

A robot is one object. Scenarios, Diagrams, effects, recordings, pictures and `explain` ask it for its plant, its wires
and its numbers, and nobody asks which robot it is. A robot of a user's own is a subclass, registered as an entry point
of the group `drake_ispace.robots`.
"""

import abc
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.control.estimate.odometry import OmniOdometry
from drake_ispace.files.recording import Channel
from drake_ispace.plants.friction import Friction, dry_slope, friction_parameters, stable_slope

TORQUE, COMMAND = "torque", "command"
_DAMPING_PER_S = 1e-3  # of a direction that tyres hold, which nothing shows: a filter needs it to be stable


@dataclass(frozen=True)
class Number:
    """A number of a plant that may be wrong by a share of it.

    Attributes:
        fields: of the plant's dataclass, scaled together. probes: shares at which a search begins.
        tolerance: share by which a sound robot may be off, a standard deviation.
    """

    fields: tuple[str, ...]
    probes: tuple[float, ...]
    tolerance: float


@dataclass(frozen=True)
class Coordinate:
    """A coordinate of the centre of gravity: its name, what is possible, probes and tolerance [m] as of a Number."""

    name: str
    low: float
    high: float
    probes: tuple[float, ...]
    tolerance: float


@dataclass(frozen=True)
class Truth:
    """The truth that a simulated run holds besides the pose: an output of the Diagram, its columns and their units."""

    signal: str
    columns: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class GroundForce:
    """The coordinates of the plant's input `ground_force`. turn: which of them is the moment about the vertical."""

    turn: int
    units: tuple[str, str, str]


#: F_x, F_y [N] along the axes of the body, M [N m].
PLANAR = GroundForce(turn=2, units=("N", "N", "N m"))
#: Generalised forces of s [N], phi and theta [N m].
BALANCING = GroundForce(turn=1, units=("N", "N m", "N m"))


@dataclass(frozen=True)
class ErrorSystem:
    """Small differences between a robot and its model: dx/dt = a dx - b u + w, e = c dx + d u.

    a (n, n), b (n, 3), c (p, n), d (p, 3). u: accelerations of the body, or its velocity where that is commanded.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray


class Robot(abc.ABC):
    """A robot, as far as nothing else is said one that wheels drive over the floor by torque.

    `plant` is the dataclass of the plant's parameters, with wheels (`geometry`), `slip` and `friction`; `settings` the
    robot's section of a scenario.

    Attributes:
        name: of its section in a scenario, in recordings, and in front of its blocks and signals.
        settings: the dataclass of that section: plant, encoder, trajectory, initial_pose, effects; `actuator` where
            torque drives it, `imu` and `tilt_filter` where it has an IMU.
        diagram: of the catalog, that shows it. diagrams: entries that it adds to the catalog (wiring.entry).
        driven: the channel that moves it, "torque" (a torque per wheel) or "command" (vx, vy, wz in B).
        wheel_names: ends of the columns of its wheels; None: 1 to n.
        first_wheel: place of the first wheel's angle in the plant's continuous state, which begins with x, y, phi.
        ground: coordinates of the forces from the floor; None: the plant takes none.
        numbers: of the plant that may be wrong, among "mass", "inertia", "yaw_inertia", "radius" and "track".
        has_drive_inertia: whether its plant knows the inertia of what turns with its wheels.
        has_traction_slip: whether its plant knows slip under traction. has_centre_of_gravity: whether its plant knows
            where its centre of gravity lies. has_toe: whether its plant knows the angle by which each wheel is turned.
        has_imu: whether there is one, and a filter of the tilt.
        own_dynamics: whether errors grow or swing by themselves, as fast as the plant's numbers say.
        unknown_forces: root mean square, assumed, of what pushes it along the coordinates of `ground`; where velocity
            is commanded, of the accelerations by which it leaves its command [m/s^2, m/s^2, rad/s^2].
        unknown_slip: random walk of place and heading, assumed, as wheels slip [m/m^(1/2), rad/m^(1/2)].
        most_unknown, most_slip: how many times unknown_forces and unknown_slip a sound robot may have at most.
        order_size: of the message that the room sends to it besides the fix.
        truth: what a simulated run knows besides the pose.
        markers_may_turn: whether a camera's markers may be mounted at any angle.
        colours: front and rear marker. marker_height_m: above the floor. path_colour: in pictures.
        in_room: whether a camera may see it. in_si: whether its torques and angles are in N m and rad.
    """

    name: str
    settings: type
    diagram: str
    diagrams: Sequence = ()
    driven = TORQUE
    wheel_names: tuple[str, ...] | None = None
    first_wheel: int
    ground: GroundForce | None = PLANAR
    numbers: ClassVar[Mapping[str, Number]] = {}
    has_drive_inertia = False
    has_traction_slip = True
    has_centre_of_gravity = False
    has_toe = False
    has_imu = False
    own_dynamics = False
    unknown_forces: tuple[float, float, float] | None = None
    unknown_slip = (1e-3, 3e-3)
    most_unknown = 3.5
    most_slip = 10.0
    order_size = len(WAY_POINT)
    truth = Truth("velocity", ("vx_w", "vy_w", "wz_w"), ("m/s", "m/s", "rad/s"))
    markers_may_turn = False
    colours = ("red", "blue")
    marker_height_m = 0.15
    path_colour = "#c0392b"
    in_room = True
    in_si = True

    def __repr__(self):
        return f"<robot {self.name}>"

    def answers_to(self, name: str) -> bool:
        """Whether a recording of the robot `name` may be one of this."""
        return name == self.name

    # ---- settings ----

    def check(self, settings, where: str) -> None:
        """Raise InputError for values of which each alone is allowed; `where` names the section."""
        patch = settings.plant.slip.patch_m
        if patch is not None and not (patch[0] < patch[1] and patch[2] < patch[3]):
            raise InputError(f"{where}.plant.slip.patch_m: expected x_min < x_max and y_min < y_max, got {patch}")

    # ---- wiring ----

    @property
    def wires(self) -> frozenset[str]:
        """The wires of its Diagrams that take an effect's block."""
        if self.driven == COMMAND:
            return frozenset({"velocity", "wheel_angle", "pose", "fix"})
        wires = {TORQUE, "wheel_angle"}
        if self.ground:
            wires.add("ground_force")
        if self.has_imu:
            wires.add("body_motion")
        if self.in_room:
            wires |= {"pose", "fix"}
        return frozenset(wires)

    @property
    def offers(self) -> frozenset[str]:
        """Names of all that an effect may need: wires, numbers, "slip", "traction", "centre_of_gravity", "toe",
        "drive_inertia"."""
        more = set()
        if self.in_room:
            more |= {"slip", "traction"} if self.has_traction_slip else {"slip"}
        if self.has_centre_of_gravity:
            more.add("centre_of_gravity")
        if self.has_drive_inertia:
            more.add("drive_inertia")
        if self.has_toe:
            more.add("toe")
        return self.wires | self.numbers.keys() | more

    @abc.abstractmethod
    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed: int = 0, ground: bool = False) -> Block:
        """The plant at the pose `start`, with the parameters `plant`, which effects may have changed.

        ground: with the input port `ground_force`.
        """

    def odometry(self, settings, start) -> Block:
        """From encoders to a pose; input `encoder`, and `tilt` where there is an IMU; output `pose`."""
        return OmniOdometry(settings.plant.geometry, start)

    def wheel_count(self, plant) -> int:
        """How many wheels the plant has."""
        return len(plant.geometry.wheels)

    def wheel_labels(self, plant) -> list[tuple[str, ...]]:
        """What the columns of each wheel may be called, in the order of the plant's wheels; its number among it."""
        names = self.wheel_names or ()
        return [(*names[i : i + 1], str(i + 1)) for i in range(self.wheel_count(plant))]

    def by_wheel(self, channel: Channel, plant, where: str) -> Channel:
        """A channel whose columns end in the names of wheels, in the order of the plant's wheels.

        Raises:
            InputError: a column of no wheel, or a wheel without a column.
        """
        ends = [column.partition("_")[2] for column in channel.columns]
        labels = self.wheel_labels(plant)
        where = f"{where} ({channel.file})" if channel.file else where
        wanted = ", ".join(" or ".join(names) for names in labels)
        if len(ends) != len(labels):
            expected = f"{len(labels)}: one each of {wanted}, got {', '.join(channel.columns)}"
            raise InputError(f"{where} has {len(ends)} columns, expected {expected}")
        order = []
        for known in labels:
            found = [i for i, end in enumerate(ends) if end in known]
            if len(found) != 1:
                raise InputError(f"{where} has the columns {', '.join(channel.columns)}, expected one each of {wanted}")
            order += found
        if order == sorted(order):
            return channel
        return replace(channel, columns=tuple(channel.columns[i] for i in order), values=channel.values[:, order])

    # ---- numbers that effects change ----

    def called(self, plant, number: str) -> str:
        """What one of `numbers` is of these wheels, where its own name does not say so; else empty."""
        return ""

    def scaled(self, plant, number: str, share: float):
        """A copy of `plant` with one of `numbers` times (1 + share)."""
        fields = self.numbers[number].fields
        return replace(plant, **{name: getattr(plant, name) * (1.0 + share) for name in fields})

    def worn(self, plant, share: float, wheels: Sequence[int]):
        """A copy of `plant` with the radii of `wheels`, counted from 0, times (1 + share), unknown to its odometry."""
        shares = list(plant.wheel_radius_shares or [0.0] * self.wheel_count(plant))
        for i in wheels:
            shares[i] = shares[i] + share * (1.0 + shares[i])
        return replace(plant, wheel_radius_shares=shares)

    def toed(self, plant, angle_rad: float, wheel: int):
        """A copy of `plant` with one wheel, counted from 0, turned anticlockwise, unknown to its odometry."""
        angles = list(plant.wheel_toe_rad or [0.0] * self.wheel_count(plant))
        angles[wheel] += angle_rad
        return replace(plant, wheel_toe_rad=angles)

    def drive_inertia(self, plant) -> tuple[float, float]:
        """Inertia of gears and rotor, and that of the robot's mass, at each wheel [kg m^2]; at most the first may be
        taken away."""
        return 0.0, 0.0

    def geared(self, plant, inertia_kg_m2: float):
        """A copy of `plant` with so much more inertia of gears and rotor at each wheel."""
        return plant

    def centre_of_gravity(self, plant) -> tuple[Coordinate, ...]:
        """Coordinates of the centre of gravity that may be off; none without `has_centre_of_gravity`."""
        return ()

    def off_centre(self, plant, by: Mapping[str, float]):
        """A copy of `plant` with its centre of gravity moved by these coordinates [m]."""
        return plant

    def on_slope(self, plant, slope_x_rad: float, slope_y_rad: float):
        """A copy of `plant` whose sensors feel the slope of the floor: `plant` itself where there is no IMU."""
        return plant

    def weight(self, plant) -> dict[str, Any]:
        """The weight on a sloping floor: the parameters of a block of the wire `ground_force` on a sloping floor."""
        return {"mass_kg": plant.mass_kg, "centre_of_gravity_m": np.zeros(2)}

    # ---- dynamics ----

    @abc.abstractmethod
    def block_parameters(self, plant) -> dict:
        """The parameters of the plant's block that follow from `plant`.

        Raises:
            InputError: values that the plant refuses.
        """

    @abc.abstractmethod
    def mass_matrix(self, plant) -> np.ndarray:
        """(3, 3) forces along `ground` per acceleration; the unit matrix where velocity is commanded."""

    def effort(self, plant) -> np.ndarray:
        """(3, n) force along `ground` per torque of a wheel."""
        return plant.geometry.inverse.T

    def mobility(self, plant) -> np.ndarray:
        """(n, n) wheel acceleration [rad/s^2] per wheel torque [N m]."""
        effort = self.effort(plant)
        return effort.T @ np.linalg.solve(self.mass_matrix(plant), effort)

    @property
    def unweighted(self) -> list[int]:
        """The coordinates of `ground` along which its own weight does not push it."""
        return [0, 1, 2]

    def rates(self, plant, wheel_rates: np.ndarray, lean_rate: np.ndarray | None) -> np.ndarray:
        """(n, 3) velocities along `ground`, from those of the wheels (n, wheels) and of the lean (n,) [rad/s]."""
        return wheel_rates @ plant.geometry.forward.T

    def turning(self, rates: np.ndarray) -> np.ndarray:
        """(n, 3) what accelerations along `ground` have more than the derivatives of `rates` (n, 3): its axes turn."""
        vx, vy, wz = rates.T
        return np.column_stack([-wz * vy, wz * vx, np.zeros_like(wz)])

    def lean_arm(self, settings) -> float:
        """Height [m] by which the IMU moves forward for each radian that the body leans, wheels held to it."""
        return 0.0

    def friction(self, plant) -> Friction:
        """Friction of the wheels that the plant has; none where velocity is commanded."""
        return plant.friction if self.driven == TORQUE else Friction()

    def least_friction(self, plant, name: str) -> float:
        """The lowest that can be added to the friction's number `name`: minus the plant's own."""
        return -getattr(self.friction(plant), name)

    def friction_slopes(self, plant) -> tuple[float, float]:
        """Slopes of friction [N m s/rad]: what the 5 ms step allows besides the plant's own around standstill, and what
        it allows in all; infinite where torque moves nothing."""
        if self.driven == COMMAND:
            return math.inf, math.inf
        try:
            with np.errstate(all="ignore"):
                mobility = self.mobility(plant)
                own = self._friction_numbers(plant, mobility)
                most = stable_slope(float(np.linalg.eigvalsh(mobility)[-1]))
        except (InputError, ValueError):  # the plant refuses such numbers itself, and says why
            return math.inf, math.inf
        return most - dry_slope(own) - own["viscous"], most

    def friction_width(self, plant) -> float:
        """The width w_s [rad/s] around standstill over which the plant's own dry friction grows; 0 if it has none, or
        bristles."""
        own = self.friction(plant)
        if own.coulomb_n_m == 0.0 or own.model != "smooth":
            return 0.0
        try:
            with np.errstate(all="ignore"):
                return self._friction_numbers(plant, self.mobility(plant))["speed_scale"]
        except (InputError, ValueError):
            return 0.0

    def _friction_numbers(self, plant, mobility) -> dict[str, float]:
        return friction_parameters(self.friction(plant), mobility, f"{self.name}.plant.friction")

    def error_system(self, plant, imu_height_m: float = 0.0) -> ErrorSystem:
        """Small differences between a robot and its model, x = [pose (3), its rates (3)] in B."""
        wheels = plant.geometry.inverse
        none = np.zeros((3, 3))
        a, push = np.block([[none, np.eye(3)], [none, none]]), np.vstack([none, np.eye(3)])
        if len(plant.geometry.sideways):  # tyres hold it: it neither moves that way nor does anything show it
            moves = plant.geometry.forward @ wheels
            a = np.block([[none, moves], [none, none]]) - _DAMPING_PER_S * np.eye(6)
            push = np.vstack([none, moves])
        return ErrorSystem(a, push, np.hstack([wheels, np.zeros((len(wheels), 3))]), np.zeros((len(wheels), 3)))

    def followed_plant(self, settings, plant) -> Block:
        """The plant that `explain` holds on a measured motion, free to be pushed by the ground."""
        return self.plant_block(settings, plant, ground=True)

    def ground_force(self, force: np.ndarray) -> np.ndarray:
        """(rows, 3) along the coordinates of `ground`, from F_x, F_y [N] and M [N m] on the body in its own axes."""
        return force

    def force_of_command(self, plant) -> np.ndarray:
        """(3,) the largest force on the body along its axes that a command of one can make."""
        return np.abs(plant.geometry.inverse).sum(axis=0) if self.driven == TORQUE else np.ones(3)
