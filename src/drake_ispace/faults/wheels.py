"""Faults of wheels and their drive: sense of rotation and order of the columns."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "wheel_sign", "a wheel counts backwards",
        "one wheel's angle, or some wheels', has the other sign",
        "motors are mounted face to face and only one is reversed in software",
        "the wheels say a motion that the camera does not see", "change the sign of the column",
    ),
    Fault(
        "encoder_sign", "all wheels count backwards",
        "every wheel's angle has the other sign", "another convention of the sense of rotation",
        "the camera sees the opposite motion", "change the sign of the columns", same=("heading_offset",),
    ),
    Fault(
        "wheels_swapped", "wheels in another order",
        "columns of the encoder belong to other wheels", "left before right, or another first wheel",
        "the wheels say a motion that the camera does not see", "put the columns in order",
        same=("wheel_order", "camera_axis_mirrored", "heading_offset", "camera_turned"),
    ),
    Fault(
        "torque_sign", "torques of the other sense",
        "the torque of a wheel, or of all, has the other sign", "current is measured on the other lead",
        "wheels accelerate against their torque", "change the sign of the columns",
    ),
    Fault(
        "torques_swapped", "torques in another order",
        "columns of the torque belong to other wheels", "left before right, or another first wheel",
        "wheels do not accelerate with their torque", "put the columns in order",
    ),
    Fault(
        "command_sign", "commands of the other sense",
        "vx, vy or wz has the other sign", "another convention of axes",
        "the robot moves against its command", "change the sign of the column",
    ),
    Fault(
        "command_axes_swapped", "vx and vy change places",
        "the columns of the command change places", "another convention of axes",
        "the robot moves across its command", "exchange the columns",
    ),
    Fault(
        "command_in_room_frame", "vx and vy along the axes of the room",
        "vx and vy are along the axes of the room, not along those of the robot",
        "a planner's velocity is logged before it is turned into the robot's frame",
        "the robot moves across or against its command, by its heading at each moment",
        "turn vx and vy by the headings of the camera", same=("command_sign", "command_axes_swapped"),
    ),
)
