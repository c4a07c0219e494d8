"""The server of a page answers whoever has its address, under its own name, and nobody for long."""

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from vsnbench import loopback
from vsnbench.loopback import LOOPBACK, MOST_CONNECTIONS, Answer, LoopbackServer

PATIENCE_S = 10.0


def site(path: str, query: str) -> Answer:
    return loopback.page(f"{path}|{query}".encode(), "text/plain") if path != "missing" else loopback.NOT_FOUND


@pytest.fixture
def server() -> Iterator[LoopbackServer]:
    with LoopbackServer(0, site, timeout_s=0.5) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def ask(server: LoopbackServer, request: bytes) -> bytes:
    """Send bytes and return all that comes back."""
    with socket.create_connection((LOOPBACK, server.server_port), timeout=PATIENCE_S) as connection:
        connection.sendall(request)
        answer = b""
        while part := connection.recv(65536):
            answer += part
    return answer


def get(server: LoopbackServer, path: str, host: str | None = None) -> bytes:
    host = host or f"127.0.0.1:{server.server_port}"
    return ask(server, f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode("latin-1"))


def status(answer: bytes) -> int:
    return int(answer.split()[1])


def test_who_has_the_address_gets_the_page(server: LoopbackServer) -> None:
    answer = get(server, f"/{server.token}/a/b?c=d")
    assert status(answer) == 200
    assert answer.endswith(b"\r\n\r\na/b|c=d")
    assert b"Referrer-Policy: no-referrer" in answer
    assert status(get(server, f"/{server.token}/missing")) == 404
    assert status(get(server, f"/{server.token}/", f"localhost:{server.server_port}")) == 200


@pytest.mark.parametrize(
    "path", ["/", "/report.html", "/?token=", "/x/", "//", "/\xff\xfe/", "/{0}x/", "/x{0}/", "http://["]
)
def test_without_the_token_nothing_is_told(server: LoopbackServer, path: str) -> None:
    answer = get(server, path.format(server.token))
    assert status(answer) == 403
    assert server.token.encode() not in answer


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{0}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1:{0}@evil.example"]
)
def test_a_name_that_only_leads_here_is_not_ours(server: LoopbackServer, host: str) -> None:
    assert status(get(server, f"/{server.token}/", host.format(server.server_port))) == 421


def test_a_request_without_a_host_or_with_two_is_refused(server: LoopbackServer) -> None:
    line = f"GET /{server.token}/ HTTP/1.1\r\n"
    ours = f"Host: 127.0.0.1:{server.server_port}\r\n"
    assert status(ask(server, f"{line}\r\n".encode())) == 421
    assert status(ask(server, f"{line}{ours}Host: evil.example\r\n\r\n".encode())) == 421


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"\x00\x01\x02\r\n\r\n",
        b"GET /\x01\x7f HTTP/1.1\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 5\r\n\r\nhello",
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 500 + b"\r\n",
        b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n",
        b"\r\n",
    ],
)
def test_nonsense_is_refused_without_a_word_on_the_terminal(
    server: LoopbackServer, request_bytes: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    try:
        answer = ask(server, request_bytes)
    except ConnectionResetError:
        answer = b""
    assert b" 200 " not in answer
    assert status(get(server, f"/{server.token}/")) == 200
    assert capfd.readouterr() == ("", "")


def test_a_client_that_trickles_is_let_go(server: LoopbackServer) -> None:
    with socket.create_connection((LOOPBACK, server.server_port), timeout=PATIENCE_S) as connection:
        connection.settimeout(0.05)
        began = time.monotonic()
        gone = False
        while not gone and time.monotonic() < began + PATIENCE_S:
            try:
                connection.send(b"G")
                gone = connection.recv(1) == b""
            except TimeoutError:
                pass
            except OSError:
                gone = True
    assert gone


def test_connections_are_bounded_and_slow_ones_make_room(server: LoopbackServer) -> None:
    already = threading.active_count()
    idle = [
        socket.create_connection((LOOPBACK, server.server_port), timeout=PATIENCE_S) for _ in range(MOST_CONNECTIONS)
    ]
    try:
        deadline = time.monotonic() + PATIENCE_S
        while status(get_or_refused(server)) != 200 and time.monotonic() < deadline:
            pass
        assert status(get_or_refused(server)) == 200
        assert threading.active_count() - already < 2 * MOST_CONNECTIONS
    finally:
        for connection in idle:
            connection.close()


def get_or_refused(server: LoopbackServer) -> bytes:
    try:
        return get(server, f"/{server.token}/") or b"HTTP/1.0 503"
    except ConnectionResetError:
        return b"HTTP/1.0 503"


def test_while_every_thread_is_busy_a_connection_is_refused_at_once() -> None:
    with LoopbackServer(0, site, timeout_s=30) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        idle = [
            socket.create_connection((LOOPBACK, server.server_port), timeout=PATIENCE_S)
            for _ in range(MOST_CONNECTIONS)
        ]
        assert status(get_or_refused(server)) == 503
        for connection in idle:
            connection.close()
        server.shutdown()
        thread.join()


def test_a_file_is_served_whole(tmp_path: Path) -> None:
    content = bytes(range(256)) * 12_000
    (tmp_path / "file").write_bytes(content)
    answer = loopback.file(tmp_path / "file", "application/octet-stream")
    assert answer.length == len(content)
    assert b"".join(answer.body) == content
    assert loopback.file(tmp_path / "none", "text/plain") is loopback.NOT_FOUND
