"""The driver's page in a browser: keys, touch, a gamepad, and a second browser."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium
from tests.processes import wait_until
from vsnbench.models.human.controls import Controls
from vsnbench.values.encoding.images import encode_jpeg
from vsnbench.values.movement import Action
from vsnbench.values.observation import Budget
from vsnbench.web.driver.page import DriverPage

pytestmark = pytest.mark.browser
HEIGHT_PX = 844
LINE_PX = 17 * 1.4
"""Of the page's text."""
ASKED = "#STOP[aria-disabled=false]"
PRESS_PAD = """pressed => {
  const buttons = Array.from({ length: 16 }, (_, index) => ({ pressed: pressed.includes(index) }));
  const pad = { axes: [0, 0], buttons };
  navigator.getGamepads = () => [pad];
}"""
"""A gamepad is hardware, which no browser without a person has: its state is given, the page reads it."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page of a phone's size, with touch and keys."""
    context = browser.new_context(viewport={"width": 390, "height": HEIGHT_PX}, has_touch=True)
    opened = context.new_page()
    opened.set_default_timeout(120_000)
    yield opened
    context.close()


@pytest.fixture
def controls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Controls:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Controls("ada")


@pytest.fixture
def address(controls: Controls) -> Iterator[str]:
    with DriverPage(port=0).serve(controls) as text:
        yield text.split()[-1]


def ask(controls: Controls) -> "Future[Action]":
    """Show a picture from another thread, as the runner does, and return what will be chosen."""
    answer: Future[Action] = Future()
    jpeg = encode_jpeg(np.full((480, 640, 3), 40 * (1 + controls.view.picture % 5), np.uint8))
    budget = Budget(150 - controls.view.picture)
    threading.Thread(target=lambda: answer.set_result(controls.ask(jpeg, budget)), daemon=True).start()
    return answer


def begin_offered(controls: Controls) -> threading.Thread:
    thread = threading.Thread(target=controls.offer_trial, args=("chair", None, 1.0), daemon=True)
    thread.start()
    return thread


def test_keys_drive_and_a_held_key_ends_no_trial(page: Page, address: str, controls: Controls) -> None:
    offer = begin_offered(controls)
    page.goto(address)
    page.wait_for_selector("#begin:focus")
    assert accessibility_findings(page) == [], "before the trial"
    page.set_viewport_size({"width": 1280, "height": HEIGHT_PX})
    page.keyboard.down("Enter")
    offer.join(60)
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    page.keyboard.down("Enter")  # the key that began the trial is still held, so the browser repeats it
    page.keyboard.down("Enter")
    page.keyboard.up("Enter")
    assert not answer.done(), "a held key is no STOP"
    assert accessibility_findings(page) == [], "during the trial"
    assert page.inner_text("#left") == "150 actions left"
    for key, action in (
        ("ArrowUp", Action.MOVE_FORWARD),
        ("ArrowLeft", Action.TURN_LEFT),
        ("ArrowRight", Action.TURN_RIGHT),
        ("ArrowDown", Action.MOVE_BACKWARD),
        ("Space", Action.STOP),
    ):
        page.keyboard.press(key)
        assert answer.result(60) is action
        page.keyboard.press("Enter")  # nothing is asked: this is not kept for the next picture
        if action is not Action.STOP:
            answer = ask(controls)
            page.wait_for_selector(ASKED)
            assert not answer.done()
    controls.end_trial()
    page.get_by_text("The next trial is being prepared.").wait_for()


def test_the_page_says_that_the_guard_refused_and_a_held_key_does_not_ask_again(
    page: Page, address: str, controls: Controls
) -> None:
    offer = begin_offered(controls)
    page.goto(address)
    page.tap("#begin")
    offer.join(60)
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    page.keyboard.down("ArrowUp")
    assert answer.result(60) is Action.MOVE_FORWARD
    controls.refused = True
    answer = ask(controls)
    page.get_by_role("status").get_by_text("The guard refused. Choose again.").wait_for()
    page.keyboard.down("ArrowUp")  # repeated by the browser
    assert not answer.done()
    assert accessibility_findings(page) == []
    box = page.locator("#status").bounding_box()
    assert box is not None
    assert box["height"] < 1.5 * LINE_PX, "one line"
    page.keyboard.up("ArrowUp")
    page.keyboard.press("ArrowUp")
    assert answer.result(60) is Action.MOVE_FORWARD
    controls.refused = False
    ask(controls)
    page.get_by_text("Choose an action.", exact=True).wait_for()


def test_touch_drives_on_a_phone_and_a_second_browser_sees_who_drives(
    page: Page, browser: Browser, address: str, controls: Controls
) -> None:
    offer = begin_offered(controls)
    page.goto(address)
    page.tap("#begin")
    offer.join(60)
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    picture, stop = page.locator("#picture-image").bounding_box(), page.locator("#STOP").bounding_box()
    assert picture is not None
    assert stop is not None
    assert picture["y"] + picture["height"] < stop["y"] < HEIGHT_PX - stop["height"], "all on the screen"
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    with browser.new_context() as other:
        second = other.new_page()
        second.goto(address)
        second.get_by_text("ada drives this robot in another browser.").wait_for()
        assert second.locator("#picture").is_hidden()
        assert second.locator("#begin").is_hidden()
    page.tap("#MOVE_FORWARD")
    assert answer.result(60) is Action.MOVE_FORWARD
    page.reload()
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    page.tap("#STOP")
    assert answer.result(60) is Action.STOP


def test_a_gamepad_drives_and_its_held_button_ends_no_trial(page: Page, address: str, controls: Controls) -> None:
    offer = begin_offered(controls)
    page.goto(address)
    page.wait_for_selector("#begin:focus")
    page.evaluate(PRESS_PAD, [])
    page.evaluate("dispatchEvent(new Event('gamepadconnected'))")
    page.evaluate("new Promise(requestAnimationFrame)")
    page.evaluate(PRESS_PAD, [0])
    offer.join(60)
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    page.evaluate(PRESS_PAD, [0, 12])  # the button that began the trial is still held
    assert answer.result(60) is Action.MOVE_FORWARD
    page.evaluate(PRESS_PAD, [])
    answer = ask(controls)
    page.wait_for_selector(ASKED)
    page.evaluate("new Promise(requestAnimationFrame)")
    page.evaluate(PRESS_PAD, [0])
    assert answer.result(60) is Action.STOP


def test_the_page_says_when_the_run_is_gone(page: Page, controls: Controls) -> None:
    with DriverPage(port=0).serve(controls) as text:
        page.goto(text.split()[-1])
        page.get_by_text("The next trial is being prepared.").wait_for()
    page.get_by_text("The session has ended. Thank you.").wait_for()
    wait_until(lambda: page.inner_text("#link") == "ended", "the badge follows")
