"""In the wire `wheel_angle`, between wheel and encoder: what the encoder counts is not how far the wheel has turned.

The encoder's count and the velocity made from it are wrong alike; `encoder.velocity: exact` reads the plant's own wheel
rate and stays right.
"""

import numpy as np

from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.places.shaping import one_wheel
from drake_ispace.effects.wires import WheelAngleEffect


@kernel
def scaled(wheel_angle, gain, out):
    for i in range(out.shape[0]):
        out[i] = gain[i] * wheel_angle[i]


class EncoderScale(WheelAngleEffect):
    """(1 + share) theta, all wheels."""

    card = Card(
        name="encoder_scale", title="Encoder scale", home="encoder", equation="theta_measured = (1 + share) theta",
        source="counts per turn or gear ratio other than assumed",
        signature="odometry and wheel speed too large by one share in every direction and in turning; the room sees "
        "the robot go the shorter way, and feedback of the wheel speed damps more",
        look_alikes=("wheel_radius_error", "constant_slip", "camera_scale", "single_wheel_radius_error"),
        excitation="acceleration beside driving and turning: a wrong radius also changes what force a torque gives, a "
        "wrong scale of the encoder does not; turning apart from driving, because camera_scale leaves headings alone",
        same="wheels of another size that the robot's own controller knows, and the model does not, look the same: "
        "measure one, or turn it by hand and count",
    )
    parameters = (Parameter("share", "1", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=1e-3, sensible=(-0.2, 0.2)),)
    output = scaled
    scales = True

    def block_parameters(self, body, values):
        return {"gain": np.full(body.wheels, 1.0 + values["share"])}


class EncoderLostCounts(WheelAngleEffect):
    """(1 - share) theta of one wheel: of the counts of any turn, to and fro, that share goes missing, or comes twice
    where it is below zero."""

    choices = ("wheel",)
    card = Card(
        name="encoder_lost_counts", title="Encoder loses counts", home="encoder",
        equation="theta_measured_i = (1 - share) theta_i for i = wheel",
        source="dirt on one code disc, a loose plug, an interrupt that comes too late; too many counts (a share below "
        "zero): edges that bounce, or a disc with more lines than the others",
        signature="one wheel seems to turn less, or more, than the room's pose asks of it; odometry turns where the "
        "robot goes straight, in proportion to the way and with its sign",
        look_alikes=("single_wheel_radius_error", "encoder_scale", "weak_motor", "track_error"),
        excitation="straight lines in several directions, forward and back, and acceleration: one wheel's radius also "
        "changes the force that its torque gives",
    )
    parameters = (Parameter("share", "1", 0.0, -0.5, 0.5, (0.02, 0.1), tolerance=5e-4),)
    output = scaled
    scales = True

    def block_parameters(self, body, values):
        return {"gain": one_wheel(body, values, 1.0 - values["share"])}

    def scattered(self, angles, values, count_rad, generator):
        """Which counts go missing, or come twice, is chance: each with the probability |share|."""
        moved, wheel, share = angles.copy(), int(values["wheel"]) - 1, values["share"]
        counted = np.abs(np.diff(angles[:, wheel], prepend=angles[0, wheel])) / (1.0 - share)
        variance = abs(share) * (1.0 - abs(share)) * count_rad * counted
        jumps = generator.standard_normal(len(angles)) * np.sqrt(variance)
        moved[:, wheel] += np.cumsum(jumps)
        return moved


@kernel
def eccentric(wheel_angle, sines_rad, cosines_rad, out):
    for i in range(out.shape[0]):
        out[i] = angle = wheel_angle[i]
        if sines_rad[i] != 0.0 or cosines_rad[i] != 0.0:
            out[i] = angle + sines_rad[i] * sin(angle) + cosines_rad[i] * (cos(angle) - 1.0)


class EncoderEccentricity(WheelAngleEffect):
    """theta + s sin(theta) + c (cos(theta) - 1) of one wheel: an error that comes again with every turn."""

    general = False
    kinematic = False
    choices = ("wheel",)
    card = Card(
        name="encoder_eccentricity", title="Eccentric encoder or wheel", home="encoder",
        equation="theta_measured_i = theta_i + s sin(theta_i) + c (cos(theta_i) - 1) for i = wheel",
        source="a code disc or magnet that sits beside the axle; a wheel that does, or is no circle, looks the same",
        signature="one wheel seems to speed up and slow down once a turn; no error is left after whole turns",
        look_alikes=("encoder_lost_counts", "single_wheel_friction", "transmission_backlash"),
        excitation="many whole turns at several speeds: the error goes with the wheel's angle, friction and lost "
        "counts with its direction and its way",
    )
    parameters = tuple(
        Parameter(f"{name}_rad", "rad", 0.0, -1.0, 1.0, (0.01, 0.1), tolerance=2e-3) for name in ("sine", "cosine")
    )
    output = eccentric

    def block_parameters(self, body, values):
        return {
            "sines_rad": one_wheel(body, values, values["sine_rad"], 0.0),
            "cosines_rad": one_wheel(body, values, values["cosine_rad"], 0.0),
        }


EFFECTS = (EncoderEccentricity(), EncoderScale(), EncoderLostCounts())
