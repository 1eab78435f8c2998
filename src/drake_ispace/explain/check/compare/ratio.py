"""How many times as large torques are as the wheels say, and what that tells of their unit.

Of a plant of one's own only the ratio of torques to angles is known. Its inertia may be off by a factor of 5, so that
several units may fit, and a gain such as that of volts to newtons is none. Nor does the ratio tell which of the two is
off. It is therefore said as it is measured, beside the units that may be meant, and nothing is repaired by it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_ispace.explain.check.compare.hypotheses import ANGLES
from drake_ispace.explain.check.compare.links import FEWEST, UNKNOWN_INERTIA, Base, Link, inside, torque_link
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Mixed, repaired
from drake_ispace.files.recording import Recording
from drake_ispace.files.units import in_si
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.robot import TORQUE

#: Recorded unit -> what a number in it must be multiplied by to be in N m.
TORQUES = {
    "mN m": in_si("mN*m"), "N cm": in_si("N*cm"), "kgf cm": GRAVITY * in_si("cm"), "N mm": in_si("N*mm"),
}
_ADVICE = "log torques and angles in the model's units: the ratio tells neither which is off, nor the exact factor"


def times(links: Sequence[Link | None], bases: Sequence[Base | None], lags_s: np.ndarray) -> float:
    """How many times as large as the wheels say the torques are, in most runs; 1 where nothing is known.

    lags_s: (k,) of the wheels [s], of which that is taken at which torques go with them best.
    """
    found = []
    for link, base in zip(links, bases, strict=True):
        kept = [] if link is None else np.all([inside(base, link.since_s, link.until_s, lag) for lag in lags_s], axis=0)
        if np.sum(kept) < FEWEST:
            continue
        moments = [_pushed(link, kept, lag_s) for lag_s in lags_s]
        both, wheels, _ = max(moments, key=lambda one: one[0] * abs(one[0]) / max(one[1] * one[2], 1e-300))
        found += [both / wheels] if wheels > 0.0 else []
    return float(np.median(found)) if found else 1.0


def _pushed(link, kept, lag_s):
    """(3,) sums of x y, x x and y y of what wheels say, lag_s later, and torques, beside motions of any share."""
    since, until = link.since_s[kept] + lag_s, link.until_s[kept] + lag_s
    predicted, besides = link.predicted(since, until), link.besides(since, until)
    each = zip(predicted.T, link.measured[kept].T, besides.transpose(1, 0, 2), strict=True)
    return np.sum([_beside(*one) for one in each], axis=0)


def _beside(x, y, z):
    """x y, x x and y y of motions (n,), less what z (n, k) may have of both; zeros where no wheel pushes that way."""
    if not (np.isfinite(x).all() and np.isfinite(y).all() and np.isfinite(z).all()):
        return 0.0, 0.0, 0.0
    both = np.column_stack([x, y])
    both -= z @ np.linalg.lstsq(z, both, rcond=None)[0]
    return both[:, 0] @ both[:, 1], both[:, 0] @ both[:, 0], both[:, 1] @ both[:, 1]


def unit_as_ratio(
    findings: Sequence[Finding], runs: Sequence[Recording], bases: Sequence[Base | None], lags_s: np.ndarray
) -> list[Finding]:
    """The findings on torques of a plant of one's own, a unit being told as the ratio that the runs show.

    findings: of the same runs, a unit being one of those known. lags_s: as of `times`.
    """
    return [_told(finding, findings, runs, bases, lags_s) if finding.fault == "wrong_unit" else finding
            for finding in findings]


def _told(finding, findings, runs, bases, lags_s):
    having, links = [i for i in finding.runs if bases[i] is not None and TORQUE in runs[i].channels], []
    for i in having:
        run = repaired(runs[i], (repair for one in findings if i in one.runs for repair in one.repairs))
        links.append(torque_link(run, bases[i]))
    (undo,) = finding.repairs
    left = times(links, [bases[i] for i in having], lags_s)
    factor = np.abs(undo.matrix).max() / (left if left > 0.0 else 1.0)
    ratio = max(factor, 1.0 / factor)
    said = f"about {float(f'{ratio:.2g}'):g} times too {'large' if factor < 1.0 else 'small'}"
    exact = tuple(map(tuple, (np.eye(len(undo.columns)) * factor).tolist()))
    return replace(
        finding, what=f"torques {said} beside the wheels' angles{_units(ratio)}",
        repairs=(), for_now=(Mixed(undo.channel, undo.columns, exact),), advice=_ADVICE,
    )


def _units(ratio):
    """In words, the units that a ratio above 1 may come of, the nearest first."""
    known = {name.split(" read as ")[-1]: max(size, 1.0 / size) for name, size in {**TORQUES, **ANGLES}.items()}
    near = {}
    for name, size in known.items():
        if abs(np.log(size / ratio)) < np.log(1.0 + UNKNOWN_INERTIA.most):
            near.setdefault(round(size, 6), []).append(name)
    if not near:
        return ", which is no known unit"
    nearest = sorted(near, key=lambda size: abs(np.log(size / ratio)))
    listed = ", ".join(f"{size:.4g} ({', '.join(near[size])})" for size in nearest)
    return f"; as the inertia may be off, that may be {listed}, or a gain that is no unit"
