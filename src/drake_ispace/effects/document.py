"""docs/effects.md: every effect's card and parameters, written from the library.

    python -m drake_ispace.effects.document > docs/effects.md
"""

import math
import sys
from itertools import groupby

from drake_ispace.effects.card import HOMES, SCALES, Parameter
from drake_ispace.effects.effect import BlockEffect, Effect
from drake_ispace.effects.library import library
from drake_ispace.effects.listing import bodies_of, robots_of

_TITLES = {
    "actuator": "Actuator: between command and motor", "transmission": "Transmission: between motor and wheel",
    "ground": "Ground: slip, and forces from the floor", "plant": "Plant: numbers other than believed",
    "encoder": "Encoder: between wheel and count", "imu": "IMU: between body and reading",
    "camera": "Camera: between robot and reported pose", "link": "Link: between room and robot",
}
_HEAD = """# Effects

Physical causes that a model may lack. Each has a name, a place where it enters the Diagram, and parameters with a
neutral value at which every signal is that of the base model, bit for bit. A scenario lists those that it has, under
`effects` of a robot; controller and odometry know nothing of them.

Symbols: tau_i torque commanded for wheel i [N m], tau' the torque that arrives, w_i its rate relative to the body
[rad/s], theta_i its angle; v the velocity of the robot; p = (x, y) and phi its pose in W, the room; B its own axes,
x ahead, y to the left. `wheel` is a whole number from 1 on; pendulum: 1 right, 2 left. Effects in one wire act in the
order of this page. Robots: `omni`, `pendulum`, and `rover`, which takes a velocity. "Bounds" is what is physically
possible, for the default plant; "probes" are sizes at which a search begins, some in multiples of the run's own root
mean square (RMS) or largest number.

This page is written by `python -m drake_ispace.effects.document`.
"""
_OWN = '''## An effect of your own

An effect is an object of a class of your own, and one file is enough for it, say `own_effect.py`. The base class says
where the effect enters. In `drake_ispace.effects.wires`, `VelocityEffect`, `TorqueEffect`, `GroundEffect`,
`WheelAngleEffect`, `BodyMotionEffect`, `PoseEffect` and `FixEffect` put a block into a wire; in
`drake_ispace.effects.effect`, `PlantEffect` changes a number of the plant.

The kernel `output` writes the wire's signal with the effect in it; a `GroundEffect` has two in its place, `planar` and
`balancing`. A kernel's argument names are its wiring: the wire, other outputs of the plant (`wheel_angle`,
`wheel_rate`, `velocity`, `balance`, `pose`), and parameters of the block. Those are the effect's own `parameters`, or
what `block_parameters` makes of their values. It must make numbers only: ports and sizes stay the same for all values,
so that a fit needs no new compilation. A kernel `update`, if there is one, writes the memory `xd` of the block once a
tick. Where parameters depend on the robot, a method `parameters_of` gives them.

```py
from unittest import mock

import numpy as np

import drake_ispace as di
from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import TorqueEffect


@kernel
def cogged(torque, wheel_angle, ripple_n_m, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] + ripple_n_m * np.sin(12.0 * wheel_angle[i])


class Cogging(TorqueEffect):
    """tau + A sin(12 theta) on every wheel."""

    card = Card(
        name="cogging", title="Cogging", home="actuator", equation="tau' = tau + A sin(12 theta)",
        source="magnets of the motor that catch on its teeth, twelve to a turn",
        signature="an unmodelled torque that comes again twelve times a turn, whatever the command",
        look_alikes=("coulomb_friction", "encoder_eccentricity"),
        excitation="slow turning, where the torque and not the inertia sets the speed",
    )
    parameters = (Parameter("ripple_n_m", "N*m", 0.0, -1.0, 1.0, (0.005, 0.02)),)
    output = cogged


EFFECTS = [Cogging()]

if __name__ == "__main__":  # try it before it is installed
    with mock.patch.dict(di.effects(), {effect.name: effect for effect in EFFECTS}):
        run = di.simulate(di.load_scenario("omni_multirate", ["seconds=1", "omni.effects.cogging.ripple_n_m=0.01"]))
        print(run.signals["omni_pose"][-1])
```

To have it in every scenario, name it in the `pyproject.toml` of your own package and install that package:

```toml
[project.entry-points."drake_ispace.effects"]
own = "own_effect:EFFECTS"
```

Then it is in scenarios like any other:

```yaml
diagram: omni_multirate
omni:
  effects:
    cogging: {ripple_n_m: 0.01}
```
'''


def effects_markdown() -> str:
    """The whole page: the effects of the package, without those of other people's entry points."""
    found = [effect for effect in library().values() if type(effect).__module__.startswith("drake_ispace.effects.")]
    found.sort(key=lambda effect: HOMES.index(effect.card.home))
    parts = [_HEAD, _overview(found)]
    for home, effects in groupby(found, key=lambda effect: effect.card.home):
        parts.append(f"## {_TITLES[home]}\n")
        parts += [_section(effect) for effect in effects]
    return "\n".join([*parts, _OWN])


def _overview(effects):
    """Name, home and robots of all."""
    rows = [
        f"| [`{e.name}`](#{e.name}) | {e.card.home} | {', '.join(robots_of(e))} | {_cell(e.card.equation)} |"
        for e in effects
    ]
    return "\n".join(["| effect | home | robots | equation |", "|---|---|---|---|", *rows, ""])


def _section(effect: Effect) -> str:
    card = effect.card
    wire = f", in the wire `{effect.wire}`" if isinstance(effect, BlockEffect) else ", in the plant's parameters"
    facts = [
        f"**{card.title}**{wire}; {', '.join(robots_of(effect))}.", f"Equation: {_code(card.equation)}",
        f"Source: {card.source}.", f"Signature: {card.signature}.",
        f"Look-alikes: {', '.join(f'[`{name}`](#{name})' for name in card.look_alikes) or 'none'}.",
        f"What separates them: {card.excitation}.",
        *([f"Of a robot whose velocity is commanded: {card.same}."] if card.same else []),
    ]
    example = ["```yaml", *_example(effect), "```"]
    return "\n".join([f"### {card.name}\n", *[f"{fact}\n" for fact in facts], *_table(effect), "", *example, ""])


def _table(effect):
    """A row per parameter; one for all robots where they agree."""
    rows: dict[str, list[str]] = {}
    for body in bodies_of(effect):
        for p in effect.parameters_of(body):
            reading = " (fitted as 1 / value)" if p.reciprocal else ""
            text = (
                f"`{p.name}`{reading} | {p.unit} | {_number(p.neutral)} | {_number(p.low)} to {_number(p.high)} "
                f"| {_probes(p)} |"
            )
            rows.setdefault(text, []).append(body.name)
        for name in effect.choices:
            rows.setdefault(f"`{name}` | | any | 1 to {body.wheels} | each |", []).append(body.name)
    lines = [f"| {', '.join(kinds)} | {text}" for text, kinds in rows.items()]
    return ["| robot | parameter | unit | neutral | bounds | probes |", "|---|---|---|---|---|---|", *lines]


def _probes(p: Parameter):
    sizes = ", ".join(_number(probe) for probe in p.probes)
    return f"{sizes} x {SCALES[p.scale]}" if p.scale else sizes


def _example(effect):
    """A scenario with the effect at its last probes."""
    body = bodies_of(effect)[0]
    values = {name: min(2, body.wheels) for name in effect.choices}
    values |= {p.name: p.probes[-1] for p in effect.parameters_of(body)}
    inside = ", ".join(f"{name}: {_number(value)}" for name, value in values.items())
    return [f"diagram: {body.robot.diagram}", f"{body.name}:", "  effects:", f"    {effect.name}: {{{inside}}}"]


def _number(value):
    """A number in its shortest form that YAML reads back unchanged."""
    if math.isinf(value):
        return "no limit"
    text = f"{value + 0.0:.4g}"
    return text if "e" not in text or "." in text else text.replace("e", ".0e")


def _code(text):
    return f"`{text}`"


def _cell(text):
    """`text` as code within a table."""
    return _code(text.replace("|", "\\|"))


if __name__ == "__main__":
    sys.stdout.write(effects_markdown())
