"""How the numbers of all leaves lie in one packed vector each: continuous state, discrete state, parameters."""

from dataclasses import dataclass

from drake_ispace.rollout.network import Network


@dataclass(frozen=True)
class Layout:
    """Where each leaf's numbers lie in the packed vectors: leaf -> slice."""

    continuous: dict[str, slice]
    discrete: dict[str, slice]
    parameters: dict[str, slice]


def layout_of(network: Network) -> Layout:
    """The leaves one after the other, in the Diagram's order."""
    leaves = network.leaves.items()
    return Layout(
        _slices({name: len(leaf.continuous_state) for name, leaf in leaves}),
        _slices({name: len(leaf.discrete_state) for name, leaf in leaves}),
        _slices({name: len(leaf.parameters) for name, leaf in leaves}),
    )


def parameter_sizes(spec):
    """(name, number of floats, whether it is passed as a float) of every parameter."""
    names = spec.parameter_names
    for name, value in spec.parameters.items():
        size = sum(1 for full in names if full == name or full.startswith((f"{name}.", f"{name}[")))
        yield name, size, names.count(name) == 1 and not isinstance(value, dict)


def _slices(sizes: dict) -> dict:
    start, parts = 0, {}
    for name, size in sizes.items():
        parts[name] = slice(start, start + size)
        start += size
    return parts
