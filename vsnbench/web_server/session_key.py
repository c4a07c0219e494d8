"""The secret token of an address, and the cookie and CSRF token that are signed with it.

A stored token survives a killed run: the next run of the same command serves the same address, and open pages
reconnect. It is stored in the cache directory and readable by its owner only.
"""

import base64
import hashlib
import hmac
import json
import os
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

MAX_NAME_LENGTH: Final = 60
_MAX_COOKIE_LENGTH = 1024


@dataclass(frozen=True, slots=True)
class Visitor:
    """A browser that has opened the address with the token."""

    id: str
    name: str = ""
    """Name of the person who signed in; empty before that."""


@dataclass(frozen=True, slots=True)
class SessionKey:
    """The token of an address."""

    token: str

    @classmethod
    def new(cls) -> Self:
        """Return a random key."""
        return cls(secrets.token_urlsafe(16))

    @classmethod
    def stored(cls, purpose: str) -> Self:
        """Return the stored key for a purpose, for example a results directory; create it if there is none."""
        from vsnbench.files.disk_cache import cache_directory, key_of  # imports numpy, which takes 0.1 s

        file = cache_directory() / "console" / key_of(purpose)
        try:
            token = file.read_text(encoding="ascii").strip()
            if len(token) >= 22 and file.stat().st_uid == os.getuid() and not file.stat().st_mode & 0o077:
                return cls(token)
        except (OSError, ValueError):
            pass
        key = cls.new()
        _store_private(file, key.token)
        return key

    def is_token(self, text: str) -> bool:
        """Whether a text is the token, compared in constant time."""
        return hmac.compare_digest(text.encode("utf-8", "replace"), self.token.encode())

    def cookie(self, visitor: Visitor) -> str:
        """Return the signed cookie of a visitor."""
        content = base64.urlsafe_b64encode(json.dumps([visitor.id, visitor.name]).encode()).decode()
        return f"{content}.{self._sign('cookie', content)}"

    def visitor(self, cookie: str) -> Visitor | None:
        """Return the visitor of a cookie, or None if the cookie was not signed with this key."""
        content, _, signature = cookie.partition(".")
        if len(cookie) > _MAX_COOKIE_LENGTH or not hmac.compare_digest(
            signature.encode("utf-8", "replace"), self._sign("cookie", content).encode()
        ):
            return None
        visitor_id, name = json.loads(base64.urlsafe_b64decode(content))
        return Visitor(visitor_id, name)

    def csrf_token(self, visitor: Visitor) -> str:
        """Return the CSRF token of a visitor. Pages of other origins cannot read it."""
        return self._sign("request", visitor.id)

    def _sign(self, purpose: str, content: str) -> str:
        message = f"{purpose}\0{content}".encode("utf-8", "replace")
        return hmac.new(self.token.encode(), message, hashlib.sha256).hexdigest()


def _store_private(file: Path, token: str) -> None:
    """Write a token, readable by its owner only. On failure the next run uses a new token."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        file.unlink(missing_ok=True)
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as opened:
            opened.write(token)
    except OSError:
        return
