"""The camera's place from points on the floor whose pixels are known: clicked, measured, or the trapezoid's corners."""

import contextlib
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.room.room import Camera
from drake_ispace.vision.optics.camera import R_CS, camera_matrix
from drake_ispace.vision.optics.top_view import CORNERS

_WORST_PIXELS = 2.0  # root mean square, from which on points and camera contradict each other
_CLICK_PIXELS = 0.5  # how well a point is known at best
_UNSURE = 0.1  # uncertainty of a focal length (as a share) or of k1, above which it is no answer
_POSE, _SPARE = 6, 2  # unknowns of a pose, and numbers that must be left to contradict
_FOCALS, _STARTS = (0.3, 5.0), 7  # focal lengths that are searched, in widths of the image, and how many starts


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


def calibrate(points, camera: Camera, fit_focal: bool = False, fit_lens: bool = False) -> Calibration:
    """Where the camera stands, from points on the floor; all that is looked for is fitted together.

    Args:
        points: (n >= 4, 4) u, v [pixels], x, y in W [m]. camera: size, focal lengths and distortion, and the yaw that
            is kept (only foot_yaw_rad + yaw_rad can be seen). fit_focal: find one focal length for both axes too.
        fit_lens: find how much the lens bends straight lines too (k1 of OpenCV's model).

    Raises:
        InputError: points that do not fix a camera above the floor, or a fit that misses them by more than 2 pixels
            (root mean square), lies on the edge of what was searched, or leaves the height open.
    """
    points = np.asarray(points, dtype=float)
    spread = np.linalg.svd(points[:, 2:] - points[:, 2:].mean(axis=0), compute_uv=False)
    if spread[1] < 1e-3 * max(spread[0], 1e-9):
        raise _no_camera()
    unknowns = _POSE + fit_focal + fit_lens
    if 2 * len(points) < unknowns + _SPARE:
        least = -(-(unknowns + _SPARE) // 2)
        raise InputError(f"--points: expected at least {least} points to find so much, got {len(points)}")
    fitted = _Fit(points, camera, fit_focal, fit_lens)
    if fitted.rms > _WORST_PIXELS:
        raise InputError(
            f"--points: the best camera misses them by {fitted.rms:.1f} pixels (root mean square), expected at most "
            f"{_WORST_PIXELS:g}: {_culprit(points, camera, fit_focal, fit_lens)}"
        )
    fitted.check()
    return Calibration(fitted.camera(), fitted.residual_pixels)


def _no_camera() -> InputError:
    return InputError(
        "--points: no camera above the floor sees these points so, expected points in order, no three on a line"
    )


class _Fit:
    """The camera of least squared error.

    Attributes:
        rms, residual_pixels: what it leaves of the points.
    """

    def __init__(self, points, camera, fit_focal, fit_lens):
        self._given, self._with_focal, self._with_lens = camera, fit_focal, fit_lens
        self._pixels = np.ascontiguousarray(points[:, :2])
        self._floor = np.column_stack([points[:, 2:], np.zeros(len(points))])
        known = camera_matrix(camera)[0, 0]
        focals = np.geomspace(*_FOCALS, _STARTS) * max(camera.size_pixels) if fit_focal else [known]
        found = [one for focal in focals for one in self._from(focal)]
        if not found:
            raise _no_camera()
        self._best = min(found, key=lambda one: one.cost)
        self.residual_pixels = np.hypot(*self._best.fun.reshape(-1, 2).T)
        self.rms = float(np.sqrt(np.mean(self.residual_pixels**2)))

    def _from(self, focal):
        """Fits that begin at a focal length [pixels], from each of the two poses that a plane allows."""
        more = [np.log(focal)] * self._with_focal + [self._given.distortion[0]] * self._with_lens
        matrix, distortion = self._lens([0.0] * _POSE + more)
        with contextlib.suppress(cv2.error, ValueError, np.linalg.LinAlgError):
            _, rotations, places, _ = cv2.solvePnPGeneric(
                self._floor, self._pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE
            )
            for rotation, place in zip(rotations, places, strict=True):
                start = np.concatenate([rotation.ravel(), place.ravel(), more])
                if np.isfinite(start).all():
                    yield least_squares(self._misses, start, x_scale="jac", max_nfev=400)

    def _lens(self, x):
        """(matrix, distortion) at the unknowns `x`."""
        matrix, distortion = camera_matrix(self._given), np.array(self._given.distortion)
        if self._with_focal:
            matrix[0, 0] = matrix[1, 1] = np.exp(np.clip(x[_POSE], -20.0, 20.0))
        if self._with_lens:
            distortion[0] = x[-1]
        return matrix, distortion

    def _misses(self, x):
        back = cv2.projectPoints(self._floor, x[:3], x[3:_POSE], *self._lens(x))[0].reshape(-1, 2)
        return np.nan_to_num((back - self._pixels).ravel(), nan=1e6, posinf=1e6, neginf=-1e6)

    def check(self):
        """Refuse what the points do not tell, though they are hit."""
        x, size = self._best.x, max(self._given.size_pixels)
        curvature = self._best.jac.T @ self._best.jac
        std = np.sqrt(np.abs(np.diag(np.linalg.pinv(curvature)))) * max(self.rms, _CLICK_PIXELS)
        if self._with_focal:
            share = np.exp(x[_POSE]) / size
            if not 1.02 * _FOCALS[0] < share < 0.98 * _FOCALS[1] or std[_POSE] > _UNSURE:
                raise InputError(
                    f"--fit-focal: these points do not tell the focal length from the height (it would be "
                    f"{np.exp(x[_POSE]):.0f} pixels, uncertain by {100.0 * min(std[_POSE], 9.99):.0f} %), expected "
                    "points that are nearer and farther from the camera, or a focal length that is known"
                )
        if self._with_lens and std[-1] > _UNSURE:
            raise InputError(
                f"--fit-lens: these points do not show how the lens bends lines (k1 would be {x[-1]:.3g}, uncertain by "
                f"{std[-1]:.2g}), expected more points, some near the edges of the picture"
            )

    def camera(self) -> Camera:
        """The camera with what was found."""
        x, given = self._best.x, self._given
        r_wc = cv2.Rodrigues(x[:3])[0].T
        p_wc = -r_wc @ x[3:_POSE]
        r_ws = r_wc @ R_CS
        if p_wc[2] <= 0.0 or r_ws[2, 0] >= -0.05:
            raise _no_camera()
        yaw = float(np.arctan2(r_ws[1, 0], r_ws[0, 0]))
        matrix, distortion = self._lens(x)
        return replace(
            given, height_m=float(p_wc[2]), roll_rad=float(np.arctan2(r_ws[2, 1], r_ws[2, 2])),
            pitch_rad=float(np.arcsin(-r_ws[2, 0])), foot_m=[float(p_wc[0]), float(p_wc[1])],
            foot_yaw_rad=float(np.angle(np.exp(1j * (yaw - given.yaw_rad)))),
            focal_pixels=[float(matrix[0, 0])] * 2 if self._with_focal else given.focal_pixels,
            distortion=[float(value) for value in distortion],
        )


def _culprit(points, camera, fit_focal, fit_lens) -> str:
    """What may be wrong with points that no camera sees so: the one without which all others are hit, if there is one.
    """
    left_out = []
    for i in range(len(points)):
        rest = np.delete(points, i, axis=0)
        if 2 * len(rest) >= _POSE + fit_focal + fit_lens + _SPARE:
            with contextlib.suppress(InputError):
                left_out.append((_Fit(rest, camera, fit_focal, fit_lens).rms, i))
    if left_out and min(left_out)[0] <= _WORST_PIXELS:
        u, v, x, y = points[min(left_out)[1]]
        return f"the point {u:g},{v:g} at {x:g},{y:g} m does not go with the others"
    return "points in order, and a focal length that is right (or found, with --fit-focal)"
