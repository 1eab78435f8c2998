"""Effects: named physical causes with a home in the Diagram.

An effect either puts one new block into a wire (`BlockEffect`), or is a wrong number in a block that is there already
(`PlantEffect`: mass, radius, slip). At its neutral values the Diagram reproduces the base run bit for bit.
"""

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drake_ispace.block import Block, Spec
from drake_ispace.effects.card import Card, Parameter

#: The wires that take a block, and the port of the block that the wire goes through.
WIRES = ("torque", "ground_force", "wheel_angle", "body_motion", "pose", "fix", "velocity")


@dataclass(frozen=True)
class Body:
    """What an effect may know of the robot that has it.

    Attributes:
        name: prefix of its blocks. kind: "omni", "pendulum", "rover" or a name of the user's own.
        plant: the parameter dataclass of its plant (None: the user's own). wheels: how many.
        seed: of what is random in its effects.
    """

    name: str
    kind: str
    plant: Any
    wheels: int
    seed: int = 0


class Effect(abc.ABC):
    """An effect: `card`, `kinds` (the robots that can have it), and what the subclass adds.

    `choices` names whole-number parameters that select one of the wheels, 1 to n; a fit tries each.
    """

    card: Card
    kinds: tuple[str, ...] = ("omni", "pendulum")
    choices: tuple[str, ...] = ()
    #: Whether measured wheel angles and a camera show it, without any torque.
    kinematic = False
    #: Whether the replay of a run has it. What happens at random is counted instead.
    replayed = True
    #: Units and places in which a wheel of a robot is nothing special: any body with a torque wire can have it.
    general = False

    @abc.abstractmethod
    def parameters(self, body: Body) -> tuple[Parameter, ...]:
        """Its continuous parameters for this body."""

    def applies_to(self, body: Body) -> bool:
        return body.kind in self.kinds or (self.general and body.kind not in ("omni", "pendulum", "rover"))

    def neutral(self, body: Body) -> dict[str, float]:
        """Every parameter and choice at the value that changes nothing."""
        return {p.name: p.neutral for p in self.parameters(body)} | {name: 1 for name in self.choices}


class BlockEffect(Effect):
    """An effect that is one block in the wire `wire`.

    The block has an input and an output of the wire's name. Its other inputs are ports of the same name of the robot's
    plant (`wheel_rate`, `velocity`, `balance`, `pose`).
    """

    wire: str

    @abc.abstractmethod
    def spec(self, body: Body, values: Mapping[str, float]) -> Spec:
        """Ports, kernels and parameters of the block at these values."""


class PlantEffect(Effect):
    """An effect that is another number in the plant, unknown to controller and odometry."""

    @abc.abstractmethod
    def change(self, plant, values: Mapping[str, float]):
        """A copy of the plant's parameter dataclass with the effect in it."""


class EffectBlock(Block):
    """The block of a BlockEffect; see its card for ports and equation.

    Args:
        effect, body, values: whose, of which robot, how large.
    """

    def __init__(self, effect: BlockEffect, body: Body, values: Mapping[str, float]):
        super().__init__(effect.spec(body, values))
