"""The gate before every page: this machine's name, the token or its cookie, this page's own requests, bounded bodies.

Any page on the Web can make a browser call this machine, and a name that its owner points here makes such a call look
like one to that page's own server. So a request must name this machine as its host; it needs the cookie, which only
the address with the token gives; and one that changes something must come from this very page and prove that it could
read it.
"""

import asyncio
import hmac
import json
import secrets
from collections.abc import Callable, Collection
from dataclasses import dataclass
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from vsnbench.console.session_key import SessionKey, Visitor

MOST_BODY_BYTES = 64 * 1024
BODY_TIMEOUT_S = 10.0
PROOF_HEADER = "x-vsnbench-proof"
_HEADERS = (
    (b"cache-control", b"no-store"),
    (
        b"content-security-policy",
        (
            b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
            b"base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        ),
    ),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
)
_ENTERED = (
    b'<!doctype html><meta http-equiv="refresh" content="0;url=/"><link rel="icon" href="data:,">'
    b"<title>vsnbench</title>"
)
"""A page that goes on by itself: after a redirect from elsewhere a strict cookie would not be sent."""
_NO_KEY = (
    b'<!doctype html><html lang="en"><meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">'
    b"<title>vsnbench</title>"
    b"<h1>This page needs its whole address</h1><p>Open the address that the terminal shows, with everything after the "
    b"question mark, or scan its code.</p></html>"
)


@dataclass(frozen=True, slots=True)
class Door:
    """What the gate knows of the server that it stands before."""

    key: SessionKey
    hosts: Collection[str]
    """What a browser may call it, `name:port`."""
    scheme: str
    cookie_name: str
    most_body_bytes: int = MOST_BODY_BYTES
    trusted: Callable[[tuple[str, int]], None] = lambda _client: None
    """Told of a connection that has shown its cookie."""


class Gate:
    """Lets requests through to the pages, with the visitor in `scope["visitor"]`."""

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self._app = app
        self._door = door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check who asks, and pass it on."""
        if scope["type"] not in ("http", "websocket"):
            return
        refusal, visitor = self._check(scope)
        if refusal is not None:
            await _refuse(scope, receive, send, refusal)
            return
        if visitor is None:
            await self._enter(scope, send)
            return
        if scope.get("client"):
            self._door.trusted(tuple(scope["client"]))
        scope["visitor"] = visitor
        scope["door"] = self._door
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
            return
        body = await _whole_body(receive, self._door.most_body_bytes) if scope["method"] != "GET" else b""
        if body is None:
            await _refuse(scope, receive, send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        await self._app(scope, _body_then(receive, body), _with_headers(send))

    def _check(self, scope: Scope) -> tuple[HTTPStatus | None, Visitor | None]:
        """Return why a request is refused, and whose it is; neither for one that brings the token."""
        door, headers = self._door, scope["headers"]
        hosts = [value.decode("latin-1").lower() for name, value in headers if name == b"host"]
        if len(hosts) != 1 or hosts[0] not in door.hosts:
            return HTTPStatus.MISDIRECTED_REQUEST, None
        origin = _header(headers, b"origin")
        own_page = origin == f"{door.scheme}://{hosts[0]}"
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        if not reads and not own_page:
            return HTTPStatus.FORBIDDEN, None
        visitor = door.key.visitor(_cookie(headers, door.cookie_name))
        if reads and scope["path"] == "/" and door.key.is_token(_given_token(scope["query_string"])):
            return None, None
        if visitor is None:
            return HTTPStatus.FORBIDDEN, None
        if not reads and scope["type"] == "http":
            proof = _header(headers, PROOF_HEADER.encode())
            typed = _header(headers, b"content-type").partition(";")[0].strip()
            if not hmac.compare_digest(proof.encode("latin-1", "replace"), door.key.request_proof(visitor).encode()):
                return HTTPStatus.FORBIDDEN, None
            if typed != "application/json":
                return HTTPStatus.UNSUPPORTED_MEDIA_TYPE, None
        return None, visitor

    async def _enter(self, scope: Scope, send: Send) -> None:
        """Give whoever brought the token a cookie; one that has it already keeps it, with its name."""
        door = self._door
        known = door.key.visitor(_cookie(scope["headers"], door.cookie_name))
        value = set_cookie(door, known or Visitor(secrets.token_hex(8)))
        await _send_whole(
            send, HTTPStatus.OK, _ENTERED, b"text/html; charset=utf-8", ((b"set-cookie", value.encode()),)
        )


def set_cookie(door: Door, visitor: Visitor) -> str:
    """Return the header that makes a browser keep who it is."""
    secure = "; Secure" if door.scheme == "https" else ""
    return f"{door.cookie_name}={door.key.cookie(visitor)}; Path=/; HttpOnly; SameSite=Strict; Max-Age=604800{secure}"


def _given_token(query: bytes) -> str:
    """Return the token in an address; empty without one, and where there are more words than any of ours has."""
    try:
        return parse_qs(query.decode("latin-1"), max_num_fields=8).get("token", [""])[0]
    except ValueError:
        return ""


async def _whole_body(receive: Receive, most_bytes: int) -> bytes | None:
    """Return a request's body; None where it is too long, or does not arrive in time."""
    parts: list[bytes] = []
    length = 0
    try:
        async with asyncio.timeout(BODY_TIMEOUT_S):
            while True:
                message = await receive()
                if message["type"] != "http.request":
                    return None
                parts.append(message.get("body", b""))
                length += len(parts[-1])
                if length > most_bytes:
                    return None
                if not message.get("more_body", False):
                    return b"".join(parts)
    except TimeoutError:
        return None


def _body_then(receive: Receive, body: bytes) -> Receive:
    waiting = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return waiting.pop() if waiting else await receive()

    return replay


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", []), *_HEADERS]
        await send(message)

    return sending


async def _refuse(scope: Scope, receive: Receive, send: Send, status: HTTPStatus) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
    elif scope["method"] in ("GET", "HEAD") and status is HTTPStatus.FORBIDDEN:
        await _send_whole(send, status, _NO_KEY, b"text/html; charset=utf-8")
    else:
        said = json.dumps({"words": f"refused: {status.phrase.lower()}"}).encode()
        await _send_whole(send, status, said, b"application/json")


async def _send_whole(
    send: Send, status: HTTPStatus, body: bytes, content_type: bytes, headers: tuple[tuple[bytes, bytes], ...] = ()
) -> None:
    length = (b"content-length", str(len(body)).encode())
    start = [(b"content-type", content_type), length, *headers, *_HEADERS]
    await send({"type": "http.response.start", "status": int(status), "headers": start})
    await send({"type": "http.response.body", "body": body})


def _header(headers: list[tuple[bytes, bytes]], name: bytes) -> str:
    """Return a header that was sent once; empty else."""
    found = [value for known, value in headers if known == name]
    return found[0].decode("latin-1") if len(found) == 1 else ""


def _cookie(headers: list[tuple[bytes, bytes]], name: str) -> str:
    try:
        found = SimpleCookie(_header(headers, b"cookie")).get(name)
    except CookieError:
        return ""
    return found.value if found else ""
