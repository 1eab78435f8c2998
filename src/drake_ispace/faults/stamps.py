"""Faults of clocks and stamps."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "clock_offset", "a clock that is off",
        "a channel's stamps are earlier or later than the others' by the same time",
        "each computer has its own clock, and GPS time is 18 s ahead",
        "motion appears in one channel earlier than in the others", "shift the stamps",
        effects=("clock_offset", "camera_latency", "command_delay", "velocity_delay"),
    ),
    Fault(
        "clock_drift", "a clock that is fast or slow",
        "a channel's stamps run at another rate", "a cheap oscillator, or a rate that is assumed",
        "the delay between channels grows", "stretch the stamps",
    ),
    Fault(
        "clock_jump", "a clock that jumps",
        "from some time on a channel's stamps are off", "the clock was set while the log ran",
        "the delay between channels changes at once", "shift the stamps after the jump",
    ),
    Fault(
        "clocks_disjoint", "clocks that do not overlap",
        "a channel, or a few samples of it, begins after another one has ended",
        "clocks with other zeros, files of different runs, or stamps that were written wrong",
        "no instant is in all channels, or in these samples and any other channel",
        "let the channels start together, then compare their motion; leave a few samples out",
        same=("epoch_stamps", "channel_of_another_run"),
    ),
    Fault(
        "stamp_jitter", "uneven stamps",
        "steps between samples vary by more than a quarter about even ones, or frames were not taken when their stamps "
        "say",
        "samples are stamped when they arrive",
        "the steps themselves; of a camera the wheels, which agree with even steps", "stamps at even steps",
        same=("bursts",), harmless=True,
    ),
    Fault(
        "bursts", "samples that come in bursts",
        "several samples have nearly the same stamp", "a link that buffers",
        "the steps themselves", "stamps at even steps", same=("stamp_jitter",), harmless=True,
    ),
    Fault(
        "rows_missing", "a gap",
        "no samples for a while", "a full buffer, a lost link", "the step itself",
        "cut the run in two there, if the gap is long; nothing is invented",
        harmless=True,
    ),
)
