"""The report page in a browser: no network, no console errors, sortable, readable on a phone."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page, one_chromium
from tests.report.records import Attempt, Lab, step, void
from tests.report.test_forms import HOSTILE
from tests.ros.ros1.network import wait_until
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.report.figures.choose import drawings
from vsnbench.report.figures.frame_strips import frame_strip
from vsnbench.report.output import write_report
from vsnbench.values.movement import Action

LOUD = "<img src=x onerror='document.title=1'>"
WATCH = "window.complaints=[]; addEventListener('error', e => complaints.push(String(e.message)), true); \
addEventListener('securitypolicyviolation', e => complaints.push(e.violatedDirective));"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lab = Lab(tmp_path_factory.mktemp("lab"))
    steps = [step(number, Action.MOVE_FORWARD, x_m=0.25 * number) for number in range(1, 8)]
    lab.write(
        [
            void(),
            *(
                Attempt(goal, start, success=start != 2, actions=7 * start, steps=steps, end_reason=EndReason.STOP)
                for goal in ("chair", "sofa", "bed")
                for start in (1, 2, 3)
            ),
        ],
        model=LOUD,
        weights_label=HOSTILE,
    )
    for number in range(2, 5):
        directory = lab.directory / "episodes" / f"{number:06d}" / "rgb"
        directory.mkdir(parents=True)
        for index in range(1, 8):
            assert cv2.imwrite(str(directory / f"{index:04d}.jpg"), np.full((480, 640, 3), index * 30, np.uint8))
    report = build(lab.url, Selection(), lab.directory, reference=True)
    files = write_report(report, list(drawings(report, lab.url)), lab.directory / "report")
    assert {"report.html", "report.json", "tables.tex", "actions.svg"} <= {path.name for path in files}
    return lab.directory / "report" / "report.html"


@pytest.fixture(scope="module", autouse=True)
def browser_of_the_module() -> Iterator[None]:
    with one_chromium():
        yield


def ask(browser: Page, expression: str) -> object:
    answer: object = browser.evaluate(expression)
    return answer


@pytest.mark.browser
def test_the_page_works_without_a_network_and_sorts_by_a_click(page: Path) -> None:
    asked: list[str] = []
    with chromium_page(1280, 900) as browser:
        browser.add_init_script(WATCH)
        browser.context.set_offline(True)
        browser.on("request", lambda request: asked.append(request.url))
        browser.goto(page.as_uri())
        assert ask(browser, "window.complaints") == []
        assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
        # Names are text: they add no element and do not change the title.
        assert ask(browser, "document.querySelectorAll('img[src=x]').length") == 0
        assert ask(browser, "document.title") == "vsnbench report"
        assert ask(browser, "[...document.images].every(i => i.alt && (i.complete ? i.naturalWidth > 0 : true))")

        column = "[...document.querySelectorAll('#episode-table tbody tr')].map(r => r.cells[7].textContent)"
        press = "document.querySelectorAll('#episode-table thead button')[6].click()"
        ask(browser, f"({press}, 0)")
        rising = ask(browser, column)
        assert rising == sorted(rising, key=int)  # type: ignore[call-overload, type-var]
        ask(browser, f"({press}, 0)")
        assert ask(browser, column) == rising[::-1]  # type: ignore[index]
        assert (
            ask(browser, "document.querySelectorAll('#episode-table th')[7].getAttribute('aria-sort')") == "descending"
        )

        type_sofa = "(filter.value = 'sofa', filter.dispatchEvent(new Event('input')), 0)"
        ask(browser, type_sofa)
        assert ask(browser, "document.querySelectorAll('#episode-table tbody tr:not([hidden])').length") == 3
        assert ask(browser, "document.getElementById('matches').textContent") == "3 match"
        assert ask(browser, "document.querySelectorAll('img.strip').length") == 3
        assert "vsnbench view 1" in str(ask(browser, "document.querySelector('#episodes code').textContent"))

        # Images open below their episode, move with it when sorted, and do not match searches themselves.
        ask(browser, "(filter.value = '', filter.dispatchEvent(new Event('input')), 0)")
        browser.click("#episodes > details > summary")
        width = ask(browser, "document.getElementById('episode-table').offsetWidth")
        browser.click("#episode-2 summary")
        browser.locator("#episode-2 + .below img").wait_for()
        assert ask(browser, "document.getElementById('episode-table').offsetWidth") == width
        ask(browser, f"({press}, 0)")
        assert ask(browser, "document.querySelector('#episode-2 + .below img') !== null")
        ask(browser, type_sofa)
        assert ask(browser, "document.getElementById('matches').textContent") == "3 match"
        assert ask(browser, "document.querySelector('.below').hidden") is True

        background = "getComputedStyle(document.body).backgroundColor"
        light = ask(browser, background)
        assert ask(browser, "document.getElementById('theme').textContent") == "Dark"
        ask(browser, "(document.getElementById('theme').click(), 0)")
        assert ask(browser, background) != light
        assert ask(browser, "document.getElementById('theme').textContent") == "Light", "what a press does"


@pytest.mark.browser
def test_nothing_but_tables_scrolls_sideways_on_a_phone(page: Path) -> None:
    with chromium_page(390, 844, device_scale_factor=2, is_mobile=True) as browser:
        browser.goto(page.as_uri())
        wide = "[...document.body.querySelectorAll('*')].filter(e => !e.closest('.scroll') && \
            e.getBoundingClientRect().right > 391).map(e => e.tagName + '.' + e.className)"
        assert ask(browser, wide) == []
        assert ask(browser, "document.documentElement.scrollWidth") == 390
        # Content beyond the edge is marked, and all images load without scrolling.
        cut = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth + 2 && \
            !(e.classList.contains('more') && e.nextElementSibling.checkVisibility()))"
        browser.wait_for_selector("#figure-success-map, .scroll.more")
        # Measured after the layout of the images, and again when they change the widths.
        wait_until(lambda: ask(browser, f"{cut}.filter(e => e.checkVisibility()).length") == 0, "what is cut says so")
        assert ask(browser, "document.querySelectorAll('.scroll.more').length > 0")
        assert ask(browser, "[...document.querySelectorAll('#figures img')].every(i => i.loading !== 'lazy')")
        # Every table can be scrolled with the keyboard and has a name for a screen reader.
        regions = "[...document.querySelectorAll('table')].every(t => t.caption && t.parentElement.tabIndex === 0)"
        assert ask(browser, regions) is True
        ask(browser, "document.querySelectorAll('details').forEach(each => { each.open = true })")
        assert ask(browser, wide) == []
        broken = "[...document.querySelectorAll('#goals-1 tbody th')].filter(c => c.offsetWidth < 40).length"
        assert ask(browser, broken) == 0  # no name wraps after each letter
        torn = "[...document.querySelectorAll('.number')].filter(c => c.querySelector('wbr')).length"
        assert ask(browser, torn) == 0  # only names may wrap: 81/90 is not broken


@pytest.fixture(scope="module")
def large_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lab = Lab(tmp_path_factory.mktemp("large"))
    goals = ("chair", "sofa", "bed", "toilet", "plant")
    for number, model in enumerate(("oracle", "vlv", "pirlnav", "random", LOUD)):
        attempts = [Attempt(goal, start, success=start > 3 * number) for goal in goals for start in range(1, 16)]
        lab.write(attempts, model=model, surveyed=number == 0)
    lab.write([Attempt()], model="once")
    report = build(lab.url, Selection(), lab.directory)
    write_report(report, drawings(report, lab.url), lab.directory / "report")
    return lab.directory / "report" / "report.html"


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_is_led_by_its_question_and_folds_what_is_long(large_page: Path, width: int) -> None:
    with chromium_page(width, 900) as browser:
        browser.goto(large_page.as_uri())
        assert ask(browser, "document.documentElement.scrollHeight") < 9000  # type: ignore[operator]
        answer = str(ask(browser, "document.querySelector('main .answer').textContent"))
        assert "vlv has the highest success rate" in answer
        order = "['.answer', '.cards', '#figures img', 'table'].map(e => document.querySelector(e))"
        follows = f"{order}.every((e, i, all) => !i || all[i - 1].compareDocumentPosition(e) & 4)"
        assert ask(browser, follows) is True
        titles = "[...document.querySelectorAll('.cards.{} h4')].map(e => e.textContent)"
        assert ask(browser, titles.format("peers")) == ["vlv", "pirlnav", "random", LOUD]
        assert ask(browser, titles.format("few")) == ["once"]
        assert ask(browser, titles.format("bounds")) == ["oracle"]
        # A click on a card opens its tables.
        assert ask(browser, "document.querySelector('#goals-2').checkVisibility()") is False
        browser.click("a[href='#condition-2']")
        browser.locator("#goals-2").wait_for()  # visible; the page's policy blocks injected functions


def test_a_strip_has_five_frames_and_never_leaves_the_results(tmp_path: Path) -> None:
    directory = tmp_path / "results" / "episodes" / "000001" / "rgb"
    directory.mkdir(parents=True)
    for index in range(1, 12):
        assert cv2.imwrite(str(directory / f"{index:04d}.jpg"), np.full((480, 640, 3), index * 20, np.uint8))
    (directory / "0006.jpg").write_bytes(b"cut off")
    strip = frame_strip(tmp_path / "results", "episodes/000001")
    assert strip is not None
    assert strip.frames == 4  # the middle image is unreadable
    picture = cv2.imdecode(np.frombuffer(strip.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == (132, 4 * 176 + 3 * 4)
    assert frame_strip(tmp_path / "results" / "episodes", "../episodes/000001") is not None
    assert frame_strip(tmp_path / "results" / "other", "../episodes/000001") is None
    assert frame_strip(tmp_path / "results", "") is None
    assert frame_strip(tmp_path / "results", "episodes/000002") is None


@pytest.mark.browser
def test_everybody_can_read_the_page_and_sort_it_by_keyboard(page: Path) -> None:
    with chromium_page(1280, 900) as browser:
        browser.goto(page.as_uri())
        browser.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true })")
        browser.locator("#episode-table thead button").nth(6).focus()
        browser.keyboard.press("Enter")
        heading = browser.locator("#episode-table th").nth(7)
        assert heading.get_attribute("aria-sort") == "ascending"
        assert heading.locator("button").evaluate("button => getComputedStyle(button).outlineStyle") != "none"
        # The rows of a table are similar, so measuring the cells of two rows is enough.
        browser.evaluate("document.querySelectorAll('tbody tr:nth-child(n+3), .strip').forEach(each => each.remove())")
        assert accessibility_findings(browser) == []
