"""The operator's page in a browser: what a person sees and presses, by thumb and by keyboard."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Route

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium
from tests.console.desk_session import Session, ended_of
from vsnbench.database.queries import episode_details
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.pose import Pose
from vsnbench.runner.attendant import Judgement
from vsnbench.runner.board import ShownStep
from vsnbench.runner.desk import Asks

pytestmark = pytest.mark.browser
HEIGHT_PX = 844


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """One for all of them."""
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page of a phone's size, which has opened nothing yet."""
    opened = browser.new_page(viewport={"width": 390, "height": HEIGHT_PX})
    opened.set_default_timeout(120_000)
    yield opened
    opened.close()


def signed_in(page: Page, session: Session) -> None:
    page.goto(session.address)
    page.fill("#name", "Anna")
    page.keyboard.press("Enter")
    page.wait_for_selector("#episodes [data-amend]")  # it has opened: one awaits a judgement


def judged_in_the_list(page: Page) -> None:
    page.click("#episodes [data-touched=no]")
    page.fill("#episodes [data-name=distance]", "0.5")
    page.click("#episodes .judging-form button.go")


def test_what_is_kept_is_said_where_the_thumb_is_and_taken_back_there(page: Page, session: Session) -> None:
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        page.click("#episodes [data-amend]")
        judged_in_the_list(page)
        page.get_by_text("Kept: #1 success").wait_for()
    with session.desk.ask(Asks.FINISH):
        page.wait_for_selector("#finish")
        box = page.locator("#kept-undo").bounding_box()
        assert box is not None
        assert HEIGHT_PX / 2 < box["y"] < HEIGHT_PX - box["height"], "in sight on the next screen, below its middle"
        assert accessibility_findings(page) == [], "what was kept, the end and its summary"
        page.click("#kept-undo")
        page.wait_for_selector("#episodes .judging-form [data-touched=no]")  # another judgement is asked for at once
        assert page.locator("#kept").is_hidden()
    assert episode_details(session.journal.engine, 1).summary.outcome == "unjudged"


def test_a_form_for_what_another_judges_meanwhile_closes_and_says_who_it_was(page: Page, session: Session) -> None:
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        page.click("#episodes [data-amend]")
        page.fill("#episodes [data-name=note]", "as far as I could see")
        ben = session.browser("Ben")
        assert ben.post("/amend", episode=1, seen=1, touched="the bin").status == 200
        page.get_by_text("#1: Ben judged it meanwhile. What was typed here was not sent.").wait_for()
        page.get_by_text("failure · Ben").wait_for()
        assert page.locator(".judging-form").count() == 0


def test_whoever_judges_second_is_told_who_was_first_though_the_screen_has_gone(page: Page, session: Session) -> None:
    session.desk.board.episode_ended(ended_of(session))
    with session.desk.ask(Asks.JUDGE) as question:

        def after_ben(route: Route) -> None:
            failed = Judgement(Verdict(EndReason.STEP_LIMIT, False, "failed"))
            session.desk.reply(question.number, failed, "Ben", "the page")
            route.continue_()

        page.route("**/judge", after_ben)
        page.goto(session.address)
        page.fill("#name", "Anna")
        page.keyboard.press("Enter")
        page.click("#judging [data-touched=no]")
        page.click("#judging .judging-form button.go")
        page.wait_for_selector("#words:has-text('#1: Ben judged it first, at the page')")
        page.wait_for_selector("#judging", state="hidden")
        assert page.locator("#words").is_visible()


def test_a_mark_outside_the_plan_is_said_in_words(page: Page, session: Session) -> None:
    board = session.desk.board
    assert board.upcoming is not None
    start = board.upcoming.plan.start.model_copy(update={"position": (40.0, 3.0)})
    board.trial_begins(replace(board.upcoming, plan=replace(board.upcoming.plan, start=start)))
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        words = "The site's plan does not show mark 2: it lies outside, at x 40.00 m, y 3.00 m."
        page.get_by_text(words).wait_for()


def test_a_phone_whose_clock_is_wrong_is_told_so(page: Page, session: Session) -> None:
    page.add_init_script("const right = Date.now; Date.now = () => right() - 47 * 60_000;")
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        page.get_by_text("this phone's clock is 47 min slow: the computer's counts").wait_for()


def test_a_plan_that_cannot_be_shown_is_said_in_words(page: Page, session: Session) -> None:
    page.route("**/plan.svg", lambda route: route.fulfill(status=200, body="<p>a proxy's own page</p>"))
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        page.get_by_text("The floor plan of this site cannot be shown").wait_for()
        assert page.locator("#plan").inner_text() == ""


def test_a_live_picture_is_asked_for_by_one_timer_however_often_the_run_says_something(
    page: Page, session: Session
) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url) if "/picture" in request.url else None)
    # The timer of the next picture never fires: whatever is asked for beside the first was asked for by something else.
    page.add_init_script("const real = setTimeout; window.setTimeout = (run, ms) => ms === 200 ? 1 : real(run, ms);")
    session.camera.append(np.full((40, 60, 3), 200, np.uint8))
    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        page.click("#go")
        page.wait_for_selector("#picture-image[src^=blob]")
        for actions in (1, 2, 3):
            session.desk.board.steps.append(ShownStep("TURN_LEFT", False, Pose(1.0, 1.0)))
            session.desk.tell()
            page.get_by_text(f"{actions} of 150 actions").wait_for()
    assert len(asked) == 1


def test_everybody_can_read_the_page_and_work_it_by_keyboard_alone(page: Page, session: Session) -> None:
    page.goto(session.address)
    page.wait_for_selector("#name")
    assert accessibility_findings(page) == [], "signing in"
    page.keyboard.press("Tab")
    page.keyboard.type("Anna")
    page.keyboard.press("Enter")
    with session.desk.ask(Asks.PLACE) as question:
        page.wait_for_selector("#go:not([disabled])")
        page.wait_for_selector("#episodes .episode button")  # it has opened: one awaits a judgement
        assert accessibility_findings(page) == [], "placing"
        reached: list[str] = []
        while "SUMMARY" not in reached and len(reached) < 30:
            page.keyboard.press("Tab")
            held = page.locator(":focus")
            assert held.evaluate("each => getComputedStyle(each).outlineStyle") == "solid", "where it is can be seen"
            reached.append(held.evaluate("each => each.id || each.tagName"))
        assert reached[-5:] == ["go", "skip", "pause", "end", "SUMMARY"]
        page.locator("#go").press("Enter")
        page.wait_for_selector("#stop:focus")
    assert question.reply is not None
    assert accessibility_findings(page) == [], "driving"
    page.keyboard.press("Enter")
    page.get_by_text("stopped: the episode ends here").wait_for()
    assert session.halts[-1] == "halt"
    session.desk.driving = False
    session.desk.board.episode_ended(ended_of(session))
    with session.desk.ask(Asks.JUDGE):
        page.wait_for_selector("#judging form")
        assert accessibility_findings(page) == [], "judging"


def test_an_episode_is_judged_taken_back_and_made_void_by_keyboard_alone(page: Page, session: Session) -> None:
    def press_enter_on(selector: str) -> None:
        page.locator(selector).press("Enter")

    with session.desk.ask(Asks.PLACE):
        signed_in(page, session)
        press_enter_on("#episodes [data-amend]")
        press_enter_on("#episodes .judging-form summary")
        assert accessibility_findings(page) == [], "a form with everything open"
        page.locator("#episodes [data-touched=no]").press("Space")
        assert page.locator("#episodes [aria-pressed=true]").inner_text() == "No, nothing"
        page.locator("#episodes [data-name=distance]").press_sequentially("3")
        press_enter_on("#episodes [data-name=distance]")
        page.wait_for_selector("dialog[open] [value=no]:focus")  # a slip of the finger confirms nothing
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        page.get_by_text("Kept: #1").wait_for()
        press_enter_on("#kept-undo")
        press_enter_on("#episodes .judging-form summary")
        page.locator("#episodes [data-name=void]").press_sequentially("a visitor")
        press_enter_on("#episodes [data-void]")
        page.get_by_text("no result, its trial comes again").wait_for()
    assert episode_details(session.journal.engine, 1).summary.outcome == "void"
