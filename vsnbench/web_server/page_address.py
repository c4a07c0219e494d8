"""Address and certificate of a page that a running command serves, and the text that tells the terminal where it is."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import segno
from starlette.types import ASGIApp

from vsnbench.web_server.server import LOOPBACK, WebServer
from vsnbench.web_server.session_key import SessionKey


@dataclass(frozen=True, slots=True)
class PageAddress:
    """Address of a page, and its certificate."""

    address: str = LOOPBACK
    port: int = 8710
    certificate: Path | None = None
    private_key: Path | None = None

    @contextmanager
    def serve_app(self, app: ASGIApp, purpose: str, heading: str) -> Iterator[str]:
        """Serve an application while the context is entered. Yields the text that tells the terminal its address.

        Args:
            app: the application.
            purpose: what the address is for; the same purpose keeps its token.
            heading: the word before the address.

        Raises:
            UsageError: `port-unavailable`, `unknown-address` or `invalid-certificate`.
        """
        server = WebServer(
            app,
            SessionKey.stored(f"{purpose} {self.port}"),
            address=self.address,
            port=self.port,
            certificate=self.certificate,
            private_key=self.private_key,
        )
        with server:
            yield address_text(server, heading, with_qr_code=self.address != LOOPBACK)


def address_text(server: WebServer, heading: str, *, with_qr_code: bool) -> str:
    """Return the address for the terminal, with a QR code and a warning where phones can reach the page."""
    lines = [f"[bold]{heading}[/bold]  {server.addresses[0]}"]
    if with_qr_code:
        lines.append(qr_code(server.addresses[0]))
        if server.scheme == "http":
            lines.append(
                r"[dim]The connection is not encrypted. Set `certificate` in \[console] of vsnbench.toml.[/dim]"
            )
    return "\n".join(lines)


def qr_code(address: str) -> str:
    """Return a QR code drawn with half blocks, for a dark terminal."""
    text = io.StringIO()
    segno.make(address, micro=False).terminal(text, compact=True)
    return text.getvalue()
