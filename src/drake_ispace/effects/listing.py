"""Effects as plain data: which robots can have them, and their cards."""

import math

from drake_ispace.effects.effect import BlockEffect, Body, Effect
from drake_ispace.effects.library import bodies, library


def bodies_of(effect: Effect) -> list[Body]:
    """The robots that can have the effect."""
    return [body for body in bodies() if effect.applies_to(body)]


def robots_of(effect: Effect) -> list[str]:
    """Names of the robots that can have it, for people."""
    any_other = "any with wheels" if effect.least_wheels == 1 else f"any with {effect.least_wheels} wheels or more"
    return [body.name for body in bodies_of(effect)] + ([any_other] if effect.general else [])


def cards() -> list[dict]:
    """The card of every effect as plain data, in the order of the library; a bound or neutral value without a limit is
    None."""
    return [_card(effect) for effect in library().values()]


def _card(effect):
    card = effect.card
    return {
        "name": card.name, "title": card.title, "enters_at": card.home,
        "wire": effect.wire if isinstance(effect, BlockEffect) else None, "robots": robots_of(effect),
        "equation": card.equation, "parameters": _parameters(effect), "source": card.source,
        "signature": card.signature, "look_alikes": list(card.look_alikes), "excitation": card.excitation,
    }


def _parameters(effect):
    """One entry for all robots where they agree."""
    found = []
    for body in bodies_of(effect):
        own = [
            {"name": p.name, "unit": p.unit, "neutral": _finite(p.neutral), "bounds": [_finite(p.low), _finite(p.high)]}
            for p in effect.parameters_of(body)
        ]
        own += [{"name": name, "unit": "wheel", "neutral": 1, "bounds": [1, body.wheels]} for name in effect.choices]
        for entry in own:
            same = next((other for other in found if all(other[key] == entry[key] for key in entry)), None)
            if same is None:
                found.append(entry | {"robots": [body.name]})
            else:
                same["robots"].append(body.name)
    return found


def _finite(value):
    return float(value) if math.isfinite(value) else None
