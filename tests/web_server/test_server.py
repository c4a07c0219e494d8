"""Authentication of requests, limits of connections, and errors of the web server."""

import http.client
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from tests.processes import wait_until
from tests.web.browser import Browser
from vsnbench.errors import UsageError
from vsnbench.web_server.connections import MAX_UNAUTHENTICATED
from vsnbench.web_server.pages import ERROR_HANDLERS, csrf_token_for, json_body, visitor_of
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey, Visitor


async def _identity(request: Request) -> JSONResponse:
    return JSONResponse({"id": visitor_of(request).id, "csrf_token": csrf_token_for(request)})


async def _echo(request: Request) -> JSONResponse:
    return JSONResponse(await json_body(request))


def _own_policy(_request: Request) -> Response:
    return Response(headers={"content-security-policy": "default-src 'self'"})


def _failing(_request: Request) -> Response:
    raise ZeroDivisionError


APP = Starlette(
    routes=[
        Route("/", _identity),
        Route("/echo", _echo, methods=["POST"]),
        Route("/own-policy", _own_policy),
        Route("/failing", _failing),
    ],
    exception_handlers=ERROR_HANDLERS,
)


@pytest.fixture(scope="module")
def server() -> Iterator[WebServer]:
    with WebServer(APP, SessionKey.new()) as running:
        yield running


@pytest.fixture
def browser(server: WebServer) -> Browser:
    entered = Browser(server.addresses[0]).enter()
    entered.csrf_token = entered.ask("GET", "/").json["csrf_token"]
    return entered


def test_the_token_gives_a_cookie_that_other_sites_cannot_use(server: WebServer) -> None:
    answer = Browser(server.addresses[0]).ask("GET", server.addresses[0].partition(str(server.port))[2])
    assert answer.status == 200
    assert all(word in answer.headers["set-cookie"] for word in ("HttpOnly", "SameSite=Strict", "Path=/"))
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]


def test_other_parameters_of_the_address_are_kept_and_escaped(server: WebServer) -> None:
    path = server.addresses[0].partition(str(server.port))[2]
    answer = Browser(server.addresses[0]).ask("GET", f"{path}&renderer=webgl&x=%22%3E%3Cscript%3E")
    assert b'content="0;url=/?renderer=webgl&amp;x=%22%3E%3Cscript%3E"' in answer.body


def test_the_token_gives_files_without_a_cookie_but_changes_nothing(server: WebServer) -> None:
    token = server.addresses[0].partition("?")[2]
    stranger = Browser(server.addresses[0])
    assert stranger.ask("GET", f"/own-policy?{token}").status == 200
    assert stranger.ask("POST", f"/echo?{token}", b"{}", stranger.own()).status == 403


def test_without_the_token_every_request_is_refused(server: WebServer) -> None:
    stranger = Browser(server.addresses[0])
    for path in ("/", "/?token=wrong", f"/?token={'x' * 22}", "/?" + "&".join(f"a{n}=1" for n in range(50)), "//"):
        answer = stranger.ask("GET", path)
        assert answer.status == 403
        assert "set-cookie" not in answer.headers
    stranger.cookie = f"vsnbench-{server.port}={SessionKey.new().cookie(Visitor('1', 'Eve'))}"
    assert stranger.ask("GET", "/").status == 403


def test_requests_of_our_own_pages_are_accepted(browser: Browser) -> None:
    assert browser.post("/echo", hello="there").json == {"hello": "there"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"X-CSRF-Token": "0" * 64},
        {"X-CSRF-Token": ""},
        {"Content-Type": "text/plain"},
    ],
)
def test_requests_of_other_sites_are_refused(browser: Browser, wrong: dict[str, str]) -> None:
    assert browser.ask("POST", "/echo", b"{}", {**browser.own(), **wrong}).status in (403, 415)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{0}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1:{0}@evil.example"]
)
def test_other_host_names_are_refused(browser: Browser, host: str) -> None:
    assert browser.ask("GET", "/", host=host.format(browser.host.rpartition(":")[2])).status == 421


def test_two_host_names_are_refused(browser: Browser) -> None:
    assert exchange(browser, b"GET / HTTP/1.1\r\nHost: %s\r\nHost: evil.example\r\n\r\n").startswith(b"HTTP/1.1 4")


def test_bodies_that_are_too_long_or_not_objects_are_refused(browser: Browser) -> None:
    assert browser.ask("POST", "/echo", b"[1]", browser.own()).status == 400
    assert browser.ask("POST", "/echo", b" " * 100_000, browser.own()).status == 413


def test_a_page_can_set_its_own_security_policy(browser: Browser) -> None:
    headers = browser.ask("GET", "/own-policy").headers
    assert headers["content-security-policy"] == "default-src 'self'"
    assert headers["x-content-type-options"] == "nosniff"


def test_a_failing_page_answers_500_and_is_logged(browser: Browser, caplog: pytest.LogCaptureFixture) -> None:
    assert browser.ask("GET", "/failing").status == 500
    wait_until(lambda: bool(caplog.records), "the error is logged")
    assert [record.exc_info and record.exc_info[0] for record in caplog.records] == [ZeroDivisionError]


def test_many_unfinished_requests_do_not_lock_out_the_operator(browser: Browser) -> None:
    host, _, port = browser.host.partition(":")
    with ExitStack() as stack:
        slow = []
        for _ in range(300):
            slow.append(stack.enter_context(socket.create_connection((host, int(port)), timeout=20)))
            slow[-1].send(b"GET / HTTP/1.1\r\nHost: ")
        assert browser.ask("GET", "/").status == 200
        deadline = time.monotonic() + 20
        while (closed := sum(map(is_closed, slow))) < 300 - MAX_UNAUTHENTICATED and time.monotonic() < deadline:
            pass
        assert closed >= 300 - MAX_UNAUTHENTICATED - 1


def test_a_client_that_sends_byte_by_byte_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsnbench.web_server.connections.AUTHENTICATION_TIMEOUT_S", 0.3)
    with WebServer(APP, SessionKey.new()) as server, socket.create_connection(("127.0.0.1", server.port)) as client:
        deadline = time.monotonic() + 10
        while not is_closed(client):
            assert time.monotonic() < deadline
            client.send(b"G")


def is_closed(client: socket.socket) -> bool:
    """Whether the server has closed a connection on which it has nothing to send."""
    client.settimeout(0.001)
    try:
        return client.recv(1) == b""
    except TimeoutError:
        return False
    except OSError:
        return True


def exchange(browser: Browser, sent: bytes) -> bytes:
    """Send bytes, with the server's host name in place of %s, and return the whole answer."""
    host, _, port = browser.host.partition(":")
    with socket.create_connection((host, int(port)), timeout=20) as client:
        client.sendall(sent.replace(b"%s", browser.host.encode()))
        client.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: client.recv(4096), b""))


@pytest.mark.parametrize(
    "sent",
    [
        b"POST /echo HTTP/1.1\r\nHost: %s\r\nTransfer-Encoding: chunked\r\n\r\nno length\r\n",
        b"GET / HTTP/1.1\r\nHost: %s\r\nTransfer-Encoding: chunked\r\n\r\nno length\r\n",
        b"GET / HTTP/1.1\r\nHost: %s\r\nContent-Length: 3\r\n\r\nabc\0\0 garbage\r\n\r\n",
        b"POST /echo HTTP/1.1\r\nHost: %s\r\nTransfer-Encoding: chunked\r\n\r\n11170\r\n" + b"x" * 70_000 + b"garbage",
        b"\0\0 garbage\r\n\r\n",
        b"GET /\x01\x7f HTTP/1.1\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 5000 + b"\r\n",
        b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n",
    ],
)
@pytest.mark.parametrize("has_cookie", [False, True])
def test_invalid_requests_are_refused_and_not_logged(
    browser: Browser,
    sent: bytes,
    has_cookie: bool,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    if has_cookie:
        sent = sent.replace(b"Host: %s\r\n", f"Host: %s\r\nCookie: {browser.cookie}\r\n".encode())
    try:
        answer = exchange(browser, sent)
    except ConnectionError:
        answer = b""
    assert b" 200 " not in answer or (has_cookie and b"abc" in sent)
    assert browser.ask("GET", "/").status == 200
    assert caplog.records == []
    assert capfd.readouterr() == ("", "")


def test_a_web_socket_needs_the_cookie_and_our_own_origin(browser: Browser) -> None:
    host, _, port = browser.host.partition(":")
    connection = http.client.HTTPConnection(host, int(port), timeout=20)
    upgrade = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw==",
        "Sec-WebSocket-Version": "13",
        "Origin": f"http://{browser.host}",
    }
    for headers in (upgrade, {**upgrade, "Cookie": browser.cookie, "Origin": "http://evil.example"}):
        connection.request("GET", "/live", headers=headers)
        assert connection.getresponse().status == 403
        connection.close()


def test_a_port_in_use_is_an_error_that_names_it(server: WebServer) -> None:
    with pytest.raises(UsageError, match=str(server.port)) as error:
        WebServer(APP, SessionKey.new(), port=server.port)
    assert error.value.code == "port-unavailable"


def test_an_address_of_another_machine_is_an_error() -> None:
    with pytest.raises(UsageError) as error:
        WebServer(APP, SessionKey.new(), address="192.0.2.1")
    assert error.value.code == "unknown-address"


def test_an_invalid_certificate_is_an_error_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "c.pem").write_text("no certificate")
    for files in ({"certificate": tmp_path / "c.pem"}, {"private_key": tmp_path / "c.pem"}):
        with pytest.raises(UsageError) as error:
            WebServer(APP, SessionKey.new(), **files)
        assert error.value.code == "invalid-certificate"


def test_a_closed_server_releases_its_port() -> None:
    with WebServer(APP, SessionKey.new()) as first:
        pass
    WebServer(APP, SessionKey.new(), port=first.port).close()


def test_a_stored_key_is_the_same_again_and_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = SessionKey.stored("results in /data/a")
    assert SessionKey.stored("results in /data/a") == first
    assert SessionKey.stored("results in /data/b") != first
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert {file.stat().st_mode & 0o777 for file in files} == {0o600}
    for file in files:
        file.chmod(0o644)
    assert SessionKey.stored("results in /data/a") != first
