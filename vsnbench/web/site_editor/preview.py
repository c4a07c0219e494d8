"""Camera previews of a site in the editor, and photographs for its goals, rendered by the simulator."""

import math
import threading
from collections import deque
from typing import TYPE_CHECKING, Final

from vsnbench.errors import SiteError
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from vsnbench.simulator.rendering.renderer import Renderer

WIDTH_PX: Final = 384
_ABOVE_M: Final = 2.0
"""Height from which a scan is shown from above."""
_WIDE_M: Final = 1.6
"""Width of the floor in that picture."""
_CROSS: Final = (230, 60, 160)


_drawing: Final = threading.Lock()
_renderers: Final[deque[tuple[str, "Renderer"]]] = deque(maxlen=1)
"""The renderer of the last site, whose lighting takes seconds to compute."""


def camera_image(site: Site, camera: Camera, pose: Pose, *, full_size: bool) -> bytes:
    """Return the robot's camera image at a pose: a small JPEG, or a PNG in the camera's resolution.

    Raises:
        SiteError: the simulator cannot show the site.
    """
    from vsnbench.simulator.rendering.renderer import eye_of

    width = camera.width if full_size else WIDTH_PX
    height, focal_px = round(width * camera.height / camera.width), camera.focal_px * width / camera.width
    with _drawing:
        rgb = _renderer(site).render_from(eye_of(camera, pose), width, height, focal_px).rgb
    return _encoded(rgb, ".png" if full_size else ".jpg")


def scan_image(site: Site, pose: Pose) -> tuple[bytes, float | None]:
    """Return the scan around a point from above as a JPEG, and the height of its surface there; None in a hole.

    Raises:
        SiteError: the site has no scan, or it cannot be read.
    """
    from vsnbench.simulator.rendering.renderer import Eye

    if site.scan is None:
        raise SiteError("the site has no scan", advice="make a site from one with `vsnbench sites scan`")
    height, focal_px = WIDTH_PX * 3 // 4, WIDTH_PX * _ABOVE_M / _WIDE_M
    eye = Eye(pose.x_m, pose.y_m, _ABOVE_M, math.pi / 2, -math.pi / 2)
    with _drawing:
        frame = _renderer(site).render_from(eye, WIDTH_PX, height, focal_px)
    row, column = height // 2, WIDTH_PX // 2
    depth_m = float(frame.depth_m[row, column])
    for line in (frame.rgb[row, column - 12 : column + 13], frame.rgb[row - 12 : row + 13, column]):
        line[:] = _CROSS
    return _encoded(frame.rgb, ".jpg"), round(_ABOVE_M - depth_m, 2) + 0.0 if math.isfinite(depth_m) else None


def _renderer(site: Site) -> "Renderer":
    """Return the renderer of a site; that of a scan, whose pictures show no objects, is that of its file."""
    from vsnbench.simulator.rendering.renderer import Renderer
    from vsnbench.simulator.scene import build_scene

    same = site.model_copy(update={"starts": site.starts[:1], "name": "preview", "title": ""})
    key = same.sha256 if site.scan is None else site.scan.sha256
    if not _renderers or _renderers[0][0] != key:
        _renderers.append((key, Renderer(build_scene(site))))
    return _renderers[0][1]


def _encoded(rgb: "npt.NDArray[np.uint8]", suffix: str) -> bytes:
    import cv2

    done, encoded = cv2.imencode(suffix, rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85] if suffix == ".jpg" else [])
    if not done:
        raise SiteError("the preview could not be encoded")
    return bytes(encoded)
