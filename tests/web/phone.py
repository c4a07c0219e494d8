"""A phone: a Chromium page of its size, the state of its screen, and touches on it."""

import base64
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Error, Page, Request, Response, sync_playwright

from tests.cli.chromium import EXECUTABLE, FLAGS, WITHOUT_WEBGL
from tests.web.tcp_relay import TcpRelay

SIZE = {"width": 390, "height": 844}
PATIENCE_MS = 60_000
_SCREEN = """() => {
  const seen = (id) => { const e = document.getElementById(id); return !!e && e.getClientRects().length > 0; };
  const text = (id) => document.getElementById(id)?.innerText ?? "";
  const number = (id) => Number((text(id).match(/#(\\d+)/) ?? [0, 0])[1]);
  const refused = /address is incomplete/.test((document.querySelector("h1")?.innerText ?? "") + text("message"));
  const name = refused ? "refused" : seen("sign-in") ? "sign-in" : seen("driving") ? "driving"
    : seen("judging") ? "judging" : seen("finish") ? "finish"
    : seen("go-card") ? (seen("moved") ? "measured" : "placing") : "waiting";
  return { name, is_cut: seen("offline"), has_dialog: !!document.getElementById("dialog")?.open,
    message: text("message"),
    episode: number(name === "judging" ? "judging" : "trial-number"), stop_text: text("stop-text"),
    is_busy: !!document.getElementById("go")?.disabled,
    unjudged: [...document.querySelectorAll(".episode")].filter((card) =>
      card.querySelector("[data-amend]")?.innerText === "Judge").map((card) => Number(card.dataset.episode)) };
}"""
Name = Literal["refused", "sign-in", "waiting", "placing", "measured", "driving", "judging", "finish"]


@dataclass(frozen=True)
class Screen:
    """The state of the page."""

    name: Name
    is_cut: bool
    """The page shows that it is not connected."""
    has_dialog: bool
    """The page asks for a confirmation."""
    message: str
    episode: int
    stop_text: str
    is_busy: bool
    """The Start button is disabled."""
    unjudged: list[int]
    """Listed episodes that await a judgement."""


@dataclass
class PostRequest:
    """A POST request of the page, and its answer."""

    path: str
    body: dict[str, Any]
    author: str
    at: datetime
    status: int = 0
    """0 if no answer arrived."""
    answered_at: datetime | None = None


@dataclass(eq=False)
class Phone:
    """A page, its operator, and its requests."""

    name: str
    page: Page
    relay: TcpRelay
    address: str
    """Address with the token, through the relay."""
    requests: list[PostRequest] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    """Errors in the page's scripts."""
    other_hosts: list[str] = field(default_factory=list)
    """Requests to other hosts."""
    press_timeout_ms: int = PATIENCE_MS
    """Time to wait for a button."""
    _open: dict[Request, PostRequest] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(PATIENCE_MS)
        self.page.on("request", self._requested)
        self.page.on("response", self._answered)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))

    def screen(self) -> Screen:
        """Return the state of the page."""
        return Screen(**self.page.evaluate(_SCREEN))

    def enter(self) -> None:
        """Open the address without a cookie."""
        self.page.context.clear_cookies()
        self.page.goto(self.address)

    def sign_in(self) -> None:
        """Sign in."""
        self.page.fill("#name", self.name)
        self.page.click("#sign-in-form button")
        self.page.wait_for_selector("#sign-in", state="hidden")

    def leave_network(self) -> None:
        """Disconnect the phone, and wait until the page shows it."""
        self.page.context.set_offline(True)
        self.relay.stall()
        self.page.wait_for_selector("#link.down")

    def return_to_network(self, *, cut: bool) -> None:
        """Connect the phone again. With `cut`, data in transit are lost."""
        self.relay.mend(cut=cut)
        self.page.context.set_offline(False)
        self.page.wait_for_selector("#link.up")

    def press(self, selector: str) -> None:
        """Press a visible button."""
        self.page.click(selector, timeout=self.press_timeout_ms)

    def click_at(self, selector: str, time_ms: float) -> None:
        """Press a button at a time of this machine's clock, without waiting."""
        self.page.evaluate(
            "([what, when]) => { setTimeout(() => document.querySelector(what)?.click(), when - Date.now()); }",
            [selector, time_ms],
        )

    def fill_judgement(self, within: str, given: "GivenJudgement") -> None:
        """Fill in the judging form without sending it."""
        form = self.page.locator(f"{within} .judging-form")
        if given.void:
            if not form.locator("[data-name=void]").is_visible():
                form.locator("details summary").click(timeout=self.press_timeout_ms)
            form.locator("[data-name=void]").fill(given.void, timeout=self.press_timeout_ms)
            form.locator("[data-name=note]").fill(given.note, timeout=self.press_timeout_ms)
            return
        form.locator(f"[data-touched={'yes' if given.touched else 'no'}]").click(timeout=self.press_timeout_ms)
        if given.touched:
            form.locator("[data-name=what]").fill(given.touched, timeout=self.press_timeout_ms)
        elif form.locator("[data-name=distance]").is_visible():
            form.locator("[data-name=distance]").fill(given.distance, timeout=self.press_timeout_ms)
        form.locator("[data-name=note]").fill(given.note, timeout=self.press_timeout_ms)

    def confirm(self, within: str, given: "GivenJudgement") -> None:
        """Send the form."""
        button = "[data-void]" if given.void else "button.go"
        self.press(f"{within} .judging-form {button}")

    def typed(self, within: str) -> dict[str, str]:
        """Return the values in the form."""
        fields = self.page.locator(f"{within} .judging-form input")
        return dict(fields.evaluate_all("inputs => inputs.map(input => [input.dataset.name, input.value])"))

    def cookies(self) -> bytes:
        """Return the content of all cookies, decoded where possible."""
        content = b""
        for cookie in self.page.context.cookies():
            value = str(cookie.get("value", ""))
            content += value.encode() + base64.urlsafe_b64decode(value.partition(".")[0] + "==")
        return content

    def _requested(self, request: Request) -> None:
        address = urlsplit(request.url)
        if address.netloc != urlsplit(self.address).netloc and address.scheme not in ("blob", "data"):
            self.other_hosts.append(request.url)
        if request.method == "POST":
            post = PostRequest(address.path, request.post_data_json or {}, self.name, datetime.now(UTC))
            self.requests.append(post)
            self._open[request] = post

    def _answered(self, response: Response) -> None:
        if (post := self._open.pop(response.request, None)) is not None:
            post.status, post.answered_at = response.status, datetime.now(UTC)


@dataclass(frozen=True)
class GivenJudgement:
    """A judgement by an operator, identified by its note."""

    note: str
    touched: str = ""
    distance: str = ""
    void: str = ""

    @property
    def success(self) -> bool | None:
        """The outcome that must be recorded; None for void."""
        if self.void:
            return None
        return not self.touched and float(re.sub(r" cm$", "e-2", self.distance)) < 1.0


@contextmanager
def chromium_of_phones(*routes: tuple[str, TcpRelay, int]) -> Iterator[Browser]:
    """Open a browser that reaches relays only.

    Args:
        routes: host in the address, relay for it, and port in the address.
    """
    rules = [f"MAP {host}:{port} 127.0.0.1:{relay.port}" for host, relay, port in routes]
    flags = [
        f"--host-resolver-rules={','.join([*rules, 'MAP * ~NOTFOUND'])}",
        *FLAGS,
        *WITHOUT_WEBGL,
    ]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=flags)
        try:
            yield browser
        finally:
            browser.close()


def phone_in(browser: Browser, name: str, host: str, relay: TcpRelay, address: str, **options: Any) -> Phone:
    """Return a phone that has not opened the page yet."""
    options = {"viewport": SIZE, "device_scale_factor": 2, "is_mobile": True, "has_touch": True} | options
    page = browser.new_context(**options).new_page()
    return Phone(name, page, relay, address.replace("127.0.0.1", host))


def page_has_changed(error: Error) -> bool:
    """Whether an action failed because the page has changed meanwhile."""
    return any(text in str(error) for text in ("Timeout", "detached", "not visible", "navigation", "Execution context"))
