"""A browser's side of a page without a browser: the cookie, the proof, and every way of getting them wrong."""

import http.client
import json
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit


@dataclass
class Said:
    """What the page's server answered."""

    status: int
    body: bytes
    headers: dict[str, str]

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Browser:
    """Speaks to one address; knows its cookie once it has entered."""

    address: str
    cookie: str = ""
    proof: str = ""
    timeout_s: float = 20.0
    host: str = field(init=False)

    def __post_init__(self) -> None:
        self.host = urlsplit(self.address).netloc

    def enter(self) -> "Browser":
        """Open the address with its token."""
        split = urlsplit(self.address)
        said = self.ask("GET", f"{split.path}?{split.query}")
        assert said.status == 200, said
        self.cookie = said.headers["set-cookie"].partition(";")[0]
        return self

    def ask(
        self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None, host: str = ""
    ) -> Said:
        """Send one request, as it is."""
        connection = http.client.HTTPConnection(self.host, timeout=self.timeout_s)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            given = {"Host": host or self.host, **({"Cookie": self.cookie} if self.cookie else {}), **(headers or {})}
            if body is not None:
                given.setdefault("Content-Length", str(len(body)))
            for name, value in given.items():
                connection.putheader(name, value)
            connection.endheaders(body)
            answer = connection.getresponse()
            kept = {name.lower(): value for name, value in answer.getheaders()}
            return Said(answer.status, answer.read(), kept)
        finally:
            connection.close()

    def own(self) -> dict[str, str]:
        """The headers with which the page's own script posts."""
        return {
            "Origin": f"http://{self.host}",
            "Content-Type": "application/json",
            "X-Vsnbench-Proof": self.proof,
        }

    def post(self, path: str, **said: Any) -> Said:
        """Post as the page's own script does."""
        return self.ask("POST", path, json.dumps(said).encode(), self.own())
