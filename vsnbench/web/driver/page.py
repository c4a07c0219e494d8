"""Serves the page of a person who drives, and tells the terminal its address."""

from collections.abc import Iterator
from contextlib import contextmanager

from vsnbench.models.human.controls import Controls
from vsnbench.web.driver.app import DriverApp
from vsnbench.web_server.page_address import PageAddress


class DriverPage(PageAddress):
    """The page of the driver, on a port and with a token of its own: its address does not open the operator's page."""

    @contextmanager
    def serve(self, controls: Controls) -> Iterator[str]:
        """Serve the page while the context is entered. Yields the text that tells the terminal its address.

        Raises:
            UsageError: `port-unavailable`, `unknown-address` or `invalid-certificate`.
        """
        app = DriverApp(controls)
        with self.serve_app(app.routes(), "drive", f"{controls.driver} drives at") as text:
            controls.listeners.append(app.notify)
            controls.is_served = True
            try:
                yield text
            finally:
                controls.close()
                controls.is_served = False
                controls.listeners.remove(app.notify)
