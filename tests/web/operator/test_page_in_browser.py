"""The operator's page in a browser, used by touch and by keyboard."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Route

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium
from tests.processes import wait_until
from tests.results.records_of_a_lab import plan, run, stopped
from tests.web.page_session import PageSession, ended_episode
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.limits import Spent
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.reading.queries import episode_record
from vsnbench.runner.operator.contract import Judgement
from vsnbench.runner.operator.prompts import QuestionKind
from vsnbench.runner.operator.session_state import ShownStep
from vsnbench.values.pose import Pose

pytestmark = pytest.mark.browser
HEIGHT_PX = 844


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser shared by all tests."""
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page of a phone's size."""
    opened = browser.new_page(viewport={"width": 390, "height": HEIGHT_PX})
    opened.set_default_timeout(120_000)
    yield opened
    opened.close()


def signed_in(page: Page, session: PageSession) -> None:
    page.goto(session.address)
    page.fill("#name", "Anna")
    page.keyboard.press("Enter")
    page.wait_for_selector("#episodes [data-amend]")  # the list is open, because an episode awaits a judgement


def judge_in_the_list(page: Page) -> None:
    page.click("#episodes [data-touched=no]")
    page.fill("#episodes [data-name=distance]", "0.5")
    page.click("#episodes .judging-form button.go")


def test_a_saved_judgement_can_be_undone_at_the_bottom_of_the_next_screen(page: Page, session: PageSession) -> None:
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.click("#episodes [data-amend]")
        judge_in_the_list(page)
        page.get_by_text("Saved: #1 success").wait_for()
    with session.prompts.ask(QuestionKind.FINISH):
        page.wait_for_selector("#finish")
        box = page.locator("#undo-button").bounding_box()
        assert box is not None
        assert HEIGHT_PX / 2 < box["y"] < HEIGHT_PX - box["height"], "visible in the lower half of the next screen"
        assert accessibility_findings(page) == [], "undo bar, end and summary"
        page.click("#undo-button")
        page.wait_for_selector("#episodes .judging-form [data-touched=no]")  # the form opens again
        assert page.locator("#undo-bar").is_hidden()
    assert episode_record(session.journal.engine, 1).outcome == "unjudged"


def test_an_open_form_closes_when_another_operator_judges_the_episode(page: Page, session: PageSession) -> None:
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.click("#episodes [data-amend]")
        page.fill("#episodes [data-name=note]", "as far as I could see")
        ben = session.browser("Ben")
        assert ben.post("/amend", episode=1, seen=1, touched="the bin").status == 200
        page.get_by_text("#1: Ben judged it meanwhile. Your answer was not sent.").wait_for()
        page.get_by_text("failure · Ben").wait_for()
        assert page.locator(".judging-form").count() == 0


def test_a_late_judgement_shows_who_was_first_after_its_screen_closes(page: Page, session: PageSession) -> None:
    session.prompts.state.episode_ended(ended_episode(session))
    with session.prompts.ask(QuestionKind.JUDGE) as question:

        def judge_as_ben(route: Route) -> None:
            failed = Judgement(Verdict(EndReason.STEP_LIMIT, False, "failed"))
            session.prompts.reply(question.number, failed, "Ben", "the page")
            route.continue_()

        page.route("**/judge", judge_as_ben)
        page.goto(session.address)
        page.fill("#name", "Anna")
        page.keyboard.press("Enter")
        page.click("#judging [data-touched=no]")
        page.click("#judging .judging-form button.go")
        page.wait_for_selector("#message:has-text('#1: Ben')")
        page.wait_for_selector("#judging", state="hidden")
        assert page.locator("#message").is_visible()


def test_a_mark_outside_the_plan_has_a_caption_with_its_position(page: Page, session: PageSession) -> None:
    state = session.prompts.state
    assert state.upcoming is not None
    start = state.upcoming.plan.start.model_copy(update={"position": (40.0, 3.0)})
    state.trial_begins(replace(state.upcoming, plan=replace(state.upcoming.plan, start=start)))
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.get_by_text("Mark 2 is outside this plan, at x 40.00 m, y 3.00 m.").wait_for()


def test_a_phone_with_a_wrong_clock_shows_the_difference(page: Page, session: PageSession) -> None:
    page.add_init_script("const right = Date.now; Date.now = () => right() - 47 * 60_000;")
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.get_by_text("this phone's clock is 47 min slow").wait_for()


def test_a_plan_that_fails_to_load_leaves_a_message(page: Page, session: PageSession) -> None:
    page.route("**/plan.svg", lambda route: route.fulfill(status=200, body="<p>a proxy's own page</p>"))
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.get_by_text("The floor plan cannot be shown").wait_for()
        assert page.locator("#plan").inner_text() == ""


def test_state_changes_request_no_additional_live_pictures(page: Page, session: PageSession) -> None:
    requested: list[str] = []
    page.on("request", lambda request: requested.append(request.url) if "/picture" in request.url else None)
    # The timer of the next picture never fires, so any further request would come from a state change.
    page.add_init_script("const real = setTimeout; window.setTimeout = (run, ms) => ms === 200 ? 1 : real(run, ms);")
    session.camera.append(np.full((40, 60, 3), 200, np.uint8))
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.click("#go")
        page.wait_for_selector("#picture-image[src^=blob]")
        for actions in (1, 2, 3):
            session.prompts.state.steps.append(ShownStep("TURN_LEFT", False, Pose(1.0, 1.0)))
            session.prompts.notify()
            page.get_by_text(f"{actions} of 150 actions").wait_for()
    assert len(requested) == 1


def test_the_arrival_of_a_stack_is_declared_by_touch_and_by_keyboard(page: Page, session: PageSession) -> None:
    prompts, state = session.prompts, session.prompts.state
    with prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
    prompts.driving = True
    state.driving_begins()
    state.whereabouts = "start the stack with the goal chair"
    prompts.notify()
    page.get_by_text("start the stack with the goal chair").wait_for()
    assert page.locator("#arrived").is_hidden(), "a model says so itself"
    state.can_declare = True  # from the first look at a stack that asks for it
    prompts.notify()
    page.wait_for_selector("#arrived", state="visible")
    assert accessibility_findings(page) == []
    for declare in (lambda: page.click("#arrived"), lambda: page.locator("#arrived").press("Enter")):
        assert not prompts.take_arrival()
        declare()
        wait_until(lambda: prompts.take_arrival() or page.wait_for_timeout(10), "the arrival is declared")
    assert session.stops == [], "nothing else was pressed"
    prompts.driving = False
    state.episode_ended(ended_episode(session))
    prompts.notify()
    page.wait_for_selector("#arrived", state="hidden")


def test_every_screen_is_accessible_and_works_by_keyboard(page: Page, session: PageSession) -> None:
    page.goto(session.address)
    page.wait_for_selector("#name")
    assert accessibility_findings(page) == [], "signing in"
    page.keyboard.press("Tab")
    page.keyboard.type("Anna")
    page.keyboard.press("Enter")
    with session.prompts.ask(QuestionKind.PLACE) as question:
        page.wait_for_selector("#go:not([disabled])")
        page.wait_for_selector("#episodes .episode button")
        assert accessibility_findings(page) == [], "placing"
        reached: list[str] = []
        while "SUMMARY" not in reached and len(reached) < 30:
            page.keyboard.press("Tab")
            focused = page.locator(":focus")
            assert focused.evaluate("each => getComputedStyle(each).outlineStyle") == "solid", "the focus is visible"
            reached.append(focused.evaluate("each => each.id || each.tagName"))
        assert reached[-5:] == ["go", "skip", "pause", "end", "SUMMARY"]
        page.locator("#go").press("Enter")
        page.wait_for_selector("#stop:focus")
    assert question.answer is not None
    assert accessibility_findings(page) == [], "driving"
    page.keyboard.press("Enter")
    page.get_by_text("Stopped. The episode ends here.").wait_for()
    wait_until(lambda: session.stops[-1] == "halt" or page.wait_for_timeout(10), "the robot is halted")
    session.prompts.driving = False
    session.prompts.state.episode_ended(ended_episode(session))
    with session.prompts.ask(QuestionKind.JUDGE):
        page.wait_for_selector("#judging form")
        assert accessibility_findings(page) == [], "judging"


def test_an_episode_is_judged_undone_and_declared_void_by_keyboard(page: Page, session: PageSession) -> None:
    def press_enter_on(selector: str) -> None:
        page.locator(selector).press("Enter")

    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        press_enter_on("#episodes [data-amend]")
        press_enter_on("#episodes .judging-form summary")
        assert accessibility_findings(page) == [], "a complete form"
        page.locator("#episodes [data-touched=no]").press("Space")
        assert page.locator("#episodes [aria-pressed=true]").inner_text() == "No"
        page.locator("#episodes [data-name=distance]").press_sequentially("3")
        press_enter_on("#episodes [data-name=distance]")
        page.wait_for_selector("dialog[open] [value=no]:focus")  # the safe answer has the focus
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        page.get_by_text("Saved: #1").wait_for()
        press_enter_on("#undo-button")
        press_enter_on("#episodes .judging-form summary")
        page.locator("#episodes [data-name=void]").press_sequentially("a visitor")
        press_enter_on("#episodes [data-void]")
        page.get_by_text("void, the trial runs again").wait_for()
    assert episode_record(session.journal.engine, 1).outcome == "void"


def test_a_slow_answer_does_not_redraw_the_form_and_undo_keeps_the_choices(page: Page, session: PageSession) -> None:
    """The answer to a judgement can arrive after the change of state that it causes."""
    delayed: list[Route] = []

    def hold(route: Route) -> None:
        delayed.append(route)

    page.route("**/amend", hold)
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.click("#episodes [data-amend]")
        page.click("#episodes [data-touched=no]")
        page.fill("#episodes [data-name=distance]", "0.5")
        page.fill("#episodes [data-name=note]", "near the window")
        page.click("#episodes .chips button:has-text('cable')")
        page.locator("#episodes .judging-form button.go").press("Enter")
        wait_until(lambda: delayed or page.wait_for_timeout(10), "the answer is sent")
        response = delayed[0].fetch()
        before = page.evaluate("performance.getEntriesByName(`${location.origin}/episodes`).length")
        session.prompts.record_changed()
        page.wait_for_function(
            "n => performance.getEntriesByName(`${location.origin}/episodes`).length > n", arg=before
        )
        assert page.locator("#undo-bar").is_hidden(), "no undo before the answer has arrived"
        delayed[0].fulfill(response=response)
        page.unroute("**/amend")
        page.get_by_text("Saved: #1 success").wait_for()
        assert page.locator("#episodes .judging-form").count() == 0
        page.locator("#undo-button").press("Enter")
        page.wait_for_selector("#episodes .judging-form:focus")
        page.keyboard.press("Enter")  # a second Enter presses no button
        assert page.locator("#episodes [aria-pressed=true]").all_inner_texts() == ["No", "cable"]
        assert page.input_value("#episodes [data-name=distance]") == "0.5"
        assert page.input_value("#episodes [data-name=note]") == "near the window"
        page.reload()
        page.click("#episodes [data-amend]")
        assert page.input_value("#episodes [data-name=distance]") == "0.5"
    assert episode_record(session.journal.engine, 1).outcome == "unjudged"


def test_a_redraw_keeps_the_focus_and_an_open_form(page: Page, session: PageSession) -> None:
    with session.prompts.ask(QuestionKind.PLACE):
        signed_in(page, session)
        page.locator("#episodes [data-amend]").focus()
        page.evaluate("document.querySelector('.episode').dataset.key = ''")  # forces a redraw
        session.prompts.record_changed()
        page.wait_for_selector(".episode:not([data-key=''])")
        assert page.evaluate("document.activeElement.hasAttribute('data-amend')")
        page.keyboard.press("Enter")
        page.locator("#episodes [data-touched=yes]").press("Enter")
        page.locator("#episodes [data-name=what]").press_sequentially("the le")
        campaign = session.journal.find_or_create_campaign(plan())
        run(session.journal, campaign.trials[2], replace(stopped(success=False), proposed=True))
        session.prompts.record_changed()
        page.wait_for_selector("[data-episode='3']")
        page.keyboard.type("g")
        assert page.input_value("#episodes [data-name=what]") == "the leg"
        assert page.locator("#episodes [data-touched=yes]").get_attribute("aria-pressed") == "true"


def test_the_judging_form_shows_the_goal_and_the_last_frames(page: Page, session: PageSession) -> None:
    frame = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()
    page.route("**/frames/*", lambda route: route.fulfill(body=frame, content_type="image/jpeg"))
    ended = ended_episode(session)
    session.prompts.state.episode_ended(replace(ended, outcome=replace(ended.outcome, actions=40)))
    with session.prompts.ask(QuestionKind.JUDGE):
        page.goto(session.address)
        page.fill("#name", "Anna")
        page.keyboard.press("Enter")
        page.wait_for_selector("#judging h2:has-text('Goal: chair, from mark 2')")
        frames = page.locator("#judging .strip img")
        numbers = [int(alt.split()[-1]) for alt in frames.evaluate_all("images => images.map(image => image.alt)")]
        assert (numbers[0], numbers[-6:], len(numbers)) == (1, [35, 36, 37, 38, 39, 40], 12)
        page.wait_for_function(
            """() => { const strip = document.querySelector("#judging .strip");
            const right = strip.lastElementChild.getBoundingClientRect().right;
            return strip.scrollLeft > 0 && right <= strip.getBoundingClientRect().right + 1; }"""
        )


def test_the_page_shows_the_time_and_the_path_that_are_left(page: Page, session: PageSession) -> None:
    state = session.prompts.state
    assert state.upcoming is not None
    limits = ProtocolParameters(max_time_s=360, max_path_m=20)
    state.trial_begins(replace(state.upcoming, plan=replace(state.upcoming.plan, parameters=limits)))
    signed_in(page, session)
    session.prompts.driving = True
    state.driving_begins()
    state.spent = Spent(1, driving_s=30.0, thinking_s=4.0, path_m=2.5)
    session.prompts.notify()
    page.wait_for_selector("#driving-actions:has-text('326 of 360 s left, 17.5 of 20 m left')")
    state.spent = Spent(1, driving_s=500.0, path_m=21.0)
    session.prompts.notify()
    page.wait_for_selector("#driving-actions:has-text('0 of 360 s left, 0.0 of 20 m left')")
