"""Authenticates requests: host name, token or cookie, origin, CSRF token.

A web page from elsewhere can make the operator's browser call this server, and a DNS name of its owner can resolve to
this machine. Every request must therefore name this server as its host and carry the cookie that only the address with
the token gives. A request that changes something must also come from one of our own pages and carry a CSRF token.
"""

import asyncio
import base64
import hashlib
import hmac
import html
import logging
import secrets
from collections.abc import Callable, Collection
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final
from urllib.parse import urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from vsnbench.web_server.session_key import SessionKey, Visitor

MAX_BODY_BYTES: Final = 64 * 1024
BODY_TIMEOUT_S: Final = 10.0
CSRF_HEADER: Final = "x-csrf-token"
_POLICY: Final = "content-security-policy"
_DEFAULT_HEADERS: Final = {
    "cache-control": "no-store",
    _POLICY: (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}
"""Added to a response that does not set them itself."""
_FORWARD: Final = "location.replace(document.getElementById('target').href + location.hash)"
_FORWARDING_PAGE: Final = (
    '<!doctype html><noscript><meta http-equiv="refresh" content="0;url={target}"></noscript>'
    '<link rel="icon" href="data:,"><title>vsnbench</title><a id="target" href="{target}"></a>'
    f"<script>{_FORWARD}</script>"
)
"""Opens the page after the token was accepted, with the part of the address that browsers send to no server.

Browsers do not send a strict cookie after a cross-site redirect.
"""
_FORWARD_DIGEST: Final = base64.b64encode(hashlib.sha256(_FORWARD.encode()).digest()).decode()
_INCOMPLETE_ADDRESS_PAGE: Final = (
    '<!doctype html><html lang="en"><meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">'
    "<title>vsnbench</title>"
    "<h1>This address is incomplete</h1><p>Open the full address from the terminal, including everything after the "
    "question mark, or scan its QR code.</p></html>"
)

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Access:
    """The rules by which a server authenticates requests."""

    key: SessionKey
    hosts: Collection[str]
    """Accepted values of the Host header, `name:port`."""
    scheme: str
    cookie_name: str
    max_body_bytes: int = MAX_BODY_BYTES
    on_authenticated: Callable[[tuple[str, int]], None] = lambda _client: None
    """Called with the client's address for each request that carries the cookie."""

    def set_cookie_header(self, visitor: Visitor) -> str:
        """Return the Set-Cookie header that identifies a visitor."""
        secure = "; Secure" if self.scheme == "https" else ""
        content = f"{self.cookie_name}={self.key.cookie(visitor)}"
        return f"{content}; Path=/; HttpOnly; SameSite=Strict; Max-Age=604800{secure}"


class AuthenticationMiddleware:
    """Passes authenticated requests to the application, with `scope["visitor"]` and `scope["access"]` set."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request or serve one web socket."""
        if scope["type"] not in ("http", "websocket"):
            return
        result = self._authenticate(HTTPConnection(scope))
        if scope["type"] == "websocket":
            if isinstance(result, Visitor):
                await self._run_app(result, scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close", "code": 1008})
            return
        # A client that breaks off within its body is disconnected here, before any part of a response is sent.
        limit = self._access.max_body_bytes if isinstance(result, Visitor) else MAX_BODY_BYTES
        body = await _read_body(receive, limit)
        send = _with_default_headers(send)
        if isinstance(result, Response):
            await result(scope, receive, send)
        elif body is None:
            await _refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)(scope, receive, send)
        else:
            await self._run_app(result, scope, _replay(body, receive), send)

    async def _run_app(self, visitor: Visitor, scope: Scope, receive: Receive, send: Send) -> None:
        if scope.get("client"):
            self._access.on_authenticated(tuple(scope["client"]))
        scope["visitor"], scope["access"] = visitor, self._access
        try:
            await self._app(scope, receive, send)
        except Exception:
            logger.exception("request for %s failed", scope["path"])

    def _authenticate(self, connection: HTTPConnection) -> Visitor | Response:
        """Return the visitor, or the response to a request that is refused or brings the token."""
        access, headers, scope = self._access, connection.headers, connection.scope
        host = _single(headers, "host").lower()
        if host not in access.hosts:
            return _refusal(HTTPStatus.MISDIRECTED_REQUEST)
        is_read = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        if not is_read and _single(headers, "origin") != f"{access.scheme}://{host}":
            return _refusal(HTTPStatus.FORBIDDEN)
        visitor = access.key.visitor(connection.cookies.get(access.cookie_name, ""))
        if is_read and access.key.is_token(connection.query_params.get("token", "")):
            visitor = visitor or Visitor(secrets.token_hex(8))
            # Scripts that send no cookies, such as Rerun's viewer, add the token to the address of a file.
            return self._accept_token(connection, visitor) if scope["path"] == "/" else visitor
        if visitor is None:
            return (
                HTMLResponse(_INCOMPLETE_ADDRESS_PAGE, HTTPStatus.FORBIDDEN)
                if is_read
                else _refusal(HTTPStatus.FORBIDDEN)
            )
        if not is_read and scope["type"] == "http":
            given = _single(headers, CSRF_HEADER).encode("latin-1", "replace")
            if not hmac.compare_digest(given, access.key.csrf_token(visitor).encode()):
                return _refusal(HTTPStatus.FORBIDDEN)
            if _single(headers, "content-type").partition(";")[0].strip() != "application/json":
                return _refusal(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        return visitor

    def _accept_token(self, connection: HTTPConnection, visitor: Visitor) -> Response:
        """Set the cookie and forward to the page, with the other parameters of the address."""
        parameters = urlencode([item for item in connection.query_params.multi_items() if item[0] != "token"])
        target = html.escape(f"/?{parameters}" if parameters else "/")
        cookie = self._access.set_cookie_header(visitor)
        policy = _DEFAULT_HEADERS[_POLICY].replace("script-src 'self'", f"script-src 'sha256-{_FORWARD_DIGEST}'")
        headers = {"set-cookie": cookie, _POLICY: policy}
        return HTMLResponse(_FORWARDING_PAGE.format(target=target), headers=headers)


async def _read_body(receive: Receive, limit_bytes: int) -> bytes | None:
    """Return the body of a request, or None if it is too long, late or incomplete."""
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_TIMEOUT_S):
            while True:
                message = await receive()
                if message["type"] != "http.request":
                    return None
                body += message.get("body", b"")
                if len(body) > limit_bytes:
                    return None
                if not message.get("more_body", False):
                    return bytes(body)
    except TimeoutError:
        return None


def _replay(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was already read."""
    messages = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return messages.pop() if messages else await receive()

    return replay


def _with_default_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _DEFAULT_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return send_with_headers


def _refusal(status: HTTPStatus) -> Response:
    return JSONResponse({"message": f"refused: {status.phrase.lower()}"}, status)


def _single(headers: Headers, name: str) -> str:
    """Return the value of a header that occurs once, or an empty string."""
    values = headers.getlist(name)
    return values[0] if len(values) == 1 else ""
