"""The camera's place from points on the floor whose pixels are known: clicked, measured, or the trapezoid's corners."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.room.room import Camera
from drake_ispace.vision.camera import R_CS, camera_matrix
from drake_ispace.vision.top_view import CORNERS

_WORST_PIXELS = 25.0


@dataclass(frozen=True)
class Calibration:
    """camera: with the place found; residual_pixels: (n,) from each given pixel to where its point is projected."""

    camera: Camera
    residual_pixels: np.ndarray

    def to_data(self) -> dict:
        """The scenario's camera section: what a YAML file holds under `space:`."""
        c = self.camera
        section = {
            "size_pixels": list(c.size_pixels), "height_m": c.height_m, "roll_rad": c.roll_rad,
            "pitch_rad": c.pitch_rad, "yaw_rad": c.yaw_rad, "foot_m": list(c.foot_m), "foot_yaw_rad": c.foot_yaw_rad,
        }
        if c.focal_pixels is not None:
            section["focal_pixels"] = list(c.focal_pixels)
        if any(c.distortion):
            section["distortion"] = list(c.distortion)
        return {"camera": section}


def read_points(texts, width_m: float, depth_m: float) -> np.ndarray:
    """(n, 4) u, v [pixels], x, y [m] from texts "u,v,x,y"; or from four texts "u,v", the space's corners far left, far
    right, near right, near left.

    Raises:
        InputError: a text of another form.
    """
    rows = []
    for text in texts:
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 4) or not np.isfinite(numbers).all() or max(map(abs, numbers)) > 1e5:
            raise InputError(f"--points: expected u,v,x,y (pixels and metres) or u,v of a corner, got {shown(text)}")
        rows.append(numbers)
    if rows and all(len(row) == 2 for row in rows):
        if len(rows) != 4:
            raise InputError(
                f"--points: expected the four corners of the space, or u,v,x,y of each point, got {len(rows)}"
            )
        return np.hstack([rows, CORNERS * [width_m, depth_m]])
    if any(len(row) == 2 for row in rows):
        raise InputError("--points: expected u,v,x,y of every point, or u,v of the four corners alone")
    if len(rows) < 4:
        raise InputError(f"--points: expected at least four points, got {len(rows)}")
    return np.array(rows)


def board_points(image: np.ndarray, text: str) -> np.ndarray:
    """(n, 4) u, v [pixels], x, y [m] of the inner corners of a chessboard that lies on the floor.

    Args:
        text: "columns,rows,square,x,y,yaw": numbers of inner corners, one odd and one even, so that both ends of the
            board differ; side of a square [m]; place in W of the first inner corner [m] and direction of the first row
            [rad], the other rows to the right of it. The square between the first four inner corners is dark.

    Raises:
        InputError: a text of another form, or no such board in the image.
    """
    try:
        columns, rows, square, x, y, yaw = (float(part) for part in text.split(","))
        if not (columns in range(3, 51) and rows in range(3, 51) and (columns + rows) % 2 and 0.0 < square < 10.0):
            raise ValueError
    except ValueError:
        raise InputError(
            f"--board: expected columns,rows,square,x,y,yaw, 3 to 50 inner corners, one number odd, got {shown(text)}"
        ) from None
    columns, rows = int(columns), int(rows)
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    found, corners = cv2.findChessboardCornersSB(grey, (columns, rows), flags=cv2.CALIB_CB_ACCURACY)
    if not found:
        raise InputError(
            f"--board: no chessboard of {columns} x {rows} inner corners is seen, expected one on the floor"
        )
    grid = corners.reshape(rows, columns, 2)

    (first, ahead), (beside, _) = grid[:2, :2]
    if np.linalg.det([ahead - first, beside - first]) < 0.0:  # from above, rows follow each other to the right
        grid = grid[::-1]

    def brightness(square):
        u, v = square.mean(axis=(0, 1))
        return cv2.getRectSubPix(grey, (3, 3), (float(u), float(v))).mean()

    if brightness(grid[:2, :2]) > brightness(grid[:2, 1:3]):
        grid = grid[::-1, ::-1]
    across, along = np.meshgrid(np.arange(columns) * square, np.arange(rows) * square)
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([
        grid.reshape(-1, 2), (x + c * across + s * along).ravel(), (y + s * across - c * along).ravel()
    ])


def calibrate(points, camera: Camera, fit_focal: bool = False) -> Calibration:
    """Where the camera stands, from points on the floor.

    Args:
        points: (n >= 4, 4) u, v [pixels], x, y in W [m]; camera: size, focal lengths and distortion, and the yaw that
            is kept (only foot_yaw_rad + yaw_rad can be seen); fit_focal: find one focal length for both axes too.

    Raises:
        InputError: points that do not fix a camera above the floor.
    """
    points = np.asarray(points, dtype=float)
    pixels, floor = np.ascontiguousarray(points[:, :2]), np.column_stack([points[:, 2:], np.zeros(len(points))])
    bad = InputError(
        "--points: no camera above the floor sees these points so, expected points in order, no three on a line"
    )
    spread = np.linalg.svd(floor[:, :2] - floor[:, :2].mean(axis=0), compute_uv=False)
    if spread[1] < 1e-3 * max(spread[0], 1e-9):
        raise bad
    if fit_focal:
        camera = replace(camera, focal_pixels=[_focal(camera, pixels, floor, bad)] * 2)
    matrix, distortion = camera_matrix(camera), np.array(camera.distortion)
    rotation, place = _pose(pixels, floor, matrix, distortion, bad)
    r_wc = cv2.Rodrigues(rotation)[0].T
    p_wc = -r_wc @ place.ravel()
    r_ws = r_wc @ R_CS
    if p_wc[2] <= 0.0 or r_ws[2, 0] >= -0.05:
        raise bad
    yaw = float(np.arctan2(r_ws[1, 0], r_ws[0, 0]))
    pitch = float(np.arcsin(-r_ws[2, 0]))
    roll = float(np.arctan2(r_ws[2, 1], r_ws[2, 2]))
    found = replace(
        camera, height_m=float(p_wc[2]), roll_rad=roll, pitch_rad=pitch, foot_m=[float(p_wc[0]), float(p_wc[1])],
        foot_yaw_rad=float(np.angle(np.exp(1j * (yaw - camera.yaw_rad)))),
    )
    back = cv2.projectPoints(floor, rotation, place, matrix, distortion)[0].reshape(-1, 2)
    residual = np.hypot(*(back - pixels).T)
    if (worst := float(residual.max())) > _WORST_PIXELS:
        raise InputError(
            f"--points: the best camera misses a point by {worst:.0f} pixels, expected at most {_WORST_PIXELS:g}: "
            "points in order, and a focal length that is right (or found, with --fit-focal)"
        )
    return Calibration(found, residual)


def _pose(pixels, floor, matrix, distortion, bad):
    """The pose of least error of the two that a plane allows."""
    try:
        _, rotations, places, _ = cv2.solvePnPGeneric(floor, pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    except cv2.error:
        raise bad from None
    if not rotations or not np.isfinite([*rotations[0].ravel(), *places[0].ravel()]).all():
        raise bad
    return cv2.solvePnPRefineLM(floor, pixels, matrix, distortion, rotations[0], places[0])


def _focal(camera, pixels, floor, bad):
    """The focal length [pixels] of least squared error."""
    from scipy.optimize import minimize_scalar

    size = max(camera.size_pixels)

    def error(log_focal):
        matrix = camera_matrix(replace(camera, focal_pixels=[float(np.exp(log_focal))] * 2))
        rotation, place = _pose(pixels, floor, matrix, np.array(camera.distortion), bad)
        back = cv2.projectPoints(floor, rotation, place, matrix, np.array(camera.distortion))[0].reshape(-1, 2)
        return float(((back - pixels) ** 2).sum())

    return float(np.exp(minimize_scalar(error, bounds=np.log([0.3 * size, 5.0 * size]), method="bounded").x))
