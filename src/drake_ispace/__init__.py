"""Simulate mobile robots in an intelligent space with Drake, and find out which physical effect a model lacks.

    import drake_ispace as di

    run = di.simulate("omni_multirate")
    print(di.explain("omni_multirate", ["monday/square", "monday/circle"], held_out="monday/eight"))

Wherever a scenario is asked for, its name or its file does as well. What is behind a name is imported when the name is
first used, so that `import drake_ispace` itself costs nothing.
"""

import importlib
import sys
import types
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same for editors and type checkers
    from drake_ispace.comparison import compare
    from drake_ispace.effects.library import library as effects
    from drake_ispace.explain.check.check import check
    from drake_ispace.explain.explain import explain
    from drake_ispace.hiding import hide
    from drake_ispace.report.pictures.drawing import draw
    from drake_ispace.robots.recordings import load
    from drake_ispace.rollout.compile import compile_diagram
    from drake_ispace.rollout.many.campaign import montecarlo
    from drake_ispace.scenario import load_scenario
    from drake_ispace.simulation import simulate
    from drake_ispace.wiring.catalog import build_diagram

__all__ = (
    "build_diagram", "check", "compare", "compile_diagram", "draw", "effects", "explain", "hide", "load",
    "load_scenario", "montecarlo", "simulate",
)

#: Name -> where it is defined, "module:name".
_BEHIND = {
    "build_diagram": "wiring.catalog:build_diagram",
    "check": "explain.check.check:check",
    "compare": "comparison:compare",
    "compile_diagram": "rollout.compile:compile_diagram",
    "draw": "report.pictures.drawing:draw",
    "effects": "effects.library:library",
    "explain": "explain.explain:explain",
    "hide": "hiding:hide",
    "load": "robots.recordings:load",
    "load_scenario": "scenario:load_scenario",
    "montecarlo": "rollout.many.campaign:montecarlo",
    "simulate": "simulation:simulate",
}


class _FrontDoor(types.ModuleType):
    """A module on whose own names no submodule is put.

    Importing `drake_ispace.effects.card` would otherwise make the folder `effects` what `drake_ispace.effects` means,
    before or after the function was used. The folder is reached by `from drake_ispace.effects.card import Card`.
    """

    def __setattr__(self, name, value):
        if name not in _BEHIND or not isinstance(value, types.ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor


def __getattr__(name: str):
    if name not in _BEHIND:
        from drake_ispace.blocks.errors import expected_one_of

        message = f"module {__name__!r} has no attribute {name!r}, {expected_one_of(name, __all__)}"
        raise AttributeError(message, name=name, obj=sys.modules[__name__])
    module, _, attribute = _BEHIND[name].partition(":")
    found = getattr(importlib.import_module(f"{__name__}.{module}"), attribute)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return list(__all__)
