"""An HTTP client that handles a page's cookie and CSRF token as a browser does, and can get them wrong."""

import http.client
import json
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit


@dataclass
class Answer:
    """A response of the server."""

    status: int
    body: bytes
    headers: dict[str, str]

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Browser:
    """A client of one address. It has the cookie after `enter`."""

    address: str
    cookie: str = ""
    csrf_token: str = ""
    timeout_s: float = 60.0
    host: str = field(init=False)

    def __post_init__(self) -> None:
        self.host = urlsplit(self.address).netloc

    def enter(self) -> "Browser":
        """Open the address with its token."""
        split = urlsplit(self.address)
        answer = self.ask("GET", f"{split.path}?{split.query}")
        assert answer.status == 200, answer
        self.cookie = answer.headers["set-cookie"].partition(";")[0]
        return self

    def ask(
        self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None, host: str = ""
    ) -> Answer:
        """Send one request without checking it."""
        connection = http.client.HTTPConnection(self.host, timeout=self.timeout_s)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            sent = {"Host": host or self.host, **({"Cookie": self.cookie} if self.cookie else {}), **(headers or {})}
            if body is not None:
                sent.setdefault("Content-Length", str(len(body)))
            for name, value in sent.items():
                connection.putheader(name, value)
            connection.endheaders(body)
            answer = connection.getresponse()
            received = {name.lower(): value for name, value in answer.getheaders()}
            return Answer(answer.status, answer.read(), received)
        finally:
            connection.close()

    def own(self) -> dict[str, str]:
        """Return the headers of a POST from the page's own script."""
        return {
            "Origin": f"http://{self.host}",
            "Content-Type": "application/json",
            "X-CSRF-Token": self.csrf_token,
        }

    def post(self, path: str, **content: Any) -> Answer:
        """Post JSON as the page's own script does."""
        return self.ask("POST", path, json.dumps(content).encode(), self.own())
