"""Effects: named physical causes with a home in the Diagram.

An effect either puts one new block into a wire (`BlockEffect`), or is a wrong number in a block that is there already
(`PlantEffect`: mass, radius, slip). At its neutral values the Diagram reproduces the base run bit for bit.
"""

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import arguments
from drake_ispace.blocks.messages import FIX
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.robots.robot import Robot


@dataclass(frozen=True)
class Body:
    """The robot, as far as an effect may know it.

    Attributes:
        robot: the one that has the effect. plant: the dataclass of its plant's parameters. wheels: their number.
        seed: of what is random in its effects. room_m: width and depth of the room, whose middle is the origin of W.
    """

    robot: Robot
    plant: Any
    wheels: int
    seed: int = 0
    room_m: tuple[float, float] = (2.5, 2.0)

    @property
    def name(self) -> str:
        """Name of the robot, with which the names of its blocks begin."""
        return self.robot.name

    @cached_property
    def friction_slopes(self) -> tuple[float, float]:
        """As of `Robot.friction_slopes`."""
        return self.robot.friction_slopes(self.plant)

    @cached_property
    def friction_width(self) -> float:
        """As of `Robot.friction_width`."""
        return self.robot.friction_width(self.plant)


def body_of(scenario, robot: Robot) -> Body:
    """The Body of a robot of the scenario."""
    plant = getattr(scenario, robot.name).plant
    room_m = scenario.space.width_m, scenario.space.depth_m
    return Body(robot, plant, len(plant.geometry.wheels), scenario.seed, room_m)


def ports(body: Body) -> dict[str, int]:
    """The ports that the block of an effect may have, wires and other outputs of a plant, and the size of each."""
    own = {"velocity": 3, "ground_force": 3, "body_motion": 6, "pose": 3, "fix": len(FIX), "balance": 4}
    return {"torque": body.wheels, "wheel_angle": body.wheels, "wheel_rate": body.wheels} | own


class Effect:
    """A named physical cause, said by class attributes and by what the subclass adds."""

    #: What is known of it before any data.
    card: Card
    #: Its continuous parameters. Where they depend on the robot, the method `parameters_of` takes the place of this.
    parameters: tuple[Parameter, ...] = ()
    #: Names of whole-number parameters that select one of the wheels, 1 to n; a fit tries each.
    choices: tuple[str, ...] = ()
    #: Whether it acts in a part of the room: its parameters are a size, x_min, x_max, y_min, y_max and how soft
    #: these edges are, and `starts` has several parts. As such it can explain slow noise, too.
    is_local = False
    #: Names of effects that it becomes at a bound of its shape, and of which it is therefore no look-alike.
    generalises: tuple[str, ...] = ()
    #: Wires and numbers among `Robot.offers` without which it cannot be.
    needs: tuple[str, ...] = ()
    #: Whether measured wheel angles and a camera show it, without any torque.
    kinematic = False
    #: Whether some motion shows it. What only sets the axes of the room, or is counted, shows in none.
    in_motion = True
    #: Whether the replay of a run has it. What happens at random is counted instead.
    replayed = True
    #: Whether it means the same in units of any kind, so that a plant whose "torque" is a voltage can have it.
    general = False
    #: The wire of the Diagram that it acts in; empty: it is a number of the plant.
    wire = ""
    #: How many wheels a robot needs to have it: of fewer it would be another effect, or two.
    least_wheels = 1

    @property
    def name(self) -> str:
        """The name on its card."""
        return self.card.name

    def parameters_of(self, body: Body) -> tuple[Parameter, ...]:
        """The continuous parameters for this body."""
        return self.parameters

    def starts(self, body: Body) -> Sequence[Mapping[str, float]]:
        """Values of its shape from which a fit tries to begin, each by name."""
        return ({},)

    def scattered(
        self, angles: np.ndarray, values: Mapping[str, float], count_rad: float, generator: np.random.Generator
    ) -> np.ndarray:
        """Measured wheel angles (rows, n) with what is random in the effect, which its kernels leave out.

        count_rad: of an encoder.
        """
        return angles

    def called(self, body: Body) -> str:
        """What its size is of, where this body's kind has another word for it than its name."""
        return ""

    def applies_to(self, body: Body) -> bool:
        """Whether the robot offers all that it needs, and has wheels enough."""
        fits = self.general or body.robot.in_si
        return fits and body.wheels >= self.least_wheels and body.robot.offers.issuperset(self.needs)

    def neutral(self, body: Body) -> dict[str, float]:
        """Every parameter and choice at the value that changes nothing."""
        return {p.name: p.neutral for p in self.parameters_of(body)} | {name: 1 for name in self.choices}


class BlockEffect(Effect):
    """An effect that is one block in the wire `wire`; wires.py has a subclass for every wire.

    The block has an input and an output of the wire's name. An argument of a kernel that has the name of another of the
    `ports` is an input as well, which comes from the robot's plant (`wheel_rate`, `velocity`, `balance`, `pose`).

    Attributes:
        output: the kernel that writes the wire's signal with the effect in it.
        update: the kernel that writes the block's memory x_d in the sensing phase of every tick; None: no memory.
        in_place: whether that kernel may write into x_d itself, as blocks.block.Update has it.
    """

    wire: str
    output: Callable
    update: Callable | None = None
    in_place = False

    def applies_to(self, body: Body) -> bool:
        return self.wire in body.robot.offers and super().applies_to(body)

    def output_of(self, body: Body) -> Callable:
        """The kernel `output` for this body."""
        return type(self).output  # through the instance it would be a method

    def block_parameters(self, body: Body, values: Mapping[str, float]) -> Mapping[str, Any]:
        """Parameters of the kernels: the values themselves, unless a subclass computes others of one size for all."""
        return {p.name: values[p.name] for p in self.parameters_of(body)}

    def memory_size(self, body: Body) -> int:
        """How many numbers x_d holds, all 0 at the start: as many as the wire, unless a subclass needs another."""
        return ports(body)[self.wire]

    def spec(self, body: Body, values: Mapping[str, float]) -> Spec:
        """Ports, kernels and parameters of the block at these values."""
        output, update, sizes = self.output_of(body), type(self).update, ports(body)
        names = [self.wire, *arguments(output), *(arguments(update) if update else ())]
        spec = Spec(
            inputs={name: sizes[name] for name in names if name in sizes},
            outputs={self.wire: Output(sizes[self.wire], output)}, parameters=self.block_parameters(body, values),
        )
        if update is None:
            return spec
        kept = Update(update, Phase.SENSE, in_place=self.in_place)
        return replace(spec, discrete_state=np.zeros(self.memory_size(body)), updates=(kept,))


class PlantEffect(Effect, abc.ABC):
    """An effect that is another number in the plant, unknown to controller and odometry."""

    @abc.abstractmethod
    def change(self, robot: Robot, plant, values: Mapping[str, float]):
        """A copy of the parameters `plant` of the robot's plant with the effect in it."""


class EffectBlock(Block):
    """The block of a BlockEffect; see its card for ports and equation.

    Args:
        effect: the one that the block stands for. body: the robot that has it. values: all its parameters.
    """

    def __init__(self, effect: BlockEffect, body: Body, values: Mapping[str, float]):
        super().__init__(effect.spec(body, values))
