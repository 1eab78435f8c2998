"""From a recorded run of the pendulum to coefficients, their intervals and residual tests."""

import math
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.recording import Recording
from drake_ispace.thesis.friction_coefficients import FrictionCoefficients, friction_coefficients
from drake_ispace.thesis.methods.armax import armax
from drake_ispace.thesis.methods.armaxd import armaxd
from drake_ispace.thesis.methods.arx import arx, recursive_arx
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.methods.instrumental import instrumental
from drake_ispace.thesis.methods.residual_tests import ResidualTest, residual_tests
from drake_ispace.thesis.structures import friction_problem

STRUCTURES = ("arx", "armax", "armaxd", "iv", "pem")


@dataclass(frozen=True)
class Identification:
    """The result of `identify_run`.

    Attributes:
        estimate: Table 4.1's coefficients, or the two of the friction by "pem".
        friction: (4.8)-(4.9); tests: of the residuals; seconds: length of the run [s].
    """

    estimate: Estimate
    friction: FrictionCoefficients
    tests: list[ResidualTest]
    seconds: float

    def to_data(self) -> dict:
        """Ready for JSON; None for what is no finite number."""
        low, high = self.estimate.interval()
        rows = [
            {"of": name, "in": output, "value": _finite(self.estimate.theta[i, j]), "low": _finite(low[i, j]),
             "high": _finite(high[i, j])}
            for i, name in enumerate(self.estimate.names) for j, output in enumerate(self.estimate.outputs)
        ]
        friction = self.friction
        return {
            "structure": self.estimate.method, "seconds": self.seconds, "coefficients": rows,
            "friction": {
                "coulomb_n_m": _finite(friction.coulomb_n_m), "viscous_n_m_s": _finite(friction.viscous_n_m_s),
                "coulomb_std": _finite(friction.coulomb_std), "viscous_std": _finite(friction.viscous_std),
                "condition": _finite(friction.condition), "relative_error_of_b": _finite(friction.relative_error_of_b),
                "trustworthy": bool(friction.trustworthy),
            },
            "residual_tests": [
                {"output": test.output, "lags": test.lags, "whiteness": _finite(test.whiteness),
                 "whiteness_p": _finite(test.whiteness_p), "white": bool(test.white),
                 "cross_p": {name: _finite(p) for name, p in test.cross_p.items()},
                 "independent": bool(test.independent)}
                for test in self.tests
            ],
            "notes": self._notes(),
        }

    def _notes(self):
        notes = list(self.estimate.notes)
        if not self.friction.trustworthy:
            notes.append("B is known too badly for the friction coefficients to mean much")
        if not all(test.white for test in self.tests):
            notes.append("the residual is not white: the intervals of arx, armax, armaxd and pem are too narrow")
        return notes


def identify_run(recording: Recording, structure: str) -> Identification:
    """Identify the run's pendulum by one of STRUCTURES.

    The model is Table 2.1's where one is needed ("pem"): the plant of the recorded scenario's defaults.

    Raises:
        InputError: another robot, missing channels or gaps, an unknown structure, a robot that does not move.
    """
    if structure not in STRUCTURES:
        raise InputError(f"there is no structure {shown(structure)}, expected one of {', '.join(STRUCTURES)}")
    problem = friction_problem(recording)
    seconds = len(problem.target) / problem.rate_hz
    if np.any(problem.regressor.std(axis=0) < 1e-12):
        still = [n for n, s in zip(problem.names, problem.regressor.std(axis=0), strict=True) if s < 1e-12]
        raise InputError(f"the run does not excite {', '.join(still)}, expected a robot that moves")
    if structure == "pem":
        from drake_ispace.scenario import load_scenario
        from drake_ispace.thesis.friction_data import following_rollout, friction_prediction_error

        scenario = load_scenario("pendulum_friction_excitation")
        first = friction_coefficients(arx(problem))
        start = np.clip([first.coulomb_n_m, first.viscous_n_m_s], 1e-4, 0.05)
        estimate = friction_prediction_error(following_rollout(scenario), scenario, recording, start)
        (coulomb, viscous), (c_std, v_std) = estimate.theta[:, 0], estimate.std[:, 0]
        friction = FrictionCoefficients(float(coulomb), float(viscous), float(c_std), float(v_std), 1.0, 0.0)
        return Identification(estimate, friction, _pem_tests(estimate), seconds)
    every = max(len(problem.target) // 1000, 1)
    from drake_ispace.thesis.friction_data import CUT_OFF_HZ

    methods = {
        "arx": lambda: _with_history(arx(problem), recursive_arx(problem, every=every)),
        "armax": lambda: armax(problem, every=every),
        "armaxd": lambda: armaxd(problem, CUT_OFF_HZ, every=every), "iv": lambda: instrumental(problem),
    }
    estimate = methods[structure]()
    tests = residual_tests(estimate, skip=len(problem.target) // 10)
    return Identification(estimate, friction_coefficients(estimate), tests, seconds)


def _with_history(batch: Estimate, recursive: Estimate) -> Estimate:
    return Estimate(**{**batch.__dict__, "history": recursive.history})


def _pem_tests(estimate):
    """The residual's columns are the corrections of both wheels; their regressors are the sensitivities."""
    halves = estimate.regressor.reshape(len(estimate.residual), -1, 2)
    tests = []
    for j, name in enumerate(("correction_r", "correction_l")):
        one = Estimate("pem", estimate.names, (name,), estimate.theta, estimate.std, estimate.residual[:, j : j + 1],
                       halves[:, j, :])
        tests += residual_tests(one)
    return tests


def _finite(value):
    return float(value) if math.isfinite(value) else None
