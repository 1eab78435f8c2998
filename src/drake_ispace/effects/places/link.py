"""In the wire `fix`, between the room and the robot."""

import math

from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import FixEffect

_LARGEST_S = 0.15
#: How much older than its age a fix can look, in ticks.
CLOCK_TICKS = math.ceil(_LARGEST_S / TICK_S)


@kernel
def stamped(fix, offset_ticks, out):
    """Another stamp for a message in which the robot is seen; before the robot's tick 0 there is none."""
    copy(fix, out)
    if fix[FIX.seen] > 0.0:
        out[FIX.tick] = max(fix[FIX.tick] + offset_ticks, 0.0)


class ClockOffset(FixEffect):
    """The stamp of a fix is off by a constant, rounded to whole ticks, in which the robot keeps its odometry."""

    card = Card(
        name="clock_offset", title="Clock offset", home="link", equation="t_stamp = t_captured + offset",
        source="the clocks of room and robot, set by hand or by a message of unknown delay",
        signature="the room's pose is that of another instant: an error along the motion in proportion to the speed, "
        "ahead of the robot for a clock that is behind (offset < 0), and of the heading in proportion to the yaw rate",
        look_alikes=("camera_latency", "marker_offset", "camera_offset", "command_delay"),
        excitation="several speeds, both ways, and turning: the error changes its sign with the motion, that of an "
        "offset on the robot turns with the heading; a positive offset and a latency differ in the delay of "
        "feedback alone",
    )
    parameters = (Parameter("offset_s", "s", 0.0, -_LARGEST_S, _LARGEST_S, (0.003, -0.02, 0.02), tolerance=1e-3),)
    output = stamped

    def block_parameters(self, body, values):
        return {"offset_ticks": float(round(values["offset_s"] / TICK_S))}


EFFECTS = (ClockOffset(),)
