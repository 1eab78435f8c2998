"""Effects as tests try them: a block alone on a bare Context, and a whole robot that has them."""

from collections.abc import Mapping

import numpy as np

from drake_ispace.effects.effect import Body, EffectBlock
from drake_ispace.effects.library import library
from drake_ispace.scenario import Scenario, load_scenario


def passed(name: str, body: Body, signal, others: Mapping = {}, **values) -> np.ndarray:
    """What the block of an effect makes of the `signal` of its wire.

    others: further ports -> value. Parameters that are not among `values` are neutral.
    """
    effect = library()[name]
    block = EffectBlock(effect, body, effect.neutral(body) | values)
    context = block.CreateDefaultContext()
    for port, value in {effect.wire: signal, **others}.items():
        block.GetInputPort(port).FixValue(context, np.asarray(value, dtype=float))
    return block.GetOutputPort(effect.wire).Eval(context)


def with_effects(diagram: str, effects: Mapping[str, Mapping[str, float]], *settings: str) -> Scenario:
    """The scenario of that name whose robot has `effects`, name -> values."""
    robot = diagram.partition("_")[0]
    listed = [f"{robot}.effects.{name}.{key}={value}" for name, of in effects.items() for key, value in of.items()]
    return load_scenario(diagram, [*settings, *listed])
