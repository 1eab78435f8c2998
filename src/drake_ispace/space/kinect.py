"""The room and its ceiling camera: Table 5.1, section 5.4, (6.2)."""

from dataclasses import dataclass, field

from drake_ispace.quantity import quantity


@dataclass
class Localizer:
    """How the room's camera sees a robot's two markers."""

    # geometric: the true pose through the camera's ground resolution
    mode: str = quantity("geometric", choices=("geometric",))
    # metres per pixel of the top view along x and y, section 5.4
    pixel_m: list[float] = quantity([0.00487, 0.00551], "m/pixel", above=0.0, length=2)
    # a marker is found at a whole pixel
    whole_pixels: bool = quantity(True)
    # of a marker's place, before rounding; assumed
    noise_std_pixels: float = quantity(0.3, "pixels", minimum=0.0)
    # between a robot's front and rear marker; assumed
    marker_spacing_m: float = quantity(0.2, "m", above=0.0)
    # from capture to the room's computer
    latency_ticks: int = quantity(0, "ticks of 5 ms", minimum=0, maximum=2000)
    # share of captures in which a robot is not found
    dropout: float = quantity(0.0, minimum=0.0, maximum=1.0)


@dataclass
class Link:
    """The serial radio link from the room to a robot (RS-232 in the thesis)."""

    # bit rate of the line, 10 bits a byte; 0: no delay
    baud_rate: int = quantity(0, "bit/s", minimum=0)
    # further delay of the radio
    delay_ticks: int = quantity(0, "ticks of 5 ms", minimum=0, maximum=2000)
    # share of frames that never arrive
    loss: float = quantity(0.0, minimum=0.0, maximum=1.0)
    # share of frames that arrive damaged: the checksum finds them, they are dropped
    corruption: float = quantity(0.0, minimum=0.0, maximum=1.0)


@dataclass
class Space:
    """The intelligent space. Frame W lies on the floor in the middle of the space, x along its width, z up (assumed:
    the thesis leaves the origin of its top view open)."""

    # 513 pixels of 4.87 mm, section 5.4
    width_m: float = quantity(2.5, "m", above=0.0)
    # 363 pixels of 5.51 mm
    depth_m: float = quantity(2.0, "m", above=0.0)
    localizer: Localizer = field(default_factory=Localizer)
    link: Link = field(default_factory=Link)
