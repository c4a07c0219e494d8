"""A phone in a person's hand: a real Chromium page of that size, what it shows, and what a thumb does on it."""

import base64
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Error, Page, Request, Response, sync_playwright

from tests.cli.chromium import EXECUTABLE
from tests.console.tcp_relay import TcpRelay

SIZE = {"width": 390, "height": 844}
PATIENCE_MS = 60_000
_SCREEN = """() => {
  const seen = (id) => { const e = document.getElementById(id); return !!e && e.getClientRects().length > 0; };
  const text = (id) => document.getElementById(id)?.innerText ?? "";
  const number = (id) => Number((text(id).match(/#(\\d+)/) ?? [0, 0])[1]);
  const refused = /whole address/.test((document.querySelector("h1")?.innerText ?? "") + text("words"));
  const name = refused ? "refused" : seen("sign-in") ? "sign-in" : seen("driving") ? "driving"
    : seen("judging") ? "judging" : seen("finish") ? "finish"
    : seen("go-card") ? (seen("moved") ? "looked" : "placing") : "waiting";
  return { name, cut: seen("offline"), asked: !!document.getElementById("ask")?.open, words: text("words"),
    episode: number(name === "judging" ? "judging" : "trial-number"), said: text("stop-words"),
    busy: !!document.getElementById("go")?.disabled,
    unjudged: [...document.querySelectorAll(".episode")].filter((one) =>
      one.querySelector("[data-amend]")?.innerText === "Judge").map((one) => Number(one.dataset.episode)) };
}"""
Name = Literal["refused", "sign-in", "waiting", "placing", "looked", "driving", "judging", "finish"]


@dataclass(frozen=True)
class Screen:
    """What is to be seen."""

    name: Name
    cut: bool
    """It says that the run does not hear it."""
    asked: bool
    """It asks whether somebody is sure."""
    words: str
    episode: int
    said: str
    """Beside STOP."""
    busy: bool
    """Go cannot be pressed now."""
    unjudged: list[int]
    """Episodes that are listed as awaiting a judgement."""


@dataclass
class Asked:
    """A request that changes something, and what came back."""

    path: str
    body: dict[str, Any]
    author: str
    at: datetime
    status: int = 0
    """0 where no answer arrived."""
    answered_at: datetime | None = None


@dataclass(eq=False)
class Phone:
    """A page, whose it is, and all that it asked for."""

    name: str
    page: Page
    relay: TcpRelay
    address: str
    """With the token, through the relay."""
    asked: list[Asked] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    """What went wrong in the page's own scripts."""
    elsewhere: list[str] = field(default_factory=list)
    """What it asked of anybody but the run."""
    thumb_ms: int = PATIENCE_MS
    """How long a thumb waits for what it wants to press."""
    _open: dict[Request, Asked] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(PATIENCE_MS)
        self.page.on("request", self._requested)
        self.page.on("response", self._answered)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))

    def screen(self) -> Screen:
        """Look."""
        return Screen(**self.page.evaluate(_SCREEN))

    def enter(self) -> None:
        """Open the address, without being known."""
        self.page.context.clear_cookies()
        self.page.goto(self.address)

    def sign_in(self) -> None:
        """Say who it is."""
        self.page.fill("#name", self.name)
        self.page.click("#sign-in-form button")
        self.page.wait_for_selector("#sign-in", state="hidden")

    def leave_network(self) -> None:
        """Lose the network, and wait until the page says so."""
        self.page.context.set_offline(True)
        self.relay.stall()
        self.page.wait_for_selector("#link.down")

    def return_to_network(self, *, cut: bool) -> None:
        """Have it again; what was under way is lost where connections were `cut`."""
        self.relay.mend(cut=cut)
        self.page.context.set_offline(False)
        self.page.wait_for_selector("#link.up")

    def press(self, selector: str) -> None:
        """Press what is to be seen."""
        self.page.click(selector, timeout=self.thumb_ms)

    def click_at(self, selector: str, moment_ms: float) -> None:
        """Press a button at a moment of this machine's clock, and do not wait for it."""
        self.page.evaluate(
            "([what, when]) => { setTimeout(() => document.querySelector(what)?.click(), when - Date.now()); }",
            [selector, moment_ms],
        )

    def fill_judgement(self, within: str, said: "Said") -> None:
        """Fill the form in which an episode is judged, but for the last button."""
        form = self.page.locator(f"{within} .judging-form")
        if said.void:
            if not form.locator("[data-name=void]").is_visible():
                form.locator("details summary").click(timeout=self.thumb_ms)
            form.locator("[data-name=void]").fill(said.void, timeout=self.thumb_ms)
            return
        form.locator(f"[data-touched={'yes' if said.touched else 'no'}]").click(timeout=self.thumb_ms)
        if said.touched:
            form.locator("[data-name=what]").fill(said.touched, timeout=self.thumb_ms)
        elif form.locator("[data-name=distance]").is_visible():
            form.locator("[data-name=distance]").fill(said.distance, timeout=self.thumb_ms)
        form.locator("[data-name=note]").fill(said.note, timeout=self.thumb_ms)

    def confirm(self, within: str, said: "Said") -> None:
        """Press the last button of the form."""
        button = "[data-void]" if said.void else "button.go"
        self.press(f"{within} .judging-form {button}")

    def typed(self, within: str) -> dict[str, str]:
        """Return what stands in the form."""
        fields = self.page.locator(f"{within} .judging-form input")
        return dict(fields.evaluate_all("all => all.map(one => [one.dataset.name, one.value])"))

    def told_of_cookies(self) -> bytes:
        """Return what the browser keeps, decoded as far as it can be."""
        kept = b""
        for one in self.page.context.cookies():
            value = str(one.get("value", ""))
            kept += value.encode() + base64.urlsafe_b64decode(value.partition(".")[0] + "==")
        return kept

    def _requested(self, request: Request) -> None:
        address = urlsplit(request.url)
        if address.netloc != urlsplit(self.address).netloc and address.scheme not in ("blob", "data"):
            self.elsewhere.append(request.url)
        if request.method == "POST":
            asked = Asked(address.path, request.post_data_json or {}, self.name, datetime.now(UTC))
            self.asked.append(asked)
            self._open[request] = asked

    def _answered(self, response: Response) -> None:
        if (asked := self._open.pop(response.request, None)) is not None:
            asked.status, asked.answered_at = response.status, datetime.now(UTC)


@dataclass(frozen=True)
class Said:
    """What a person says of an episode; the note tells it from everything else that is said."""

    note: str
    touched: str = ""
    distance: str = ""
    void: str = ""

    @property
    def success(self) -> bool | None:
        """What must come of it; None for void. Only where a distance or a touch says so."""
        if self.void:
            return None
        return not self.touched and float(re.sub(r" cm$", "e-2", self.distance)) < 1.0


@contextmanager
def chromium_of_phones(*routes: tuple[str, TcpRelay, int]) -> Iterator[Browser]:
    """Open a browser that reaches nothing but relays.

    Args:
        routes: host as it is typed, the relay that it leads to, and the port that is typed.
    """
    rules = [f"MAP {host}:{port} 127.0.0.1:{relay.port}" for host, relay, port in routes]
    flags = [
        f"--host-resolver-rules={','.join([*rules, 'MAP * ~NOTFOUND'])}",
        "--no-sandbox",
        "--disable-dev-shm-usage",
    ]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=flags)
        try:
            yield browser
        finally:
            browser.close()


def phone_in(browser: Browser, name: str, host: str, relay: TcpRelay, address: str, **options: Any) -> Phone:
    """Return a phone, which has opened nothing yet."""
    options = {"viewport": SIZE, "device_scale_factor": 2, "is_mobile": True, "has_touch": True} | options
    page = browser.new_context(**options).new_page()
    return Phone(name, page, relay, address.replace("127.0.0.1", host))


def gone(error: Error) -> bool:
    """Whether a click found nothing to press: the page showed something else meanwhile."""
    return any(
        words in str(error) for words in ("Timeout", "detached", "not visible", "navigation", "Execution context")
    )
