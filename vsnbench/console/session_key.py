"""The secret of a page's address, and the signed cookie that a browser gets for it; both outlive a killed run.

The token lies in this machine's cache, readable by its owner alone, by what it is for: so the same command serves the
same address again, and a phone that was there is there again.
"""

import base64
import hashlib
import hmac
import json
import os
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from vsnbench.machine_cache import cache_directory, key_of

LONGEST_NAME = 60
_LONGEST_COOKIE = 1024


@dataclass(frozen=True, slots=True)
class Visitor:
    """A browser that came with the token."""

    number: str
    """Tells one browser from another."""
    name: str = ""
    """Who signed in there; empty for nobody yet."""


@dataclass(frozen=True, slots=True)
class SessionKey:
    """The token of an address, and what is signed with it."""

    token: str

    @classmethod
    def new(cls) -> Self:
        """Return one that nobody has seen."""
        return cls(secrets.token_urlsafe(16))

    @classmethod
    def kept(cls, purpose: str) -> Self:
        """Return this machine's for a purpose, a record's path for instance; made where there is none."""
        file = cache_directory() / "console" / key_of(purpose)
        try:
            found = file.read_text(encoding="ascii").strip()
            if len(found) >= 22 and file.stat().st_uid == os.getuid() and not file.stat().st_mode & 0o077:
                return cls(found)
        except (OSError, ValueError):
            pass
        key = cls.new()
        _keep_private(file, key.token)
        return key

    def is_token(self, given: str) -> bool:
        """Whether it is the address's."""
        return hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode())

    def cookie(self, visitor: Visitor) -> str:
        """Return what a browser keeps."""
        content = base64.urlsafe_b64encode(json.dumps([visitor.number, visitor.name]).encode()).decode()
        return f"{content}.{self._sign('cookie', content)}"

    def visitor(self, cookie: str) -> Visitor | None:
        """Return whose cookie it is; None for one that was not made here."""
        content, _, signature = cookie.partition(".")
        if len(cookie) > _LONGEST_COOKIE or not hmac.compare_digest(
            signature.encode("utf-8", "replace"), self._sign("cookie", content).encode()
        ):
            return None
        number, name = json.loads(base64.urlsafe_b64decode(content))
        return Visitor(number, name)

    def request_proof(self, visitor: Visitor) -> str:
        """Return what every request that changes something must say: another site's page cannot read it."""
        return self._sign("request", visitor.number)

    def _sign(self, what: str, content: str) -> str:
        return hmac.new(
            self.token.encode(), f"{what}\0{content}".encode("utf-8", "replace"), hashlib.sha256
        ).hexdigest()


def _keep_private(file: Path, token: str) -> None:
    """Keep a token for its owner alone; where that cannot be, the next run makes another."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        file.unlink(missing_ok=True)
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as opened:
            opened.write(token)
    except OSError:
        return
