"""The robot's own numbers, other than controller and odometry believe."""

from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import PlantEffect


class NumberError(PlantEffect):
    """A number of the plant times (1 + share): the one that `needs` names.

    low, high: what a fit may try. sensible: beyond it a fit is not named.
    """

    low, high = -0.6, 1.0  # a robot on four tyres turns as if its track were twice as wide
    sensible = (-0.15, 0.15)

    def parameters_of(self, body):
        number = body.robot.numbers[self.needs[0]]
        sizes = {"tolerance": number.tolerance, "sensible": self.sensible}
        return (Parameter("share", "1", 0.0, self.low, self.high, number.probes, **sizes),)

    def called(self, body):
        return body.robot.called(body.plant, self.needs[0])

    def change(self, robot, plant, values):
        return robot.scaled(plant, self.needs[0], values["share"])


class MassError(NumberError):
    """The body's mass times (1 + share): mass_kg of the omni robot, body_mass_kg of the pendulum."""

    needs = ("mass",)
    low, high = -0.6, 1.5
    sensible = low, high
    card = Card(
        name="mass_error", title="Mass error", home="plant", equation="m = (1 + share) m_nominal",
        source="payload, battery, cables",
        signature="an unmodelled force against acceleration, none against turning; the pendulum falls faster as well",
        look_alikes=("torque_gain_error", "inertia_error", "drive_inertia", "centre_of_gravity_offset"),
        excitation="straight acceleration and turning, both: a wrong torque gain shows in either",
    )


class InertiaError(NumberError):
    """The omni robot's yaw inertia, the pendulum's pitch inertia I_yy (both about the centre of gravity)."""

    needs = ("inertia",)
    low, high = -0.8, 3.0
    sensible = low, high
    card = Card(
        name="inertia_error", title="Inertia error", home="plant",
        equation="I = (1 + share) I_nominal, omni: yaw, pendulum: I_yy",
        source="how the payload is spread; Table 2.2 prints a yaw inertia that no such robot has",
        signature="an unmodelled moment against angular acceleration (omni: yaw, pendulum: pitch), none at rest",
        look_alikes=(
            "torque_gain_error", "turn_scrub", "mass_error", "drive_inertia", "track_error", "centre_of_gravity_offset",
        ),
        excitation="omni: quick changes of the yaw rate, with straight acceleration to exclude the torque gain; "
        "pendulum: fast rocking. Its I_yy is small beside m_b z^2, so only large shares show",
    )


class YawInertiaError(NumberError):
    """The pendulum's I_zz and I_xx, upright and lying, times (1 + share)."""

    needs = ("yaw_inertia",)
    low, high = -0.8, 3.0
    sensible = low, high
    card = Card(
        name="yaw_inertia_error", title="Yaw inertia error", home="plant",
        equation="I_zz, I_xx = (1 + share) nominal", source="width and payload of the body; I_xx is assumed anyway",
        signature="an unmodelled moment against yaw acceleration, none at steady turning",
        look_alikes=("turn_scrub", "track_error", "drive_inertia", "torque_gain_error"),
        excitation="quick changes of the yaw rate both ways: scrub keeps its size, inertia goes with the acceleration",
    )


class DriveInertia(PlantEffect):
    """Further inertia of what turns with each wheel against the body, such as gears and rotor, seen at the wheel."""

    needs = ("drive_inertia",)
    card = Card(
        name="drive_inertia", title="Inertia of gears and rotors", home="plant",
        equation="J more at each wheel: a torque J d(w)/dt, w the wheel's rate against the body; a rotor behind a gear "
        "of n counts n^2 times",
        source="the rotors of small geared motors, which many models leave out or take from another data sheet",
        signature="a torque against every wheel's acceleration, none at constant speed; the pendulum's body is pushed "
        "back by less than the wheels' torque when they speed up",
        look_alikes=("mass_error", "inertia_error", "yaw_inertia_error", "torque_gain_error"),
        excitation="quick changes of speed and of the yaw rate, and steady driving: a wrong torque gain shows in "
        "steady friction as well; mass and inertia alone have another share in turning",
    )

    def parameters_of(self, body):
        inertia, of_mass = body.robot.drive_inertia(body.plant)
        probes = (0.05 * of_mass, 0.3 * of_mass)
        low = -inertia if inertia > probes[0] else 0.0  # there is next to nothing to be taken away
        return (Parameter("inertia_kg_m2", "kg*m^2", 0.0, low, 3.0 * of_mass, probes, tolerance=0.005 * of_mass),)

    def change(self, robot, plant, values):
        return robot.geared(plant, values["inertia_kg_m2"])


class CentreOfGravityOffset(PlantEffect):
    """Omni: the centre of gravity beside the middle by x_m, y_m in B. Pendulum: higher above the axle by height_m."""

    needs = ("centre_of_gravity",)
    card = Card(
        name="centre_of_gravity_offset", title="Centre of gravity offset", home="plant",
        equation="omni: c = c_nominal + (x_m, y_m); pendulum: z = z_nominal + height_m",
        source="payload off the middle; (2.3)",
        signature="omni: a yaw moment in step with translational acceleration, a force in step with wz^2 and with yaw "
        "acceleration; pendulum: it falls faster or slower than expected, the drive moves the tilt more or less",
        look_alikes=("mass_error", "inertia_error", "weak_motor", "floor_tilt"),
        excitation="omni: acceleration along x and y without turning, then turning fast on the spot; pendulum: slow "
        "and fast rocking, since mass and height part only through the inertia m_b z^2",
    )

    def parameters_of(self, body):
        return tuple(
            Parameter(c.name, "m", 0.0, c.low, c.high, c.probes, tolerance=c.tolerance)
            for c in body.robot.centre_of_gravity(body.plant)
        )

    def change(self, robot, plant, values):
        return robot.off_centre(plant, values)


class WheelRadiusError(NumberError):
    """All true radii times (1 + share); odometry and controller keep the nominal one."""

    needs = ("radius",)
    kinematic = True
    card = Card(
        name="wheel_radius_error", title="Wheel radius error", home="plant", equation="r = (1 + share) r_nominal",
        source="wear, pressure, soft tyres, caliper",
        signature="the camera's displacement and angle turned are both (1 + share) times odometry's; forces are 1/(1 + "
        "share) of those expected",
        look_alikes=("encoder_scale", "camera_scale", "constant_slip", "track_error", "torque_gain_error"),
        excitation="straight driving and turning, both: slip and camera scale leave the heading alone, a track error "
        "changes it only. A wrong encoder scale leaves the forces alone, so accelerate too",
    )


class SingleWheelRadiusError(PlantEffect):
    """The true radius of one wheel times (1 + share)."""

    needs = ("radius",)
    choices = ("wheel",)
    kinematic = True
    card = Card(
        name="single_wheel_radius_error", title="Radius error of one wheel", home="plant",
        equation="r_i = (1 + share) r_nominal for one wheel i", source="wear of one wheel, a mounted spare",
        signature="odometry's heading drifts in proportion to that wheel's travel; straight lines bend",
        look_alikes=("encoder_lost_counts", "weak_motor", "track_error", "gyro_scale"),
        excitation="straight driving along x and y both ways, and turning: a track error shows while turning only; "
        "lost counts leave the forces alone and a weak motor the odometry",
    )
    parameters = (Parameter("share", "1", 0.0, -0.3, 0.3, (0.01, 0.05), tolerance=1e-3, sensible=(-0.15, 0.15)),)

    def change(self, robot, plant, values):
        return robot.worn(plant, values["share"], [int(values["wheel"]) - 1])


class WheelRadiusErrors(PlantEffect):
    """The true radius of every wheel i times (1 + share_i), each with its own share."""

    needs = ("radius", "velocity")
    card = Card(
        name="wheel_radius_errors", title="Radius errors of all wheels", home="plant",
        equation="r_i = (1 + share_i) r_nominal for every wheel i",
        source="wear, pressure and load that differ from wheel to wheel; UMBmark's unequal diameters",
        signature="odometry's heading drifts with the way, to the same side whichever way the path bends, and all "
        "distances are off by the mean share",
        look_alikes=("wheel_radius_error", "single_wheel_radius_error", "track_error", "encoder_lost_counts"),
        excitation="long runs round both ways: a wrong track turns its sign with the bend, a wheel's radius does not",
    )

    def parameters_of(self, body):
        return tuple(
            Parameter(f"share_{i}", "1", 0.0, -0.3, 0.3, (0.01, 0.05), tolerance=1e-3, sensible=(-0.15, 0.15))
            for i in range(1, body.wheels + 1)
        )

    def change(self, robot, plant, values):
        for i in range(len(plant.geometry.wheels)):
            plant = robot.worn(plant, values[f"share_{i + 1}"], [i])
        return plant


class TrackError(NumberError):
    """The true distance of the wheels times (1 + share); odometry and controller keep the nominal one."""

    needs = ("track",)
    kinematic = True
    card = Card(
        name="track_error", title="Track error", home="plant",
        equation="b = (1 + share) b_nominal, omni: wheel to wheel, pendulum: half track",
        source="where a wide tyre or roller touches the floor; UMBmark's wheelbase error",
        signature="the camera's heading turns 1/(1 + share) of odometry's, displacement on straight lines agrees",
        look_alikes=("inertia_error", "yaw_inertia_error", "gyro_scale", "wheel_radius_error", "turn_scrub"),
        excitation="turning both ways over large angles, and a straight line to exclude the radius",
    )


class WheelToe(PlantEffect):
    """The drive direction of one wheel with rollers, turned anticlockwise by an angle."""

    needs = ("toe",)
    choices = ("wheel",)
    kinematic = True
    card = Card(
        name="wheel_toe", title="Toe of one wheel", home="plant",
        equation="theta_dot_i = (v + wz x p_i) . (cos(hold_i + angle), sin(hold_i + angle)) / (r cos(roller_i)) for "
        "one wheel i, hold_i = drive_i + roller_i",
        source="a bracket mounted askew, a bent axle",
        signature="moving along the axle of an omni wheel turns it: odometry turns and drifts while the robot moves "
        "straight that way, by the angle times the way",
        look_alikes=(
            "single_wheel_radius_error", "wheel_radius_errors", "encoder_lost_counts", "centre_of_gravity_offset",
            "marker_offset", "constant_slip",
        ),
        excitation="straight driving along every wheel's axle, both ways: a wheel of another size shows along its "
        "drive direction, a toe across it; a turned camera leaves the heading's course alone",
    )
    parameters = (Parameter("angle_rad", "rad", 0.0, -0.3, 0.3, (0.01, 0.05), tolerance=2e-3),)

    def applies_to(self, body):
        """Whether wheels turned apart leave the robot a direction to move in: tyres hold it sideways."""
        return super().applies_to(body) and not body.plant.geometry.holds_sideways

    def change(self, robot, plant, values):
        return robot.toed(plant, values["angle_rad"], int(values["wheel"]) - 1)


EFFECTS = (
    MassError(), InertiaError(), YawInertiaError(), DriveInertia(), CentreOfGravityOffset(), WheelRadiusError(),
    SingleWheelRadiusError(), WheelRadiusErrors(), TrackError(), WheelToe(),
)
