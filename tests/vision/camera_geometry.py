"""A camera's geometry as only tests need it: back to a plane, and (5.3)-(5.6) as they are printed."""

import numpy as np

from drake_ispace.room.room import Camera
from drake_ispace.vision.optics.camera import View, rotation_gs


def to_plane(view: View, pixels, height_m=0.0):
    """(n, 2) x, y in W [m] where the rays of (n, 2) pixels meet the plane z = height_m; NaN where they do not."""
    rays = view.rays(pixels)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = (height_m - view.p_ws[2]) / rays[:, 2]
        return np.where((z > 0.0)[:, None], view.p_ws[:2] + z[:, None] * rays[:, :2], np.nan)


def printed_vectors(camera: Camera, pixels, range_m, *, yaw_from_pitch=False):
    """(n, 3) d of (5.3)-(5.6) in G1 [m], as printed: each pixel's angles are added to those of the camera.

    Args:
        pixels: (n, 2), v downward; the printed sign of (5.3) wants rows that count upward, so they are turned.
        range_m: (n,) D_x, the distance along the ray.
        yaw_from_pitch: (5.4) starts from alpha, a slip for gamma.
    """
    pixels = np.asarray(pixels, dtype=float).reshape(-1, 2)
    columns, rows = camera.size_pixels
    pitch = camera.pitch_rad + camera.view_angle_rad[1] * (rows / 2.0 - (rows - 0.5 - pixels[:, 1])) / rows
    start = camera.pitch_rad if yaw_from_pitch else camera.yaw_rad
    yaw = start + camera.view_angle_rad[0] * (columns / 2.0 - (pixels[:, 0] + 0.5)) / columns
    distance = np.broadcast_to(range_m, len(pixels))
    return np.array([
        rotation_gs(camera.roll_rad, a, g) @ [d, 0.0, 0.0] for a, g, d in zip(pitch, yaw, distance, strict=True)
    ])
