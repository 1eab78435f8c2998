"""Effects of a scenario put into a Diagram: blocks into their wires, wrong numbers into the plant."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from pydrake.systems.primitives import ConstantVectorSource

from drake_ispace.effects.effect import BlockEffect, Body, Effect, EffectBlock, PlantEffect
from drake_ispace.effects.library import library
from drake_ispace.wiring.bench import Bench, Part


def chosen_effects(effects: Mapping[str, Mapping[str, float]]) -> list[tuple[Effect, dict[str, float]]]:
    """The effects that a scenario lists, in the order of the library, with all of their values."""
    return [(effect, dict(effects[name])) for name, effect in library().items() if name in effects]


def changed_plant(plant, body: Body, effects: Sequence[tuple[Effect, Mapping[str, float]]]):
    """The plant's parameters with every PlantEffect in them."""
    for effect, values in effects:
        if isinstance(effect, PlantEffect):
            plant = effect.change(body.robot, plant, effect.neutral(body) | dict(values))
    return plant


def needs_ground(effects: Sequence[tuple[Effect, Mapping[str, float]]]) -> bool:
    """Whether a force from the ground acts, for which the plant needs a port."""
    return any(isinstance(effect, BlockEffect) and effect.wire == "ground_force" for effect, _ in effects)


def splice_chosen(
    part: Part, body: Body, effects: Mapping[str, Mapping[str, float]], ends: Mapping[str, list[str]],
    without: Collection[str] = (),
) -> None:
    """Put the effects that a scenario lists into the wires of a robot, the one place where a Diagram gets them.

    ends: where the wires that leave the robot end, by name. without: wires that take none.
    """
    own = {
        "torque": "plant.torque", "velocity": "plant.velocity", "wheel_angle": "encoder.wheel_angle",
        "body_motion": "imu.body_motion",
    }
    wires = {wire: [part.block(end)] for wire, end in own.items()} | dict(ends)
    kept = {wire: wires[wire] for wire in wires if wire in body.robot.wires and wire not in without}
    splice_effects(part.bench, body, chosen_effects(effects), kept)


def splice_effects(
    bench: Bench, body: Body, effects: Sequence[tuple[Effect, Mapping[str, float]]], wires: Mapping[str, list[str]],
) -> None:
    """Put the block of every BlockEffect into its wire, in the order given; `wires`: name of a wire -> where it ends.

    An effect whose wire the Diagram does not have is left out.
    """
    plant = f"{body.name}_plant"
    if needs_ground(effects) and "ground_force" not in wires:
        bench.add(f"{body.name}_ground", ConstantVectorSource(np.zeros(3)))
        bench.wire((f"{body.name}_ground.y0", f"{plant}.ground_force"))
        wires = {**wires, "ground_force": [f"{plant}.ground_force"]}
    for effect, values in effects:
        if not isinstance(effect, BlockEffect) or effect.wire not in wires:
            continue
        name = f"{body.name}_{effect.name}"
        block = EffectBlock(effect, body, effect.neutral(body) | dict(values))
        bench.splice(wires[effect.wire], name, block, effect.wire)
        others = [port for port in block.spec.inputs if port != effect.wire]
        bench.wire(*[
            (bench.source(f"{plant}.torque") if port == "torque" else f"{plant}.{port}", f"{name}.{port}")
            for port in others
        ])
