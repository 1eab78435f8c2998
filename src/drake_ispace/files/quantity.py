"""Fields of scenario dataclasses that know their unit and range, so that one walk over the tree can check them all."""

import dataclasses


def quantity(default, unit="", *, minimum=None, maximum=None, above=None, below=None, choices=None, length=None):
    """A dataclass field with a default, a unit and what is allowed.

    Args:
        default: the value; a list is copied for every instance.
        unit: shown in messages and tables, "" for a pure number.
        minimum, maximum: closed bounds; above, below: open bounds; for a list, of each entry.
        choices: the allowed strings.
        length: the number of entries of a list.
    """
    rules = {
        "unit": unit, "minimum": minimum, "maximum": maximum, "above": above, "below": below, "choices": choices,
        "length": length,
    }
    metadata = {name: rule for name, rule in rules.items() if rule is not None}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=lambda: type(default)(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)
