"""Settings of the room, its ceiling camera and its scenery: Fig. 5.1, Table 5.1, section 5.4, (6.2)."""

from dataclasses import dataclass, field, make_dataclass

from drake_ispace.files.quantity import quantity
from drake_ispace.robots.library import robots
from drake_ispace.room.link import Link
from drake_ispace.room.localizer import Localizer


@dataclass
class Camera:
    """The Kinect's camera.

    The frames are those of Fig. 5.1: W of the space, G on the floor below the camera, and S at the camera with x along
    its line of sight, y left and z up. R_GS = R_z(yaw) R_y(pitch) R_x(roll), (5.1).
    """

    # columns and rows, Table 5.1
    size_pixels: list[int] = quantity([640, 480], "pixels", minimum=16, maximum=4096, length=2)
    # horizontal and vertical, Table 5.1
    view_angle_rad: list[float] = quantity([0.9948, 0.7505], "rad", above=0.0, below=3.0, length=2)
    # focal lengths along columns and rows; null: derived from the view angles, 589.4 and 609.3
    focal_pixels: list[float] | None = quantity(None, "pixels", above=0.0, length=2)
    # of the lens: k1, k2, p1, p2, k3 of OpenCV's model; assumed zero
    distortion: list[float] = quantity([0.0, 0.0, 0.0, 0.0, 0.0], length=5)
    # z_G of section 5.2. A positive pitch turns the camera down: the line of sight meets the floor 1.008 m ahead, where
    # the thesis prints x_G = 1.00 m
    height_m: float = quantity(2.78, "m", above=0.0)
    roll_rad: float = quantity(0.059, "rad", minimum=-1.5, maximum=1.5)
    pitch_rad: float = quantity(1.223, "rad", minimum=-1.6, maximum=1.6)
    yaw_rad: float = quantity(0.500, "rad", minimum=-7.0, maximum=7.0)
    # X_WG, not given in the thesis. Assumed: the camera looks along y of W, and its position shows as much of the space
    # as possible for markers up to 0.3 m above the floor
    foot_m: list[float] = quantity([0.04, -1.08], "m", length=2)
    foot_yaw_rad: float = quantity(1.0707963267948966, "rad", minimum=-7.0, maximum=7.0)
    # Table 5.1; 0: one image at the tick of each message
    frame_rate_hz: float = quantity(30.0, "Hz", minimum=0.0, maximum=200.0)
    # exposure time, during which a moving robot blurs; assumed
    exposure_s: float = quantity(0.008, "s", minimum=0.0, maximum=0.03)


@dataclass
class _MarkersOfAll:
    """The markers on top of each robot: a dark plate with a front and a rear square in two colours. Assumed."""

    # sides of the square plate and of the square markers
    plate_m: float = quantity(0.30, "m", above=0.0, maximum=1.0)
    side_m: float = quantity(0.09, "m", above=0.0, maximum=0.5)
    # a blob whose area differs from a marker's by more than this share is rejected: hidden, cut off or no marker
    area_tolerance: float = quantity(0.13, above=0.0, below=1.0)
    # allowed error of the distance between the two markers: that of a top tilted by 4 degrees is off by 12 mm
    spacing_tolerance_m: float = quantity(0.012, "m", above=0.0, maximum=0.1)


#: The markers of all robots. The field `{name}_height_m` is the height of that robot's plate above the floor [m].
Markers = make_dataclass("Markers", [
    (f"{robot.name}_height_m", float, quantity(robot.marker_height_m, "m", above=0.0, maximum=1.0))
    for robot in robots().values()
], bases=(_MarkersOfAll,))
Markers.__module__ = __name__  # for pickle


@dataclass
class Scenery:
    """Appearance of the rendered room. Assumed."""

    # opencv: ray casting in NumPy and OpenCV; vtk: Drake's RgbdSensor, needs libEGL
    renderer: str = quantity("opencv", choices=("opencv", "vtk"))
    # standard deviation of the carpet's brightness, in grey levels of 255
    carpet_contrast: float = quantity(8.0, "grey levels", minimum=0.0, maximum=100.0)
    # change of the light from one end of the space's width to the other
    light_gradient: float = quantity(0.3, minimum=0.0, maximum=1.9)
    # share of the light that a shadow takes away
    shadow: float = quantity(0.35, minimum=0.0, maximum=1.0)
    # standard deviation of the noise of every pixel and colour in the dark
    noise_grey_levels: float = quantity(2.0, "grey levels", minimum=0.0, maximum=100.0)
    # and what comes to it in full light; its square grows with the light. Together 2.9 in middle grey
    light_noise_grey_levels: float = quantity(3.0, "grey levels", minimum=0.0, maximum=100.0)
    # whether each pixel sees one colour only, and the others are interpolated
    bayer: bool = quantity(False)
    # of the JPEG that the camera sends, as OpenCV counts it; null: pictures come as they are
    jpeg_quality: int | None = quantity(None, minimum=1, maximum=100)
    # standard deviation of the measured depth at 1 m; it grows with the square of the depth
    depth_noise_m: float = quantity(0.0012, "m", minimum=0.0, maximum=0.1)
    # boxes: x, y [m], yaw [rad], length, width, height [m] of each
    obstacles: list[list[float]] = quantity([], "m")


@dataclass
class Space:
    """The intelligent space.

    Frame W lies on the floor in the middle of the space, with x along its width and z up. This origin is assumed,
    because the thesis does not state the origin of its top view.
    """

    # 513 pixels of 4.87 mm, section 5.4
    width_m: float = quantity(2.5, "m", above=0.0)
    # 363 pixels of 5.51 mm
    depth_m: float = quantity(2.0, "m", above=0.0)
    localizer: Localizer = field(default_factory=Localizer)
    # camera, markers and scenery are used by the image mode only
    camera: Camera = field(default_factory=Camera)
    markers: Markers = field(default_factory=Markers)
    scenery: Scenery = field(default_factory=Scenery)
    link: Link = field(default_factory=Link)
