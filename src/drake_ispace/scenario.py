"""One commented tree of dataclasses that describes a whole run; a YAML file overrides it.

Defaults are the thesis's tables where they hold and stated assumptions where it is silent (docs/fidelity.md). The
packaged scenarios, one per Diagram and one per `*_as_printed` variant, lie in `scenarios/`.
"""

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np

from drake_ispace.control.adaptive_compensator import Adaptation
from drake_ispace.control.friction_compensator import FrictionCompensation
from drake_ispace.control.online_identifier import Identifier
from drake_ispace.control.paths import Trajectory
from drake_ispace.control.servo import Servo
from drake_ispace.control.tracker import Tracker
from drake_ispace.control.velocity_command import VelocityControl
from drake_ispace.effects.effect import Body
from drake_ispace.effects.library import checked_effects
from drake_ispace.errors import InputError, expected_one_of, shown
from drake_ispace.quantity import quantity
from drake_ispace.rates import MAX_TICK, TICK_S
from drake_ispace.robots.actuator import Actuator
from drake_ispace.robots.impulse import Impulse
from drake_ispace.robots.plants.omni import OmniPlantParameters
from drake_ispace.robots.plants.pendulum import PendulumPlantParameters
from drake_ispace.robots.plants.rover import RoverPlantParameters
from drake_ispace.robots.plants.rover import check as check_rover
from drake_ispace.sensing.encoder import Encoder
from drake_ispace.sensing.imu import Imu
from drake_ispace.sensing.sinusoid_noise import SinusoidNoise
from drake_ispace.sensing.tilt_filter import TiltFilter
from drake_ispace.space.kinect import Space
from drake_ispace.typed_tree import checked, read
from drake_ispace.yaml_guard import load_yaml


@dataclass
class OmniControl:
    """Feedback of the omni robot, section 6.5.3."""

    # dlqr: designed from the plant; given: k_p and k_d below
    gains: str = quantity("dlqr", choices=("dlqr", "given"))
    # weights of x, y, phi and their rates: (6.24) with x, y times 1000, phi times 100, the rates of x, y over 10. A
    # higher weight on phi would be lost on vision feedback, whose yaw loop is the first to go unstable at 95 ms
    q: list[float] = quantity([1.4e7, 1.4e7, 9.75e4, 1.75e4, 1.75e4, 1.0e4], minimum=0.0, length=6)
    # (6.25)
    r: list[float] = quantity([2.3e3, 2.3e3, 5.0e2], above=0.0, length=3)
    # (6.26), (6.27)
    k_p: list[float] = quantity([2.45, 2.45, 1.23], "N/m, N*m/rad", minimum=0.0, length=3)
    k_d: list[float] = quantity([10.0, 10.0, 4.0], "N*s/m, N*m*s/rad", minimum=0.0, length=3)
    # of the vision-feedback PID only; zero as printed
    k_i: list[float] = quantity([0.0, 0.0, 0.0], minimum=0.0, length=3)
    # largest force and moment of the vision-feedback PID, for anti-windup; null: none
    force_limit: list[float] | None = quantity(None, "N, N, N*m", above=0.0, length=3)
    # of the way point; (6.13) has none, which costs a lag of K_d v / K_p = 1 m
    velocity_feed_forward: bool = quantity(True)
    acceleration_feed_forward: bool = quantity(True)
    # (6.6) without its rotation, and J at odometry's own heading
    estimator_as_printed: bool = quantity(False)


@dataclass
class PendulumControl:
    """Feedback of the pendulum, section 6.6.4."""

    gains: str = quantity("dlqr", choices=("dlqr", "given"))
    # weights of s, phi, theta and their rates, (6.40), and of both torques, (6.41)
    q: list[float] = quantity([5e3, 1e3, 800.0, 50.0, 100.0, 1e3], minimum=0.0, length=6)
    r: list[float] = quantity([1e4, 1e4], above=0.0, length=2)
    # K (right wheel: s, phi) and F1 (right wheel: theta, s', phi', theta') of (6.42)-(6.43); left: yaw entries negated
    k_right: list[float] = quantity([0.4351, -0.2217], length=2)
    f1_right: list[float] = quantity([1.3328, 0.5548, -0.0843, 0.2023], length=4)
    tracker: Tracker = field(default_factory=Tracker)
    friction_compensation: FrictionCompensation = field(default_factory=FrictionCompensation)
    # (6.6) without its rotation
    estimator_as_printed: bool = quantity(False)


@dataclass
class OmniRobot:
    """The four-wheeled omni-directional robot of Fig. 2.2."""

    plant: OmniPlantParameters = field(default_factory=OmniPlantParameters)
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


@dataclass
class PendulumRobot:
    """The two-wheeled inverted pendulum of Fig. 2.1."""

    # nonlinear: (2.48) as corrected; linear_as_printed: (3.41)-(3.42)
    model: str = quantity("nonlinear", choices=("nonlinear", "linear_as_printed"))
    plant: PendulumPlantParameters = field(default_factory=PendulumPlantParameters)
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
    # as the omni robot's
    effects: dict = quantity({})
    # of the Diagram pendulum_servo only
    servo: Servo = field(default_factory=Servo)
    sensor_noise: SinusoidNoise = field(default_factory=SinusoidNoise)
    # of the Diagram pendulum_friction_compensation only
    impulse: Impulse = field(default_factory=Impulse)
    adaptation: Adaptation = field(default_factory=Adaptation)
    identifier: Identifier = field(default_factory=Identifier)


@dataclass
class Rover:
    """Somebody else's robot, which takes a body-velocity command; of velocity_base and odometry_replay only."""

    plant: RoverPlantParameters = field(default_factory=RoverPlantParameters)
    # resolution assumed
    encoder: Encoder = field(default_factory=lambda: Encoder(counts_per_turn=2000))
    control: VelocityControl = field(default_factory=VelocityControl)
    trajectory: Trajectory = field(default_factory=Trajectory)
    # x, y, phi at t = 0; null: where the path starts
    initial_pose: list[float] | None = quantity(None, "m, m, rad", length=3)
    # as the omni robot's
    effects: dict = quantity({})


@dataclass
class Scenario:
    """A Diagram of the catalog with everything it is made of."""

    # a name of the catalog
    diagram: str = quantity("omni_multirate")
    seconds: float = quantity(30.0, "s", minimum=TICK_S, maximum=MAX_TICK * TICK_S)
    seed: int = quantity(0, minimum=0)
    space: Space = field(default_factory=Space)
    omni: OmniRobot = field(default_factory=OmniRobot)
    pendulum: PendulumRobot = field(default_factory=PendulumRobot)
    rover: Rover = field(default_factory=Rover)


#: The sections of a Scenario that are robots.
ROBOTS = ("omni", "pendulum", "rover")


def scenario_names() -> list[str]:
    """The packaged scenarios."""
    folder = resources.files("drake_ispace") / "scenarios"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_scenario(name_or_file: str, overrides: typing.Sequence[str] = ()) -> Scenario:
    """The scenario of that name, or in that YAML file, with `key.path=value` overrides applied in order.

    Raises:
        InputError: unknown name, unreadable file, unknown key, wrong type, value out of range.
    """
    if name_or_file in scenario_names():
        file = resources.files("drake_ispace") / "scenarios" / f"{name_or_file}.yaml"
        data = load_yaml(file.read_text(encoding="utf-8"), name_or_file)
        where = name_or_file
    elif name_or_file.endswith((".yaml", ".yml")) or "/" in name_or_file:
        data, where = load_yaml(Path(name_or_file), name_or_file), name_or_file
    else:
        hint = expected_one_of(name_or_file, scenario_names())
        raise InputError(f"there is no scenario {shown(name_or_file)}, {hint}")
    scenario = read(Scenario(), data, where)
    for override in overrides:
        key, equals, text = override.partition("=")
        key = key.strip()
        if not equals or not key or key.count(".") > 9 or not override.isprintable():
            raise InputError(f"--set {shown(override)}: expected key=value, such as omni.plant.mass_kg=8")
        value = load_yaml(f"value: {text}\n", f"--set {key}")["value"]
        for part in reversed(key.split(".")):
            value = {part: value}
        scenario = read(scenario, value, "--set")
    _check_places(scenario, where)
    for name in ROBOTS:
        robot = getattr(scenario, name)
        with blaming(where):
            body = body_of(scenario, name)
        robot.effects = checked_effects(robot.effects, body, f"{where}: {name}.effects")
        if robot.effects and getattr(robot, "model", "") == "linear_as_printed":
            raise InputError(f"{where}: {name}.effects: expected none with model linear_as_printed")
    return scenario


def as_scenario(given: Scenario | str | Path) -> Scenario:
    """The Scenario itself, or the one of that name or in that file.

    Raises:
        InputError: neither of these, or as `load_scenario`.
    """
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, str | Path):
        raise InputError(f"expected a Scenario, or the name or file of one, got {shown(given)}")
    return load_scenario(str(given))


def named_scenarios(
    given: Scenario | str | Path | Sequence[Scenario | str | Path] | Mapping[str, Scenario | str | Path]
) -> dict[str, Scenario]:
    """One scenario or several by name: a mapping's own names, else a scenario's name, file or Diagram.

    Raises:
        InputError: none at all, the same name twice, or as `as_scenario`.
    """
    if isinstance(given, Mapping):
        pairs = list(given.items())
    else:
        listed = [given] if isinstance(given, Scenario | str | Path) else given
        pairs = [(one.diagram if isinstance(one, Scenario) else str(one), one) for one in listed]
    names = [name for name, _ in pairs]
    if not names:
        raise InputError("there is no scenario, expected at least one")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{shown(twice[0])} is named twice, expected different names, as in a mapping of your own")
    return {name: as_scenario(one) for name, one in pairs}


def body_of(scenario: Scenario, robot: str) -> Body:
    """What effects may know of the scenario's robot ("omni", "pendulum", "rover")."""
    plant = getattr(scenario, robot).plant
    return Body(robot, robot, plant, len(plant.geometry.wheels), scenario.seed)


def with_option(scenario: Scenario, name: str, value) -> Scenario:
    """A copy with the top-level number `name` replaced, for an option --name.

    Raises:
        InputError: naming the option.
    """
    (found,) = (f for f in dataclasses.fields(scenario) if f.name == name)
    return dataclasses.replace(scenario, **{name: checked(value, found.type, found.metadata, f"--{name}")})


@contextmanager
def blaming(where: str):
    """Put `where`, the scenario's name or file, in front of what is wrong with values that do not go together.

    Raises:
        InputError: for an InputError raised inside, and for extreme values with which no Diagram can be computed.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    except ValueError as error:  # a singular matrix too
        reason = str(error).rstrip(".")
        raise InputError(
            f"{where}: no Diagram can be computed from these values ({reason}), expected plant and control closer to "
            "the defaults"
        ) from None


def _check_places(scenario, where):
    width, depth = scenario.space.width_m, scenario.space.depth_m
    check_rover(scenario.rover.plant, f"{where}: rover.plant")
    for name in ROBOTS:
        robot = getattr(scenario, name)
        pose, patch = robot.initial_pose, robot.plant.slip.patch_m
        if pose is not None and not (abs(pose[0]) <= width / 2 and abs(pose[1]) <= depth / 2):
            raise InputError(
                f"{where}: {name}.initial_pose: ({pose[0]:.3g}, {pose[1]:.3g}) m lies outside of the {width:g} x "
                f"{depth:g} m space, expected |x| <= {width / 2:g} and |y| <= {depth / 2:g}"
            )
        if patch is not None and not (patch[0] < patch[1] and patch[2] < patch[3]):
            raise InputError(
                f"{where}: {name}.plant.slip.patch_m: expected x_min < x_max and y_min < y_max, got {patch}"
            )


def to_data(scenario) -> dict:
    """The whole tree as plain mappings, ready for YAML."""
    return dataclasses.asdict(scenario)


def difference(scenario: Scenario) -> dict:
    """Only what differs from the defaults: the shortest YAML that gives this scenario."""
    return _difference(to_data(scenario), to_data(Scenario())) | {"diagram": scenario.diagram}


def _difference(data, defaults):
    changed = {}
    for key, value in data.items():
        if isinstance(value, dict):
            if inner := _difference(value, defaults.get(key, {})):
                changed[key] = inner
        elif key not in defaults or value != defaults[key]:
            changed[key] = value
    return changed
