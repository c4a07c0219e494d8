"""Looks into a site while it is drawn: the simulator's own picture from a pose, small and quick, as a JPEG."""

import math
import threading
from typing import TYPE_CHECKING

from vsnbench.errors import SiteError
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site

if TYPE_CHECKING:
    from vsnbench.simulator.renderer import Renderer

WIDTH_PX = 384


class SiteLooks:
    """Keeps the last site's light, which takes seconds; a start that is dragged needs a picture only."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._lock = threading.Lock()
        self._known: tuple[str, Renderer] | None = None

    def jpeg(self, site: Site, x_m: float, y_m: float, heading_deg: float) -> bytes:
        """Return what the robot's camera would see from there.

        Raises:
            SiteError: the site holds what the simulator cannot show.
        """
        import cv2

        from vsnbench.simulator.renderer import Renderer, eye_of
        from vsnbench.simulator.scene import build_scene

        camera = self._camera
        key = site.model_copy(update={"starts": site.starts[:1], "name": "look", "title": ""}).sha256
        with self._lock:
            if self._known is None or self._known[0] != key:
                self._known = (key, Renderer(build_scene(site)))
            renderer = self._known[1]
            height = round(WIDTH_PX * camera.height / camera.width)
            focal_px = camera.focal_px * WIDTH_PX / camera.width
            eye = eye_of(camera, Pose(x_m, y_m, math.radians(heading_deg)))
            rgb = renderer.render_from(eye, WIDTH_PX, height, focal_px).rgb
        done, encoded = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
        if not done:
            raise SiteError("the picture could not be encoded")
        return bytes(encoded)
