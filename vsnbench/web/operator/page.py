"""Serves the operator's page of a session, and tells the terminal its address."""

from collections.abc import Iterator
from contextlib import contextmanager

from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.web.operator.app import OperatorApp
from vsnbench.web_server.page_address import PageAddress


class OperatorPage(PageAddress):
    """The page of the operator."""

    @contextmanager
    def serve(self, prompts: OperatorPrompts, session: Session) -> Iterator[str]:
        """Serve the page while the context is entered. Yields the text that tells the terminal its address.

        Raises:
            UsageError: `port-unavailable`, `unknown-address` or `invalid-certificate`.
        """
        app = OperatorApp(prompts, session)
        with self.serve_app(app.routes(), str(session.recording.results.path.resolve()), "console") as text:
            prompts.listeners.append(app.notify)
            try:
                yield text
            finally:
                prompts.listeners.remove(app.notify)
