"""The floor plan of an episode as an image that fits an area, with the driven path."""

import numpy as np

from vsnbench.sites.site import Site
from vsnbench.values.pose import Pose
from vsnbench.viewer.site_picture import PLAN_PIXEL_M, paint_site
from vsnbench.viewer.video.canvas import Image, Rgb, fitted

PATH_RGB: Rgb = (24, 92, 190)
_SUBPIXEL_BITS = 4


class PlanPicture:
    """A site with the targets of a goal highlighted, scaled to fit an area."""

    def __init__(self, site: Site, goal: str, width: int, height: int, robot_radius_m: float) -> None:
        picture, corner = paint_site(site, goal)
        self._base = fitted(picture, width, height)
        self._corner_m = corner
        self._pixels_per_m = self._base.shape[1] / picture.shape[1] / PLAN_PIXEL_M
        self._robot_radius_m = robot_radius_m

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self._base.shape[1], self._base.shape[0]

    def draw(self, path: list[Pose], color: Rgb = PATH_RGB) -> Image:
        """Return the plan with a path in the site's frame, at least one pose, and the robot in a colour at its end."""
        import cv2

        picture = self._base.copy()
        points = np.array([self._at(pose.x_m, pose.y_m) for pose in path], np.int32)
        thick = max(2, round(0.05 * self._pixels_per_m))
        if len(points) > 1:
            cv2.polylines(picture, [points], False, PATH_RGB, thick, cv2.LINE_AA, _SUBPIXEL_BITS)
        here = path[-1]
        radius = max(0.02 * self._base.shape[1], self._robot_radius_m * self._pixels_per_m)
        shell = round(radius * 2**_SUBPIXEL_BITS)
        cv2.circle(picture, tuple(map(int, points[-1])), shell, color, -1, cv2.LINE_AA, _SUBPIXEL_BITS)
        nose = here.compose(Pose(1.9 * radius / self._pixels_per_m, 0.0))
        tip = tuple(map(int, self._at(nose.x_m, nose.y_m)))
        cv2.line(picture, tuple(map(int, points[-1])), tip, color, thick, cv2.LINE_AA, _SUBPIXEL_BITS)
        return picture

    def _at(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return a point in fractions of a pixel, as OpenCV's drawing functions take it."""
        column = (x_m - self._corner_m[0]) * self._pixels_per_m
        row = self._base.shape[0] - (y_m - self._corner_m[1]) * self._pixels_per_m
        return round(column * 2**_SUBPIXEL_BITS), round(row * 2**_SUBPIXEL_BITS)
