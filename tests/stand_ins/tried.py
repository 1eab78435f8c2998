"""What tests of the workflow try, where the whole library would only take longer."""

from drake_ispace.effects.effect import body_of
from drake_ispace.effects.library import library
from drake_ispace.explain.fit.candidates import Candidate, candidates
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario

OMNI = body_of(load_scenario("omni_multirate"), robots()["omni"])
#: Always the same ones: each choice has a prediction of its own to be compiled.
FEW = [
    library()[name]
    for name in ("floor_tilt", "coulomb_friction", "viscous_friction", "mass_error", "wheel_radius_error")
]


def candidate(name: str) -> Candidate:
    """An effect of the library on the omni robot, with its first choice of wheel."""
    return candidates({name: library()[name]}, OMNI)[0]
