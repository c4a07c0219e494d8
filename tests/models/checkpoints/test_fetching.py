"""Downloads of weights are atomic and checked by hash; interrupted ones resume."""

import hashlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.checkpoints.fetching import fetch

CONTENT = bytes(range(256)) * 12_000
SHA256 = hashlib.sha256(CONTENT).hexdigest()


@dataclass
class Server:
    """A local web server with scripted faults."""

    url: str = ""
    stop_after: int | None = None
    """Number of bytes after which the server cuts the connection, below the announced length."""
    ranges: bool = True
    status: int = 200
    asked: list[str | None] = field(default_factory=list)
    """The Range header of every request."""


@pytest.fixture
def server() -> Iterator[Server]:
    behaviour = Server()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            wanted = self.headers.get("Range")
            behaviour.asked.append(wanted)
            first = int(wanted.removeprefix("bytes=").removesuffix("-")) if wanted and behaviour.ranges else 0
            if behaviour.status != 200:
                self.send_error(behaviour.status)
                return
            if first >= len(CONTENT):
                self.send_error(416)
                return
            body = CONTENT[first:]
            self.send_response(206 if first else 200)
            if first:
                self.send_header("Content-Range", f"bytes {first}-{len(CONTENT) - 1}/{len(CONTENT)}")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body[: behaviour.stop_after])

        def log_message(self, *_: object) -> None:
            pass

    web = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    behaviour.url = f"http://127.0.0.1:{web.server_port}/weights.ckpt"
    thread = threading.Thread(target=web.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield behaviour
    web.shutdown()
    web.server_close()
    thread.join()


def part_of(destination: Path) -> Path:
    return destination.with_name(f"{destination.name}.{SHA256[:12]}.part")


def test_a_file_arrives_with_progress_and_nothing_is_left_beside_it(tmp_path: Path, server: Server) -> None:
    seen: list[tuple[int, int | None]] = []
    destination = tmp_path / "new" / "pirlnav.ckpt"
    assert fetch(server.url, destination, SHA256, lambda here, whole: seen.append((here, whole)))
    assert destination.read_bytes() == CONTENT
    assert list(destination.parent.iterdir()) == [destination]
    assert seen[0] == (0, len(CONTENT))
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert [here for here, _ in seen] == sorted(here for here, _ in seen)


def test_what_is_there_already_is_not_downloaded_again(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    destination.write_bytes(CONTENT)
    assert not fetch(server.url, destination, f"sha256:{SHA256.upper()}")
    assert server.asked == []


def test_another_file_at_the_destination_is_left_alone(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    destination.write_bytes(b"another user's file")
    with pytest.raises(UsageError, match="another file"):
        fetch(server.url, destination, SHA256)
    assert destination.read_bytes() == b"another user's file"


def test_a_cut_connection_is_noticed_and_the_next_call_goes_on(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    server.stop_after = 1_500_000
    with pytest.raises(ModelError, match="continues from byte 1500000"):
        fetch(server.url, destination, SHA256)
    assert not destination.exists()
    assert part_of(destination).read_bytes() == CONTENT[:1_500_000]
    server.stop_after = None
    assert fetch(server.url, destination, SHA256)
    assert destination.read_bytes() == CONTENT
    assert server.asked == [None, "bytes=1500000-"]


def test_a_server_that_cannot_resume_sends_everything_again(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    part_of(destination).write_bytes(CONTENT[:1000])
    server.ranges = False
    assert fetch(server.url, destination, SHA256)
    assert destination.read_bytes() == CONTENT


def test_a_download_that_only_lacked_its_name_is_finished(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    part_of(destination).write_bytes(CONTENT)
    assert fetch(server.url, destination, SHA256)
    assert destination.read_bytes() == CONTENT


def test_a_wrong_hash_is_refused_with_the_one_found_and_thrown_away(tmp_path: Path, server: Server) -> None:
    with pytest.raises(ModelError, match=f"{SHA256}, not {'0' * 64}"):
        fetch(server.url, tmp_path / "pirlnav.ckpt", "0" * 64)
    assert list(tmp_path.iterdir()) == []


def test_a_spoilt_beginning_is_noticed_by_the_hash(tmp_path: Path, server: Server) -> None:
    destination = tmp_path / "pirlnav.ckpt"
    part_of(destination).write_bytes(bytes(2000))
    with pytest.raises(ModelError, match="file deleted"):
        fetch(server.url, destination, SHA256)
    assert fetch(server.url, destination, SHA256)


@pytest.mark.parametrize("status", [403, 404, 500])
def test_a_refusing_server_is_quoted(tmp_path: Path, server: Server, status: int) -> None:
    server.status = status
    with pytest.raises(ModelError, match=f"the server answered {status}"):
        fetch(server.url, tmp_path / "pirlnav.ckpt", SHA256)


def test_a_server_that_is_not_there_is_one_line(tmp_path: Path, server: Server) -> None:
    with pytest.raises(ModelError, match=r"the download stopped .*try again"):
        fetch("http://127.0.0.1:9/none", tmp_path / "pirlnav.ckpt", SHA256)


@pytest.mark.parametrize(
    ("url", "sha256", "code"),
    [
        ("file:///etc/passwd", SHA256, "invalid-url"),
        ("weights.ckpt", SHA256, "invalid-url"),
        ("http://127.0.0.1/", "abc", "invalid-sha256"),
        ("http://127.0.0.1/", "g" * 64, "invalid-sha256"),
    ],
)
def test_an_invalid_address_or_hash_is_refused(tmp_path: Path, url: str, sha256: str, code: str) -> None:
    with pytest.raises(UsageError) as refused:
        fetch(url, tmp_path / "pirlnav.ckpt", sha256)
    assert refused.value.code == code
