"""The camera as geometry: rays of pixels, and projection.

Frames as in Fig. 5.1: W in the middle of the space on its floor, z up; G on the floor below the camera; G1 at the
camera, parallel to G; S at the camera, x along the view, y left, z up; S1 where the view meets the floor. Pixels count
u to the right and v downward, (0, 0) is the middle of the first pixel.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Camera

#: Rows: S's left-handed neighbours in OpenCV's camera frame C (x right, y down, z along the view). p_C = R_CS p_S.
R_CS = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def rotation_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_gs(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """R_G1S = R_z(yaw) R_y(pitch) R_x(roll) of (5.1), angles in rad."""
    return rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)


@dataclass(frozen=True)
class View:
    """A camera with its place in W.

    Attributes:
        size: (columns, rows).
        matrix: (3, 3) pinhole matrix, focal lengths and centre in pixels.
        distortion: (5,) k1, k2, p1, p2, k3 of OpenCV's model.
        r_ws: (3, 3) R_WS; p_ws: (3,) the camera's place in W [m].
    """

    size: tuple[int, int]
    matrix: np.ndarray
    distortion: np.ndarray
    r_ws: np.ndarray
    p_ws: np.ndarray

    def project(self, points) -> np.ndarray:
        """(n, 2) pixels of (n, 3) points in W [m]; NaN for points not in front of the camera."""
        p_c = (np.asarray(points, dtype=float).reshape(-1, 3) - self.p_ws) @ (R_CS @ self.r_ws.T).T
        pixels = np.full((len(p_c), 2), np.nan)
        ahead = p_c[:, 2] > 1e-6
        if ahead.any():
            none = np.zeros(3)
            pixels[ahead] = cv2.projectPoints(p_c[ahead], none, none, self.matrix, self.distortion)[0].reshape(-1, 2)
        return pixels

    def rays(self, pixels) -> np.ndarray:
        """(n, 3) directions in W of (n, 2) pixels, one metre long along the view: times z-depth they give points."""
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 2)
        if self.distortion.any():
            plane = cv2.undistortPoints(pixels[:, None], self.matrix, self.distortion).reshape(-1, 2)
        else:
            plane = (pixels - self.matrix[:2, 2]) / self.matrix[[0, 1], [0, 1]]
        return np.column_stack([np.ones(len(plane)), -plane]) @ self.r_ws.T

    def pixel_grid(self, offset=(0.0, 0.0)) -> np.ndarray:
        """(rows * columns, 2) all pixels, row by row, shifted by `offset`."""
        columns, rows = self.size
        u, v = np.meshgrid(np.arange(columns) + offset[0], np.arange(rows) + offset[1])
        return np.column_stack([u.ravel(), v.ravel()])


def camera_matrix(camera: Camera) -> np.ndarray:
    """(3, 3) pinhole matrix: f = P / (2 tan(angle / 2)) of Table 5.1, the centre in the middle of the image."""
    size = np.array(camera.size_pixels)
    focal = camera.focal_pixels or size / 2.0 / np.tan(np.array(camera.view_angle_rad) / 2.0)
    centre = (size - 1) / 2.0
    return np.array([[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]])


def view_of(camera: Camera) -> View:
    """The View of a camera section.

    Raises:
        InputError: a camera that does not look down on the floor.
    """
    r_gs = rotation_gs(camera.roll_rad, camera.pitch_rad, camera.yaw_rad)
    if r_gs[2, 0] > -0.05:
        raise InputError(
            f"space.camera.pitch_rad: at {camera.pitch_rad:g} rad the camera does not look down on the floor, expected "
            "0.05 to 1.57"
        )
    return View(
        tuple(camera.size_pixels), camera_matrix(camera), np.array(camera.distortion),
        rotation_z(camera.foot_yaw_rad) @ r_gs, np.array([*camera.foot_m, camera.height_m]),
    )
