"""The gate and the server: who may speak to a page, and what many bad clients cannot do."""

import http.client
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route

from tests.console.browser import Browser
from vsnbench.console.pages import IN_WORDS, door_of, said_in, visitor_of
from vsnbench.console.session_key import SessionKey, Visitor
from vsnbench.console.web_server import MOST_STRANGERS, WebServer
from vsnbench.errors import UsageError


async def _who(request: Request) -> JSONResponse:
    visitor = visitor_of(request.scope)
    return JSONResponse({"number": visitor.number, "proof": door_of(request.scope).key.request_proof(visitor)})


async def _echo(request: Request) -> JSONResponse:
    return JSONResponse(await said_in(request))


APP = Starlette(routes=[Route("/", _who), Route("/echo", _echo, methods=["POST"])], exception_handlers=IN_WORDS)


@pytest.fixture(scope="module")
def server() -> Iterator[WebServer]:
    with WebServer(APP, SessionKey.new()) as running:
        yield running


@pytest.fixture
def browser(server: WebServer) -> Browser:
    entered = Browser(server.addresses[0]).enter()
    entered.proof = entered.ask("GET", "/").json["proof"]
    return entered


def test_the_address_with_its_token_gives_a_cookie_that_scripts_and_other_sites_cannot_use(server: WebServer) -> None:
    said = Browser(server.addresses[0]).ask("GET", server.addresses[0].partition(str(server.port))[2])
    assert said.status == 200
    assert all(word in said.headers["set-cookie"] for word in ("HttpOnly", "SameSite=Strict", "Path=/"))
    assert "frame-ancestors 'none'" in said.headers["content-security-policy"]


def test_without_the_token_or_with_another_nothing_is_said(server: WebServer) -> None:
    stranger = Browser(server.addresses[0])
    assert stranger.ask("GET", "/").status == 403
    assert stranger.ask("GET", "/?token=wrong").status == 403
    assert stranger.ask("GET", f"/?token={'x' * 22}").status == 403
    stranger.cookie = f"vsnbench-{server.port}={SessionKey.new().cookie(Visitor('1', 'Eve'))}"
    said = stranger.ask("GET", "/")
    assert said.status == 403
    assert b"whole address" in said.body


def test_an_address_of_very_many_words_is_one_without_a_token(server: WebServer) -> None:
    said = Browser(server.addresses[0]).ask("GET", "/?" + "&".join(f"a{number}=1" for number in range(50)))
    assert said.status == 403
    assert "set-cookie" not in said.headers


def test_the_pages_own_request_is_let_through(browser: Browser) -> None:
    assert browser.post("/echo", hello="there").json == {"hello": "there"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"X-Vsnbench-Proof": "0" * 64},
        {"X-Vsnbench-Proof": ""},
        {"Content-Type": "text/plain"},
    ],
)
def test_a_request_from_another_sites_page_is_refused(browser: Browser, wrong: dict[str, str]) -> None:
    assert browser.ask("POST", "/echo", b"{}", {**browser.own(), **wrong}).status in (403, 415)


def test_a_name_that_somebody_pointed_here_is_refused(browser: Browser) -> None:
    assert browser.ask("GET", "/", host="evil.example").status == 421
    assert browser.ask("GET", "/", host=f"evil.example:{browser.host.rpartition(':')[2]}").status == 421


def test_a_long_body_and_one_that_is_no_object_are_refused_in_words(browser: Browser) -> None:
    assert browser.ask("POST", "/echo", b"[1]", browser.own()).json["words"] == "a request must be a JSON object"
    assert browser.ask("POST", "/echo", b" " * 100_000, browser.own()).status == 413


def test_many_clients_that_never_finish_a_request_lock_nobody_out(browser: Browser) -> None:
    host, _, port = browser.host.partition(":")
    slow = []
    try:
        for _ in range(300):
            slow.append(socket.create_connection((host, int(port)), timeout=20))
            slow[-1].send(b"GET / HTTP/1.1\r\nHost: ")
        assert browser.ask("GET", "/").status == 200
        closed = 0
        deadline = time.monotonic() + 20
        while closed < 300 - MOST_STRANGERS and time.monotonic() < deadline:
            closed = 0
            for one in slow:
                one.settimeout(0.001)
                try:
                    closed += one.recv(1) == b""
                except TimeoutError:
                    continue
                except OSError:
                    closed += 1
        assert closed >= 300 - MOST_STRANGERS - 1
    finally:
        for one in slow:
            one.close()


@pytest.mark.parametrize(
    "sent",
    [
        b"POST /echo HTTP/1.1\r\nHost: %s\r\nTransfer-Encoding: chunked\r\n\r\nno length\r\n",
        b"GET / HTTP/1.1\r\nHost: %s\r\nContent-Length: 3\r\n\r\nabc\0\0 is no request\r\n\r\n",
        b"\0\0 is no request\r\n\r\n",
    ],
)
def test_what_is_no_request_or_breaks_off_into_nonsense_is_no_word_on_the_terminal(
    browser: Browser, sent: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    host, _, port = browser.host.partition(":")
    with socket.create_connection((host, int(port)), timeout=20) as one:
        one.sendall(sent.replace(b"%s", browser.host.encode()))
        heard = b"".join(iter(lambda: one.recv(4096), b""))
    assert heard.startswith(b"HTTP/1.1 4")
    assert browser.ask("GET", "/").status == 200
    assert [record.getMessage() for record in caplog.records] == []


def test_a_web_socket_needs_the_cookie_and_this_pages_origin(browser: Browser) -> None:
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


def test_a_port_that_is_taken_is_said_in_one_line(server: WebServer) -> None:
    with pytest.raises(UsageError, match=rf"port {server.port} at 127\.0\.0\.1 cannot be had.*--console-port"):
        WebServer(APP, SessionKey.new(), port=server.port)
    with pytest.raises(UsageError, match=r"name another with --port$"):
        WebServer(APP, SessionKey.new(), port=server.port, port_option="--port")


def test_a_certificate_that_is_none_is_said(tmp_path: Path) -> None:
    (tmp_path / "c.pem").write_text("no certificate")
    with pytest.raises(UsageError, match=r"certificate .*c\.pem cannot be used"):
        WebServer(APP, SessionKey.new(), certificate=tmp_path / "c.pem")


def test_the_same_purpose_has_the_same_token_again_and_nobody_else_can_read_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = SessionKey.kept("results in /data/a")
    assert SessionKey.kept("results in /data/a") == first
    assert SessionKey.kept("results in /data/b") != first
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert {file.stat().st_mode & 0o777 for file in files} == {0o600}
    for file in files:
        file.chmod(0o644)
    assert SessionKey.kept("results in /data/a") != first
