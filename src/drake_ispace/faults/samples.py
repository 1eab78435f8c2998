"""Faults of samples: counters that wrap, channels that stop, clip or repeat."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "counter_wrap", "a counter that starts anew",
        "an angle falls back by the range of its counter", "a counter of n bits",
        "steps of one height against the motion", "continue the angle", same=("angle_wrap",),
    ),
    Fault(
        "angle_wrap", "an angle that starts anew with every turn",
        "an angle falls back by a turn", "an absolute encoder, or an angle that was wrapped",
        "steps of a turn against the motion", "continue the angle", same=("counter_wrap",),
    ),
    Fault(
        "channel_dead", "a column that never changes",
        "a column holds one value", "a cable, or a field that nobody fills",
        "the other channels say that it should change", "leave the channel out", same=("channel_frozen",),
    ),
    Fault(
        "channel_frozen", "a channel that stops for a while",
        "rows repeat, then the channel goes on where it should be", "a driver that hangs",
        "the other channels move meanwhile", "cut the stretch out",
        same=("rows_missing", "robot_carried"), harmless=True,
    ),
    Fault(
        "samples_held", "samples that are held until the next one",
        "a sample comes again under later stamps", "a table with a row for every sample of a faster channel",
        "after samples that are the same to the last digit the channel catches up", "leave the later ones out",
        same=("channel_frozen",), harmless=True,
    ),
    Fault(
        "samples_interpolated", "samples that are interpolated between others",
        "samples lie on straight lines from one measured sample to the next",
        "a table with a row for every sample of a faster channel, or a program that puts all channels on one clock",
        "straight lines that bend every few rows", "leave out all but the samples at the bends", harmless=True,
    ),
    Fault(
        "samples_smoothed", "samples that are smoothed",
        "the noise of a sample is alike in those after it", "a program that filters what the camera measured",
        "beside the wheels' motion it changes the more the further two samples are apart, up to a few",
        "leave out all but samples that far apart", harmless=True,
    ),
    Fault(
        "channel_clipped", "values that end at a limit",
        "a column never passes a value, which it takes often", "the range of a converter",
        "many samples at the very same extreme", "record it again with a larger range", effects=("torque_saturation",),
        harmless=True,
    ),
    Fault(
        "channel_quantised", "values in coarse steps",
        "a column takes few values", "rounding in the logger", "the steps between values",
        "record it again with more digits", harmless=True,
    ),
    Fault(
        "rows_duplicated", "rows that come twice",
        "a stretch of rows comes again", "a file that was stitched together",
        "the same digits twice", "leave the second out", harmless=True,
    ),
    Fault(
        "counter_reset", "a counter that is set anew",
        "angles of the wheels jump to other numbers, and go on from there",
        "a driver that starts anew while the log runs, or a counter that wraps",
        "an angle leaps between two rows, far beyond any other step; or all turn fast, and the robot does not",
        "cut the run in two there", same=("counter_wrap", "rows_missing"), harmless=True,
    ),
    Fault(
        "rows_reversed", "rows in the opposite order",
        "a stretch runs backwards", "a buffer that is read from the wrong end",
        "two steps that vanish together", "turn the stretch round", harmless=True,
    ),
    Fault(
        "command_sampled", "a setpoint that moves on between its samples",
        "the log shows the commanded velocity at some instants only",
        "the setpoint is computed faster than it is logged",
        "the wheels lead the command by about half a sample", "a smooth curve through the samples",
        same=("clock_offset",), harmless=True,
    ),
    Fault(
        "command_moments", "changes of a command between its samples",
        "the log shows each change of the command up to a sample late",
        "the command changes at any moment, and is logged at fixed ones",
        "moments at which the wheels answer, which lie within one step", "each change at its own moment",
        same=("clock_offset",), harmless=True,
    ),
    Fault(
        "undersampled", "a channel that is logged more rarely than the controller uses it",
        "the log has one of several torques that were set, or of several IMU samples that were read",
        "the logger is slower than the controller",
        "the steps between samples, which are longer than the model's controller takes",
        "leave the channel out, or record it again at every step of the controller", same=("rows_missing",),
        doubtful=True,
    ),
    Fault(
        "steps_missing", "steps of the controller without a sample",
        "torque or IMU is not known at some of the controller's steps",
        "a link that loses rows, a clock of the logger that is a little slow, or a table that holds samples",
        "the steps between samples, or samples that repeat",
        "none; nothing is invented", same=("rows_missing", "samples_held"), harmless=True, doubtful=True,
    ),
)
