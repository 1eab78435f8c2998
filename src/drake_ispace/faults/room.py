"""Faults of the camera: axes, headings, and fixes that are off."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "camera_axes_swapped", "x and y of the room change places",
        "the columns x and y change places, headings stay", "rows and columns of the image are mixed up",
        "the robot seems to move across its heading", "exchange the columns", same=("camera_axis_mirrored",),
    ),
    Fault(
        "camera_axis_mirrored", "an axis of the room is mirrored",
        "x or y has the other sign, with or without the heading", "image rows count downwards",
        "turns and sideways motion have the other sense", "change the sign of the column",
        same=("camera_axes_swapped", "wheels_swapped", "heading_sign"),
    ),
    Fault(
        "heading_sign", "headings of the other sense",
        "phi has the other sign, or counts from another axis", "a compass counts clockwise",
        "the camera sees the opposite turn", "change the sign of the column", same=("camera_axis_mirrored",),
    ),
    Fault(
        "heading_offset", "headings off by an angle",
        "phi is off by 90 or 180 degrees, always or for a while, or by any angle, or the axes of the room are turned",
        "the marker is fitted turned or looks the same turned, or x points elsewhere in the camera's software",
        "the robot seems to move across or against its heading", "add the angle",
        same=("camera_turned", "wheels_swapped", "wheel_order", "encoder_sign", "wheel_angles"),
    ),
    Fault(
        "heading_is_course", "headings that are directions of motion",
        "phi says where the place moves to, not where the robot points to",
        "a tracker without a heading, and a program that makes one of its places",
        "phi has all noise of the directions from fix to fix, or over a few of them",
        "record the heading, or leave the camera out",
    ),
    Fault(
        "camera_is_odometry", "poses that were computed from the wheels",
        "the poses are those of dead reckoning, and no camera's",
        "odometry was recorded, or exported, in the camera's place",
        "between two fixes the poses know the wheels' angles better than to a count",
        "record something that does not know the wheels, or leave the poses out",
    ),
    Fault(
        "camera_turned", "the axes of the room are turned by a quarter or a half",
        "x and y are turned, headings are not", "x points elsewhere in the camera's software",
        "the robot seems to move across or against its heading", "turn the places, or the headings",
        same=("heading_offset",),
    ),
    Fault(
        "camera_jump", "the place jumps",
        "from one fix to the next the place is elsewhere, and stays so",
        "the camera was moved, calibrated anew, or mistook the robot", "no wheel shows the motion",
        "cut the run in two there", same=("robot_carried",), harmless=True,
    ),
    Fault(
        "camera_outliers", "fixes that are off",
        "places or headings of single fixes are far from their neighbours'", "a reflection, or another marker",
        "the place or the heading jumps away and back", "leave the fixes out", harmless=True,
    ),
)
