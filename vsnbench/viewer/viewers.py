"""Rerun's viewer as a process of ours: the native window, or the web viewer behind a small server of our own.

Both listen on 127.0.0.1 only (Rerun's own default is every interface). Neither sends usage statistics: the native
viewer keeps still where `CI` is set, and the web viewer, which has no such switch, is served with a content security
policy that lets the page talk to this machine alone.
"""

import contextlib
import http.client
import http.server
import importlib.util
import os
import socket
import subprocess
import threading
import time
import urllib.parse
from pathlib import Path
from types import TracebackType
from typing import Self

from vsnbench.errors import UsageError, VsnbenchError

LOOPBACK = "127.0.0.1"
WEB_PORT = 9090
START_TIMEOUT_S = 20.0


class Viewer:
    """A running viewer; a context manager that ends it.

    Raises:
        VsnbenchError: Rerun's program is missing or does not start.
    """

    def __init__(self, arguments: list[str], grpc_port: int, waits_for: int) -> None:
        self.grpc_url = f"rerun+http://{LOOPBACK}:{grpc_port}/proxy"
        """Where `EpisodeRecording` can send an episode as it happens."""
        command = [str(_program()), "--bind", LOOPBACK, "--port", str(grpc_port), *arguments]
        self._process = subprocess.Popen(
            command, env=os.environ | {"CI": "true", "RUST_LOG": "error"}, stdin=subprocess.DEVNULL
        )
        try:
            self._wait_until_it_listens(waits_for)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def is_open(self) -> bool:
        """Whether its user has not closed it yet."""
        return self._process.poll() is None

    def wait(self) -> None:
        """Return when the viewer has been closed by its user."""
        self._process.wait()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _wait_until_it_listens(self, port: int) -> None:
        deadline = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise VsnbenchError(f"Rerun's viewer ended at once with code {self._process.returncode}")
            with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1):
                return
            time.sleep(0.02)
        raise VsnbenchError(f"Rerun's viewer did not start within {START_TIMEOUT_S:g} s")


class WebViewer(Viewer):
    """The web viewer, served on 127.0.0.1; `address` is what a browser opens."""

    def __init__(self, port: int = WEB_PORT, recording: Path | None = None) -> None:
        grpc_port, upstream_port = free_port(), free_port()
        try:
            self._server = _PrivateServer((LOOPBACK, port), upstream_port, grpc_port)
        except (OSError, OverflowError) as error:
            raise UsageError(f"cannot serve on {LOOPBACK}:{port} ({error}); choose another port") from error
        self.address = f"http://{LOOPBACK}:{self._server.server_port}/"
        files = [] if recording is None else [str(recording)]
        try:
            super().__init__(["--serve-web", "--web-viewer-port", str(upstream_port), *files], grpc_port, upstream_port)
        except BaseException:
            self._server.server_close()
            raise
        self._thread = threading.Thread(target=self._server.serve_forever, name="rerun-web", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the server and the viewer behind it."""
        thread: threading.Thread | None = getattr(self, "_thread", None)
        if thread is not None:
            self._server.shutdown()
            thread.join()
        self._server.server_close()
        super().close()


def has_display() -> bool:
    """Whether a window can be opened here."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_window(recording: Path | None = None) -> Viewer:
    """Open the native viewer, on a recording or waiting for one.

    Raises:
        VsnbenchError: there is no display here.
    """
    if not has_display():
        raise VsnbenchError("there is no display here for Rerun's window; --web serves it to a browser instead")
    port = free_port()
    return Viewer([str(recording)] if recording is not None else ["--expect-data-soon"], port, port)


def is_listening(grpc_url: str) -> bool:
    """Return whether a viewer still takes episodes there."""
    address = urllib.parse.urlsplit(grpc_url)
    try:
        with socket.create_connection((address.hostname or LOOPBACK, address.port or 0), timeout=1):
            return True
    except OSError:
        return False


def free_port() -> int:
    """Return a TCP port on the loopback interface that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def _program() -> Path:
    package = importlib.util.find_spec("rerun_cli")
    shipped = Path(package.origin).with_name("rerun") if package and package.origin else Path("rerun")
    program = Path(os.environ.get("RERUN_CLI_PATH") or shipped)
    if not program.is_file():
        raise VsnbenchError(f"Rerun's viewer is not at {program}: install rerun-sdk again")
    return program


class _PrivateServer(http.server.ThreadingHTTPServer):
    """Passes the viewer's files on, with a policy that keeps the page from calling anywhere but this machine."""

    daemon_threads = True

    def __init__(self, address: tuple[str, int], upstream_port: int, grpc_port: int) -> None:
        self.upstream_port = upstream_port
        self.data_url = f"rerun+http://{LOOPBACK}:{grpc_port}/proxy"
        self.policy = (
            f"connect-src 'self' data: blob: http://{LOOPBACK}:{grpc_port}; "
            "font-src 'self' data:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; form-action 'none'"
        )
        super().__init__(address, _PassOn)


class _PassOn(http.server.BaseHTTPRequestHandler):
    """One request for one of the viewer's files."""

    server: _PrivateServer

    def do_GET(self) -> None:
        """Send the file, or lead the browser from the bare address to the one that names the data."""
        address = urllib.parse.urlsplit(self.path)
        query = urllib.parse.parse_qsl(address.query, keep_blank_values=True)
        if address.path == "/" and "url" not in dict(query):
            self.send_response(302)
            self.send_header("Location", "/?" + urllib.parse.urlencode([("url", self.server.data_url), *query]))
            self.end_headers()
            return
        upstream = http.client.HTTPConnection(LOOPBACK, self.server.upstream_port, timeout=30)
        try:
            upstream.request("GET", self.path)
            answer = upstream.getresponse()
            body = answer.read()
        except OSError:
            self.send_error(502, "the viewer has ended")
            return
        finally:
            upstream.close()
        self.send_response(answer.status)
        self.send_header("Content-Type", answer.getheader("Content-Type", "application/octet-stream"))
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", self.server.policy)
        self.end_headers()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Say nothing: this is a person's own browser."""
