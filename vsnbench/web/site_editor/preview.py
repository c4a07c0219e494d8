"""Camera previews of a site in the editor, and photographs for its goals, rendered by the simulator."""

import threading
from typing import TYPE_CHECKING, Final

from vsnbench.errors import SiteError
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from vsnbench.simulator.rendering.renderer import Renderer

WIDTH_PX: Final = 384


class CameraPreview:
    """Renders previews, and caches the renderer of the last site, whose lighting takes seconds to compute."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._lock = threading.Lock()
        self._cached: tuple[str, Renderer] | None = None

    def image(self, site: Site, pose: Pose, *, full_size: bool) -> bytes:
        """Return the robot's camera image at a pose: a small JPEG, or a PNG in the camera's resolution.

        Raises:
            SiteError: the simulator cannot show the site.
        """
        import cv2

        from vsnbench.simulator.rendering.renderer import Renderer, eye_of
        from vsnbench.simulator.scene import build_scene

        camera = self._camera
        width = camera.width if full_size else WIDTH_PX
        key = site.model_copy(update={"starts": site.starts[:1], "name": "preview", "title": ""}).sha256
        with self._lock:
            if self._cached is None or self._cached[0] != key:
                self._cached = (key, Renderer(build_scene(site)))
            renderer = self._cached[1]
            height, focal_px = round(width * camera.height / camera.width), camera.focal_px * width / camera.width
            rgb = renderer.render_from(eye_of(camera, pose), width, height, focal_px).rgb
        bgr = rgb[..., ::-1]
        done, encoded = (
            cv2.imencode(".png", bgr) if full_size else cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 85])
        )
        if not done:
            raise SiteError("the preview could not be encoded")
        return bytes(encoded)
