"""Serves the operator's page of a session, and tells the terminal its address."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import segno

from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.web.operator.app import OperatorApp
from vsnbench.web_server.server import LOOPBACK, WebServer
from vsnbench.web_server.session_key import SessionKey


@dataclass(frozen=True, slots=True)
class OperatorPage:
    """Address of the page, and its certificate."""

    address: str = LOOPBACK
    port: int = 8710
    certificate: Path | None = None
    private_key: Path | None = None

    @contextmanager
    def serve(self, prompts: OperatorPrompts, session: Session) -> Iterator[str]:
        """Serve the page while the context is entered. Yields the text that tells the terminal its address.

        Raises:
            UsageError: `port-unavailable`, `unknown-address` or `invalid-certificate`.
        """
        app = OperatorApp(prompts, session)
        server = WebServer(
            app.routes(),
            SessionKey.stored(f"{session.recording.results.path.resolve()} {self.port}"),
            address=self.address,
            port=self.port,
            certificate=self.certificate,
            private_key=self.private_key,
        )
        with server:
            prompts.listeners.append(app.notify)
            try:
                yield address_text(server, with_qr_code=self.address != LOOPBACK)
            finally:
                prompts.listeners.remove(app.notify)


def address_text(server: WebServer, *, with_qr_code: bool) -> str:
    """Return the address for the terminal, with a QR code and a warning where phones can reach the page."""
    lines = [f"[bold]console[/bold]  {server.addresses[0]}"]
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
