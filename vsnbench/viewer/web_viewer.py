"""Rerun's web viewer behind our own server.

Rerun's server listens on 127.0.0.1 without a token, and its page sends usage statistics. Our server adds the token and
a content security policy that limits the page's connections to this machine.
"""

import http.client
import re
from http import HTTPStatus
from pathlib import Path
from typing import Final

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, RedirectResponse, Response
from starlette.routing import Route

from vsnbench.viewer.viewers import Viewer, free_port
from vsnbench.web_server.server import LOOPBACK, WebServer
from vsnbench.web_server.session_key import SessionKey

WEB_PORT: Final = 9090
_RECORDING_PATH = "/episode.rrd"
_VIEWER_FILE = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9]+)+")


class WebViewer(Viewer):
    """Rerun's web viewer, served on 127.0.0.1; open `address` in a browser."""

    how_to_end = "press Ctrl-C"

    def __init__(self, port: int = WEB_PORT, recording: Path | None = None) -> None:
        """Start the viewer process and the server.

        Args:
            port: 0 for any free port.
            recording: file to show; without one the viewer shows live data.

        Raises:
            UsageError: `port-unavailable`, the port is in use.
            VsnbenchError: Rerun's program is missing or does not start.
        """
        grpc_port, upstream_port = free_port(), free_port()
        key = SessionKey.new()
        self._server = WebServer(_viewer_app(key, upstream_port, grpc_port, recording), key, port=port)
        self.address = self._server.addresses[0]
        try:
            super().__init__(["--serve-web", "--web-viewer-port", str(upstream_port)], grpc_port, upstream_port)
        except BaseException:
            self._server.close()
            raise
        self._server.start()

    def close(self) -> None:
        """End the server and the viewer process behind it."""
        self._server.close()
        super().close()


def _viewer_app(key: SessionKey, upstream_port: int, grpc_port: int, recording: Path | None) -> Starlette:
    """Return an application that forwards the viewer's files and serves the recording.

    The viewer sends no cookies, so the recording's address contains the token. Live data come from Rerun's own server,
    which has no token but refuses requests of other origins.
    """

    def page(request: Request) -> Response:
        if "url" in request.query_params:
            return forward("")
        if recording is not None:
            data_url = str(request.url.replace(path=_RECORDING_PATH, query=f"token={key.token}"))
        else:
            data_url = f"rerun+http://{LOOPBACK}:{grpc_port}/proxy"
        return RedirectResponse(request.url.include_query_params(url=data_url))

    def send_recording(_request: Request) -> Response:
        if recording is None:
            return Response(status_code=HTTPStatus.NOT_FOUND)
        return FileResponse(recording, media_type="application/octet-stream")

    def viewer_file(request: Request) -> Response:
        name = request.path_params["name"]
        return forward(name) if _VIEWER_FILE.fullmatch(name) else Response(status_code=HTTPStatus.NOT_FOUND)

    def forward(name: str) -> Response:
        upstream = http.client.HTTPConnection(LOOPBACK, upstream_port, timeout=30)
        try:
            upstream.request("GET", f"/{name}")
            answer = upstream.getresponse()
            content = answer.read()
        except (OSError, http.client.HTTPException):
            return Response(status_code=HTTPStatus.BAD_GATEWAY)  # the viewer process has ended
        finally:
            upstream.close()
        if answer.status != HTTPStatus.OK:
            return Response(status_code=HTTPStatus.NOT_FOUND)
        policy = (
            f"connect-src 'self' data: blob: http://{LOOPBACK}:{grpc_port}; "
            "font-src 'self' data:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; form-action 'none'"
        )
        media_type = answer.getheader("Content-Type", "application/octet-stream")
        return Response(content, media_type=media_type, headers={"content-security-policy": policy})

    routes = [Route("/", page), Route(_RECORDING_PATH, send_recording), Route("/{name}", viewer_file)]
    return Starlette(routes=routes)
