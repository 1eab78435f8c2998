"""Effects: named physical causes with a home in the Diagram.

An effect either puts one new block into a wire (`BlockEffect`), or is a wrong number in a block that is there already
(`PlantEffect`: mass, radius, slip). At its neutral values the Diagram reproduces the base run bit for bit.
"""

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drake_ispace.blocks.block import Block, Spec
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.robots.robot import Robot

#: The wires that take a block, and the port of the block that the wire goes through.
WIRES = ("torque", "ground_force", "wheel_angle", "body_motion", "pose", "fix", "velocity")


@dataclass(frozen=True)
class Body:
    """What an effect may know of the robot that has it.

    Attributes:
        robot: that has it. plant: the dataclass of its plant's parameters. wheels: how many.
        seed: of what is random in its effects.
    """

    robot: Robot
    plant: Any
    wheels: int
    seed: int = 0

    @property
    def name(self) -> str:
        """In front of the names of its blocks."""
        return self.robot.name


def body_of(scenario, robot: Robot) -> Body:
    """What effects may know of a robot of the scenario."""
    plant = getattr(scenario, robot.name).plant
    return Body(robot, plant, len(plant.geometry.wheels), scenario.seed)


class Effect(abc.ABC):
    """An effect: `card`, `needs` (what a robot must offer to have it), and what the subclass adds.

    `choices` names whole-number parameters that select one of the wheels, 1 to n; a fit tries each.
    """

    card: Card
    #: Wires and numbers among `Robot.offers` without which it cannot be.
    needs: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()
    #: Whether measured wheel angles and a camera show it, without any torque.
    kinematic = False
    #: Whether the replay of a run has it. What happens at random is counted instead.
    replayed = True
    #: Whether it means the same in units of any kind, so that a plant whose "torque" is a voltage can have it.
    general = False

    @abc.abstractmethod
    def parameters(self, body: Body) -> tuple[Parameter, ...]:
        """Its continuous parameters for this body."""

    def applies_to(self, body: Body) -> bool:
        """Whether the robot offers all that it needs."""
        return body.robot.offers.issuperset(self.needs) and (self.general or body.robot.in_si)

    def neutral(self, body: Body) -> dict[str, float]:
        """Every parameter and choice at the value that changes nothing."""
        return {p.name: p.neutral for p in self.parameters(body)} | {name: 1 for name in self.choices}


class BlockEffect(Effect):
    """An effect that is one block in the wire `wire`.

    The block has an input and an output of the wire's name. Its other inputs are ports of the same name of the robot's
    plant (`wheel_rate`, `velocity`, `balance`, `pose`).
    """

    wire: str

    def applies_to(self, body: Body) -> bool:
        return self.wire in body.robot.offers and super().applies_to(body)

    @abc.abstractmethod
    def spec(self, body: Body, values: Mapping[str, float]) -> Spec:
        """Ports, kernels and parameters of the block at these values."""


class PlantEffect(Effect):
    """An effect that is another number in the plant, unknown to controller and odometry."""

    @abc.abstractmethod
    def change(self, robot: Robot, plant, values: Mapping[str, float]):
        """A copy of the parameters `plant` of the robot's plant with the effect in it."""


class EffectBlock(Block):
    """The block of a BlockEffect; see its card for ports and equation.

    Args:
        effect, body, values: whose, of which robot, how large.
    """

    def __init__(self, effect: BlockEffect, body: Body, values: Mapping[str, float]):
        super().__init__(effect.spec(body, values))
