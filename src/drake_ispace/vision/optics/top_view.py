"""The top view: the space, or a plane above it, as a map with equal pixels; section 5.3.1, Fig. 5.4(b)."""

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.vision.optics.camera import View

_MOST_PIXELS = 2e7

#: Corners of the space in the order in which they become those of the top view: far left, far right, near right,
#: near left (x of W to the right, y upward in the picture).
CORNERS = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])


def trapezoid(view: View, width_m: float, depth_m: float, height_m: float = 0.0) -> np.ndarray:
    """(4, 2) pixels of the corners of the space, `height_m` above the floor: the trapezoid of Fig. 5.5(a)."""
    corners = CORNERS * [width_m, depth_m]
    return view.project(np.column_stack([corners, np.full(4, height_m)]))


class TopView:
    """Turns images into top views through the four corners of the trapezoid.

    Args:
        corners: (4, 2) pixels of the space's corners in the order of `CORNERS`.
        width_m, depth_m: of the space, along columns and rows.
        pixel_m: wanted size of a pixel along columns and rows [m/pixel]; the map has whole pixels, so its own size
            `pixel_m` is the nearest that fits: 4.873 and 5.510 mm for 513 x 363 pixels.
        matrix, distortion: of the lens, where it bends lines; the corners are pixels of the bent image.
    """

    def __init__(self, corners, width_m, depth_m, pixel_m, matrix=None, distortion=None):
        self.width_m, self.depth_m = width_m, depth_m
        self.size = (max(round(width_m / pixel_m[0]), 1), max(round(depth_m / pixel_m[1]), 1))
        self.pixel_m = (width_m / self.size[0], depth_m / self.size[1])
        self._lens = (matrix, np.asarray(distortion)) if distortion is not None and np.any(distortion) else None
        # The corner of the space is the corner of the first pixel, half a pixel before its middle.
        target = (CORNERS * [1, -1] + 0.5) * self.size - 0.5
        self._to_map = cv2.getPerspectiveTransform(
            self._straight(corners).astype(np.float32), target.astype(np.float32)
        )
        self._bent = None
        if self._lens is not None:
            columns, rows = self.size
            u, v = np.meshgrid(np.arange(columns), np.arange(rows))
            pixels = self.to_image(np.column_stack([u.ravel(), v.ravel()])).astype(np.float32)
            self._bent = pixels.reshape(rows, columns, 2)

    def warp(self, image: np.ndarray) -> np.ndarray:
        """The top view of an image; black where the image does not reach."""
        if self._bent is not None:
            return cv2.remap(image, self._bent, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return cv2.warpPerspective(image, self._to_map, self.size, flags=cv2.INTER_LINEAR)

    def reach(self, image_size) -> np.ndarray:
        """(rows, columns) whether a pixel of the top view lies in an image of `image_size` (columns, rows)."""
        return self.warp(np.full((image_size[1], image_size[0]), 255, np.uint8)) == 255

    def to_metres(self, pixels) -> np.ndarray:
        """(n, 2) x, y in W [m] of (n, 2) pixels of the top view."""
        at = (np.asarray(pixels, dtype=float).reshape(-1, 2) + 0.5) / self.size - 0.5
        return at * [self.width_m, -self.depth_m]

    def to_pixels(self, points) -> np.ndarray:
        """(n, 2) pixels of the top view of (n, 2) points x, y in W [m]."""
        at = np.asarray(points, dtype=float).reshape(-1, 2) / [self.width_m, -self.depth_m]
        return (at + 0.5) * self.size - 0.5

    def to_image(self, pixels) -> np.ndarray:
        """(n, 2) pixels of the image of (n, 2) pixels of the top view."""
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 1, 2)
        straight = cv2.perspectiveTransform(pixels, np.linalg.inv(self._to_map)).reshape(-1, 2)
        if self._lens is None:
            return straight
        matrix, distortion = self._lens
        rays = np.column_stack([(straight - matrix[:2, 2]) / matrix[[0, 1], [0, 1]], np.ones(len(straight))])
        return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)

    def from_image(self, pixels) -> np.ndarray:
        """(n, 2) pixels of the top view of (n, 2) pixels of the image."""
        straight = np.ascontiguousarray(self._straight(pixels))
        return cv2.perspectiveTransform(straight[:, None], self._to_map).reshape(-1, 2)

    def _straight(self, pixels):
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 2)
        if self._lens is None:
            return pixels
        matrix, distortion = self._lens
        return cv2.undistortPoints(pixels[:, None], matrix, distortion, P=matrix).reshape(-1, 2)


def corners_from_points(points, width_m: float, depth_m: float, matrix=None, distortion=None) -> np.ndarray:
    """(4, 2) pixels of the corners of the space from points on its floor, by least squares.

    Args:
        points: (n >= 4, 4) u, v [pixels], x, y [m], no three on a line; the rest as for TopView.

    Raises:
        ValueError: points that fix no plane.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 4)
    pixels = points[:, :2]
    if distortion is not None and np.any(distortion):
        pixels = cv2.undistortPoints(pixels[:, None], matrix, np.asarray(distortion), P=matrix).reshape(-1, 2)
    to_image, _ = cv2.findHomography(points[:, 2:], pixels) if len(points) >= 4 else (None, None)
    if to_image is None or np.linalg.cond(to_image) > 1e9:
        raise ValueError("the points fix no plane")
    corners = cv2.perspectiveTransform((CORNERS * [width_m, depth_m])[:, None], to_image).reshape(-1, 2)
    if distortion is not None and np.any(distortion):
        rays = np.column_stack([(corners - matrix[:2, 2]) / matrix[[0, 1], [0, 1]], np.ones(4)])
        corners = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.asarray(distortion))[0].reshape(-1, 2)
    return corners


def top_view_of(view: View, width_m: float, depth_m: float, pixel_m, height_m: float = 0.0) -> TopView:
    """The top view of the plane z = height_m: markers on it stand where they are, free of parallax.

    Raises:
        InputError: a camera that does not see all corners of the space from above, or too many pixels.
    """
    corners = trapezoid(view, width_m, depth_m, height_m)
    if view.p_ws[2] <= height_m or not np.isfinite(corners).all():
        raise InputError(
            f"space.camera: expected one that has the whole {width_m:g} x {depth_m:g} m space, {height_m:g} m above "
            "the floor, in front of and below it"
        )
    if width_m / pixel_m[0] * depth_m / pixel_m[1] > _MOST_PIXELS:
        raise InputError(f"space.localizer.pixel_m: expected a top view of at most {_MOST_PIXELS:g} pixels")
    return TopView(corners, width_m, depth_m, pixel_m, view.matrix, view.distortion)
