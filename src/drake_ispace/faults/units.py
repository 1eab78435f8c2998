"""Faults of units: numbers and stamps that mean something else."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "wrong_unit", "a column in another unit",
        "all numbers of a column are a factor too large or too small",
        "millimetres, degrees, counts, mN m or g are logged and recording.yaml does not say so, the room was marked "
        "out in another unit, or commands are shares of a largest speed",
        "the channel's motion is that factor times what the other channels say",
        "name the unit in recording.yaml, or multiply the column",
        same=("counts_per_turn", "model_size"),
    ),
    Fault(
        "time_unit", "stamps in another unit",
        "a channel's time runs a thousand or a million times too fast",
        "the logger stamps in milliseconds, microseconds or nanoseconds",
        "the step between samples is none that a sensor of a robot has", "multiply the stamps",
        same=("epoch_stamps", "clocks_disjoint"),
    ),
    Fault(
        "epoch_stamps", "stamps from another epoch",
        "a channel's time starts a day or more away from the others', or leaps by as much",
        "one logger stamps with the time since 1970, another one from its own start, or the clock was set meanwhile",
        "the channels do not overlap, or stamps leap", "subtract the difference, and compare motion",
        same=("clocks_disjoint", "time_unit"),
    ),
    Fault(
        "counts_per_turn", "another number of counts per turn",
        "a wheel, or all, seem to turn by a known factor too far",
        "edges are counted instead of lines (2, 4), a gear is forgotten, or another encoder is fitted",
        "wheels and camera move by that factor differently", "multiply the angles, or correct counts and gear",
        same=("gear", "diameter_for_radius", "wrong_unit"), effects=("encoder_scale",),
    ),
)
