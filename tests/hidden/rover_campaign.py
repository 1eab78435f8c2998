"""What `explain` says of a two-wheeled robot under commanded velocity: one or two effects, or one that it cannot name.

    python -m hidden.rover_campaign --sound 12 --single 40 --pairs 20 --outside 32 --unlogged 8 --between 20

in the folder tests prints a line a case as it ends, then the shares. An effect is right if one of its names is
returned, alone or in a set, and wrong if only other names are, with the verdict "named" or "set". A pair is exact if
both are right and nothing else is named. Three training runs of 30 s and two unseen ones. Of "unlogged" robots, which
lack nothing, the command changes between samples of its log, and of those "between" them, which have one effect.
"""

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import drake_ispace as di
from drake_ispace.effects.effect import Effect
from drake_ispace.explain.answer.explanation import Explanation
from hidden import two_wheels

#: What is hidden -> (largest size, names that say it).
NAMED = {
    "left_share": (0.04, {"single_wheel_radius_error", "wheel_radius_errors", "encoder_lost_counts"}),
    "radius_share": (0.04, {"wheel_radius_error", "encoder_scale", "wheel_radius_errors"}),
    "track_share": (0.06, {"track_error"}),
    "lost_share": (0.03, {"encoder_lost_counts", "single_wheel_radius_error"}),
    "slip_share": (0.05, {"constant_slip"}),
    "marker_x_m": (0.05, {"marker_offset"}),
    "marker_y_m": (0.05, {"marker_offset"}),
    "camera_share": (0.03, {"camera_scale"}),
    "late_s": (0.1, {"camera_latency", "clock_offset"}),
    "lag_s": (0.1, {"velocity_lag"}),
    "delay_s": (0.1, {"velocity_delay"}),
    "gain_share": (0.1, {"velocity_gain"}),
    "skid_s": (0.1, {"cornering_slip"}),
    "ramp_s2_m": (2.0, {"velocity_slew_limit"}),
    "brake_s2_m": (2.0, {"velocity_braking_limit"}),
    "dead_rad_s": (1.0, {"velocity_dead_zone"}),
    "swing_s2": (0.01, {"velocity_overshoot"}),
    "clipped_s_rad": (0.4, {"wheel_speed_limit"}),
    "slowed_s_rad": (0.4, {"wheel_speed_desaturation"}),
    "turns_s_rad": (5.0, {"velocity_saturation"}),
}
#: What no library names -> largest size.
OUTSIDE = {
    "lean_s2_m": 0.1, "belt_m_s": 0.01, "deflating_share": 0.05, "patch_share": 0.1, "fast_slip_s2_m2": 0.3,
    "skewed_share": 0.05, "warped_rad_m": 0.08, "ripple_rad": 0.05, "least_rad_s": 3.0, "steps_rad_s": 2.0,
}
_POSITIVE = (
    "lost_share", "ramp_s2_m", "slip_share", "patch_share", "fast_slip_s2_m2", "swing_s2", "dead_rad_s", "brake_s2_m",
    "least_rad_s", "steps_rad_s", "clipped_s_rad", "slowed_s_rad", "turns_s_rad",
)
_OWN = ("left_share", "late_s", "lag_s")  # arguments of `drive`
_RUNS, _TRAINING = 5, 3


@dataclass(frozen=True)
class Case:
    """Hidden sizes by name, the seed of the runs, and whether the command changes only when it is logged."""

    sizes: dict[str, float]
    seed: int
    in_step: bool = True

    def recordings(self, seconds: float) -> list:
        """Its runs."""
        own = {name: self.sizes.get(name, 0.0) for name in _OWN}
        others = {name: size for name, size in self.sizes.items() if name not in _OWN}
        return [
            two_wheels.drive(100 * self.seed + i, seconds, **own, others=others, in_step=self.in_step)
            for i in range(_RUNS)
        ]


def cases(count: int, pool: dict[str, float], together: int, least: float, seed: int = 20) -> list[Case]:
    """Cases with so many of the `pool` at once: each in turn, sizes from `least` of the largest one on, either sign."""
    generator, drawn, names = np.random.default_rng([seed, together, len(pool)]), [], list(pool)
    for k in range(count):
        rest = [name for name in names if name != names[k % len(names)]]
        chosen = [names[k % len(names)], *generator.choice(rest, together - 1, replace=False).tolist()]
        sizes = {name: float(pool[name] * np.exp(generator.uniform(np.log(least), 0.0))) for name in chosen}
        for name in chosen:
            if not name.endswith("_s") and name not in _POSITIVE:
                sizes[name] *= float(generator.choice([-1.0, 1.0]))
        drawn.append(Case(sizes, 500 + 100 * together + k))
    return drawn


def answer(case: Case, seconds: float = 30.0, effects: Sequence[Effect] | None = None) -> Explanation:
    """What explain says of it."""
    runs = case.recordings(seconds)
    return di.explain(two_wheels.model(), runs[:_TRAINING], runs[_TRAINING:], effects)


def judged(case: Case, found: Explanation) -> str:
    """"exact", "in part", "wrong", or the verdict where it names nothing for certain."""
    said = [{effect.name, *effect.equivalents} for effect in found.effects]
    if found.verdict not in ("named", "set"):
        return found.verdict
    right = [any(NAMED[name][1] & names for names in said) for name in case.sizes if name in NAMED]
    if not any(right):
        return "wrong"
    return "exact" if all(right) and len(said) <= len(right) else "in part"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    counts = {"sound": 12, "single": 40, "pairs": 20, "outside": 32, "unlogged": 8, "between": 20}
    for name, count in counts.items():
        parser.add_argument(f"--{name}", type=int, default=count, help="number of cases")
    options = parser.parse_args()
    known = {name: size for name, (size, _) in NAMED.items()}
    drawn = {
        "sound": [Case({}, 400 + k) for k in range(options.sound)],
        "single": cases(options.single, known, 1, 0.25),
        "pairs": cases(options.pairs, known, 2, 0.25),
        "outside": cases(options.outside, OUTSIDE, 1, 0.25),
        "unlogged": [Case({}, 400 + k, in_step=False) for k in range(options.unlogged)],
        "between": [replace(case, in_step=False) for case in cases(options.between, known, 1, 0.25)],
    }
    for kind, some in drawn.items():
        results = Counter()
        for k, case in enumerate(some):
            started = time.perf_counter()
            found = answer(case)
            said = judged(case, found)
            results[said] += 1
            sizes = ", ".join(f"{name} {size:.3g}" for name, size in case.sizes.items())
            names = "+".join("|".join([effect.name, *effect.equivalents]) for effect in found.effects)
            flaws = ",".join(dict.fromkeys(finding.fault for finding in found.data))
            print(
                f"{kind} {k:2d} {sizes}: {said}: {found.verdict} {names} {flaws} "
                f"{'' if found.closed is None else f'{100 * found.closed:.0f} %'} "
                f"({time.perf_counter() - started:.0f} s)", flush=True,
            )
        if some:
            print(f"{kind}: " + ", ".join(f"{count} {said}" for said, count in results.most_common()))


if __name__ == "__main__":
    main()
