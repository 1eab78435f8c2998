"""What `explain` says of effects that are hidden in robots of other physics: MuJoCo, and wheels that creep.

    python -m hidden.foreign_campaign --single 60 --pairs 40      (in the folder tests)

prints a line a case as it ends, then the shares. An effect of its own is right if its name is returned, alone or in the
set, and wrong if another single effect is named. A case is unseen if the data are the same without one of its effects,
bit for bit. A pair is exact if both are named, and nothing else. Sizes of pairs are up to 1 : 20, in units of the
typical one. Effects on slip are left out: there the contacts make it.
"""

import argparse
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.explain import explain
from hidden.effect_sizes import effects_of, scaled
from hidden.generator import FOREIGN, RobotLost, generate
from hidden.motions import MOTIONS

_OF_CONTACTS = ("constant_slip", "wheel_slip", "cornering_slip")
_RUNS = 5  # of a case, the last of them held out
_LEAST = {1: 0.5, 2: 0.05}  # effects at once -> smallest size of the first of them, in typical ones


@dataclass(frozen=True)
class Case:
    """A robot with effects, name -> factor of the typical size, on some motions."""

    robot: str
    factors: dict[str, float]
    motions: tuple[str, ...]
    seed: int

    def recordings(self, without: str = "") -> list:
        """Its runs; without: the name of an effect that is not hidden in them."""
        factors = {name: factor for name, factor in self.factors.items() if name != without}
        effects = {name: scaled(name, self.robot, factor) for name, factor in factors.items()}
        return [
            generate(self.robot, motion, effects, 20.0, 100 * self.seed + i, physics=FOREIGN)
            for i, motion in enumerate(self.motions)
        ]


def cases(count: int, together: int, seed: int = 16) -> list[Case]:
    """Cases with so many effects at once, drawn at random, the two robots in turn."""
    generator, drawn = np.random.default_rng([seed, together]), []
    for k in range(count):
        robot = ("omni", "pendulum")[k % 2]
        known = [name for name in effects_of(robot) if name not in _OF_CONTACTS]
        names = generator.choice(known, together, replace=False).tolist()
        factors = np.exp(generator.uniform(np.log(_LEAST[together]), 0.0, together))
        factors[1:] = 1.0
        motions = tuple(str(m) for m in generator.permutation([*MOTIONS, *MOTIONS])[:_RUNS])
        sizes = dict(zip(names, factors.tolist(), strict=True))
        drawn.append(Case(robot, sizes, motions, 3000 + 100 * together + k))
    return drawn


def judged(case: Case) -> str:
    """"exact", "right" (all names returned, others too), "partly", "wrong" (a single other name), "missed", "unseen",
    "lost"."""
    verdict, said = _judged(case)
    hidden = ", ".join(f"{name} x{factor:.2g}" for name, factor in case.factors.items())
    print(f"{verdict:7s} {case.robot:8s} {hidden}{said}", flush=True)
    return verdict


def _judged(case) -> tuple[str, str]:
    """The verdict, and what was said of the case."""
    try:
        *runs, held_out = recordings = case.recordings()
        for name in case.factors:
            if all(is_same(*both) for both in zip(recordings, case.recordings(without=name), strict=True)):
                return "unseen", f": {name}"
    except RobotLost:
        return "lost", ""
    answer = explain(f"{case.robot}_multirate", runs, [held_out])
    sets = [{effect.name, *effect.equivalents} for effect in answer.effects]
    true = set(case.factors)
    hit = {name for name in true if any(name in one for one in sets)}
    if hit == true:
        verdict = "exact" if len(sets) == len(true) else "right"
    elif hit:
        verdict = "partly"
    else:
        verdict = "wrong" if answer.verdict == "named" and len(sets) == 1 else "missed"
    named = ", ".join(effect.name for effect in answer.effects)
    return verdict, f": {answer.verdict} {named} ({answer.seconds:.0f} s)"


def is_same(one, other) -> bool:
    """Whether two recordings have the same samples."""
    return all(
        np.array_equal(one.channels[name].t, channel.t) and np.array_equal(one.channels[name].values, channel.values)
        for name, channel in other.channels.items()
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--single", type=int, default=60, help="number of cases with one effect")
    parser.add_argument("--pairs", type=int, default=40, help="number of cases with two effects")
    options = parser.parse_args()
    for together, count in ((1, options.single), (2, options.pairs)):
        told = [judged(case) for case in cases(count, together)]
        counted = {verdict: told.count(verdict) for verdict in dict.fromkeys(told)}
        print(f"{together} at once, {count} cases: {', '.join(f'{v} {n}' for v, n in counted.items())}")


if __name__ == "__main__":
    main()
