"""Random invalid requests for the pages of vsnbench."""

import json
import random
import threading
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from tests.web.browser import Browser

_ANY_PAGE = (
    *(
        "/",
        "/state",
        "/live",
        "//",
        "*",
        "/assets/../page.py",
        "/assets/%2e%2e/page.py",
        "/shared/..%2f..%2fetc/passwd",
    ),
    *("/?token=", "/?token=%ff%fe", "/x\x00y", "/" + "a" * 9000, "http://evil.example/state", "/../../etc/passwd"),
)
METHODS = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "TRACE", "CONNECT", "PATCH", "get", "G\x00T", "X" * 300)
VALUES: tuple[Any, ...] = (
    *(None, -1, 1, 2**40, 1.5, 1e308, "go", "skip", "end", "x" * 600, [], {}, True, "\u202e\ud7ff", "0.5", {"a": [1]}),
    *("' OR 1=1 --", "<script>", "\x00", "84", "no", "look", "turn"),
)


_SHARE_WELL_FORMED = 0.4


@dataclass(frozen=True, slots=True)
class Page:
    """What the requests for a page are made of."""

    paths: tuple[str, ...]
    names: tuple[str, ...] = ()
    """Fields of its JSON requests."""
    values: tuple[Any, ...] = VALUES
    changes: tuple[str, ...] = ()
    """Requests that are always allowed, so they are sent without a valid CSRF token or cookie only."""

    @property
    def all_paths(self) -> tuple[str, ...]:
        """Its own paths, and some that no page has."""
        return (*self.paths, *_ANY_PAGE)


CONSOLE = Page(
    paths=(
        *("/plan.svg", "/picture", "/sign-in", "/answer", "/judge", "/stop", "/pause", "/placing", "/live"),
        *("/placing/camera", "/placing/../..", "/episodes", "/episodes/1/frames/1", "/summary", "/amend", "/undo"),
        *("/episodes/-1/frames/99999999999999999999", "/assets/operator.js"),
    ),
    names=(
        *("question", "answer", "episode", "seen", "touched", "distance", "void", "confirmed", "name", "action"),
        *("note", "felt"),
    ),
    changes=("/stop", "/pause", "/live"),
)


class Requests:
    """Generates requests. Thread-safe."""

    def __init__(self, browser: Browser, chance: random.Random, page: Page = CONSOLE) -> None:
        self._browser = browser
        self._page = page
        self._chance = chance
        self._lock = threading.Lock()
        self._host = urlsplit(browser.address).netloc

    def next(self) -> tuple[bytes, str]:
        """Return the bytes of a request, and how the client ends it: `whole`, `cut` off, or `open` until the answer."""
        with self._lock:
            return self._next()

    def _next(self) -> tuple[bytes, str]:
        chance = self._chance
        path = chance.choice(self._page.all_paths)
        if chance.random() < _SHARE_WELL_FORMED:
            return self._well_formed(path), "open"
        method = chance.choices(METHODS, [8, 14, *[1] * (len(METHODS) - 2)])[0]
        is_change = path in self._page.changes
        if path == "/live" and chance.random() < 0.7:
            return self._socket(), chance.choice(["whole", "cut"])
        body = self._body()
        lines = [f"{method} {path} HTTP/{chance.choice(['1.1', '1.1', '1.1', '1.0', '2.0', '9'])}"]
        lines += self._host_lines() + self._cookie_lines() + self._origin_lines(is_change=is_change)
        kind = chance.choice(
            ["application/json", "application/json", "text/plain", "", "multipart/form-data; boundary=x"]
        )
        lines += [f"Content-Type: {kind}"] if kind else []
        lines += self._length_lines(body)
        lines += chance.choices(
            [
                [],
                ["Expect: 100-continue"],
                ["Range: bytes=0-1"],
                ["X: " + "y" * chance.randrange(20_000)],
                ["Bad Header: 1"],
            ],
            [12, 1, 1, 1, 1],
        )[0]
        lines.append("Connection: close")
        sent = "\r\n".join(lines).encode("utf-8", "surrogatepass") + b"\r\n\r\n" + body
        if chance.random() < 0.1:
            return sent[: chance.randrange(1, len(sent))], "cut"
        if chance.random() < 0.03:
            return chance.randbytes(chance.randrange(1, 3000)), "whole"
        return sent, "whole"

    def _well_formed(self, path: str) -> bytes:
        """Return a request as the page's own script sends it, with invalid content, or with a forged token."""
        method = self._chance.choice(["GET", "POST"])
        body = self._body() if method == "POST" else b""
        token = "0" * 64 if path in self._page.changes else self._browser.csrf_token
        lines = [f"{method} {path} HTTP/1.1", f"Host: {self._host}", f"Cookie: {self._browser.cookie}"]
        lines += [f"Origin: http://{self._host}", f"X-CSRF-Token: {token}", "Content-Type: application/json"]
        lines += [f"Content-Length: {len(body)}", "Connection: close"]
        return "\r\n".join(lines).encode() + b"\r\n\r\n" + body

    def _host_lines(self) -> list[str]:
        port = self._host.rpartition(":")[2]
        other = [
            ["Host: evil.example"],
            [f"Host: evil.example:{port}"],
            [],
            [f"Host: {self._host}"] * 2,
            ["Host: 127.0.0.1"],
        ]
        return self._chance.choices([[f"Host: {self._host}"], *other], [12, 1, 1, 1, 1, 1])[0]

    def _cookie_lines(self) -> list[str]:
        name, _, value = self._browser.cookie.partition("=")
        content, _, signature = value.partition(".")
        wrong = [
            *(f"{name}={content}.{'0' * 64}", f"{name}={content}", f"{name}=.{signature}", f"{name}={'A' * 5000}.x"),
            *(f"{name}=\u00e9.\u00e9", "=;=;=", f"{name}={content}.{signature}x", "a" * 9000),
        ]
        chosen = self._chance.choices([self._browser.cookie, "", *wrong], [10, 3, *[1] * len(wrong)])[0]
        return [f"Cookie: {chosen}"] if chosen else []

    def _origin_lines(self, *, is_change: bool) -> list[str]:
        own, token = f"http://{self._host}", self._browser.csrf_token
        origins = self._chance.choices([own, "http://evil.example", "null", "", own + ".evil"], [10, 1, 1, 1, 1])[0]
        wrong_tokens = ["0" * 64, "", token[:-1], "\u00e9" * 64]
        sent = self._chance.choice(wrong_tokens) if is_change or self._chance.random() < 0.2 else token
        return [*([f"Origin: {origins}"] if origins else []), f"X-CSRF-Token: {sent}"]

    def _length_lines(self, body: bytes) -> list[str]:
        right = [f"Content-Length: {len(body)}"]
        wrong = [[f"Content-Length: {len(body) + 9}"], ["Content-Length: -1"], ["Content-Length: abc"], [], right * 2]
        wrong += [
            ["Transfer-Encoding: chunked"],
            ["Content-Length: 99999999999999"],
            [*right, "Transfer-Encoding: chunked"],
        ]
        return self._chance.choices([right, *wrong], [24, *[1] * len(wrong)])[0]

    def _body(self) -> bytes:
        chance = self._chance
        draw = chance.random()
        if draw < 0.6:
            names, values = self._page.names or ("x",), self._page.values
            content = {chance.choice(names): chance.choice(values) for _ in range(chance.randrange(5))}
            if "question" in names:
                content["question"] = chance.choice([*values, chance.randrange(2**31)])
            if "episode" in names and ("episode" in content or chance.random() < 0.5):
                content["episode"] = chance.choice([999, -1, "1", None, 2**31, 2**63])
            return json.dumps(content).encode()
        if draw < 0.7:
            return b"[" * chance.randrange(1, 50_000)
        if draw < 0.75:
            return b'{"name": "' + b"x" * chance.randrange(200_000) + b'"}'
        return chance.randbytes(chance.randrange(400)) if draw < 0.9 else b""

    def _socket(self) -> bytes:
        """Return the handshake of a web socket and invalid frames."""
        chance = self._chance
        key = chance.choice(["dGhlIHNhbXBsZSBub25jZQ==", "", "x", "\u00e9"])
        lines = ["GET /live HTTP/1.1", *self._host_lines(), *self._cookie_lines(), *self._origin_lines(is_change=True)]
        version = chance.choice(["13", "13", "8", ""])
        lines += ["Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}"]
        lines.append(f"Sec-WebSocket-Version: {version}")
        frames = b"".join(self._frame() for _ in range(chance.randrange(6)))
        return "\r\n".join(lines).encode("utf-8") + b"\r\n\r\n" + frames

    def _frame(self) -> bytes:
        chance = self._chance
        content = chance.choice(
            [b"{}", b"[1]", b'{"heartbeat": "x"}', b'{"heartbeat": 1}', b"\xff\xfe", b"", b"{" * 100, b"null"]
        )
        mask = bytes(4)
        head = bytes([chance.choice([0x81, 0x82, 0x88, 0x89, 0x80, 0x0F, 0xFF])])
        if chance.random() < 0.2:
            return head + bytes([0x80 | 127]) + (2**40).to_bytes(8, "big") + mask
        return head + bytes([0x80 | len(content)]) + mask + content
