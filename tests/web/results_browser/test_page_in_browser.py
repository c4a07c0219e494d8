"""The page of a results directory in Chromium, by keyboard and at a phone's width."""

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium
from tests.cli.test_record_verbs import vsnbench
from tests.processes import wait_until
from tests.results.records_of_a_lab import plan, run, stopped
from tests.robots.test_cameras import record_of_cameras
from tests.shared_records import write_copy
from tests.web.results_browser.filmed_record import make_filmed_record
from tests.web.results_browser.served_record import HOSTILE, make_record, served
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal

pytestmark = pytest.mark.browser
WIDE, PHONE = (1280, 800), (390, 844)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser shared by all tests."""
    with chromium() as opened:
        yield opened


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A record of two models; the first one fails where the second one succeeds."""
    make_record(tmp_path)
    return tmp_path


def opened(browser: Browser, address: str, size: tuple[int, int] = WIDE, shows: str = ".tile, .rows .line") -> Page:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(60_000)
    page.on("request", lambda request: outside.append(request.url) if "127.0.0.1" not in request.url else None)
    outside: list[str] = []
    page.goto(address)
    page.wait_for_selector(shows)
    assert outside == [], "no request leaves this machine"
    return page


def test_a_disagreement_is_found_opened_scrubbed_and_tagged_by_keyboard(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = opened(browser, address)
        page.keyboard.press("/")
        assert page.evaluate("document.activeElement.id") == "search"
        page.select_option("#filter-differ", "slow failed, fast succeeded")
        page.wait_for_selector(".pairs .line")
        page.keyboard.press("Escape")
        page.keyboard.press("Enter")
        page.wait_for_selector(".two .player")
        assert page.url.endswith("#/compare/1/4")
        page.keyboard.press("End")
        assert page.locator(".banner.failure").inner_text().startswith("✗")
        assert page.locator(".banner.success").inner_text().startswith("✓")
        page.keyboard.press("ArrowLeft")
        assert page.locator(".banner.driving").count() == 2
        wait_until(lambda: page.evaluate("document.querySelector('.camera').naturalWidth") == 64, "the image is loaded")
        page.keyboard.press("t")
        page.keyboard.type("glare")
        page.keyboard.press("Enter")
        page.get_by_label("remove tag glare").wait_for()
        with page.expect_download() as video:
            page.click("#video")
        assert video.value.suggested_filename == "episodes-1-4.mp4"
        assert Path(video.value.path()).read_bytes()[4:8] == b"ftyp"
        page.keyboard.press("Escape")
        page.wait_for_selector(".pairs .line")
        assert "#/?differ=slow" in page.url
        page.close()
    with open_record(sqlite_url(results / "vsnbench.db")) as engine:
        assert episode_record(engine, 1).tags == ("glare",)


def test_every_view_is_accessible_and_fits_the_screen(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = opened(browser, address)
        for view, selector in (
            ("#/", ".tile .plan svg"),
            ("#/?view=list", ".rows .line"),
            ("#/?view=time", ".chart svg"),
            ("#/?view=grid", ".grid"),
            ("#/episode/1", ".player"),
            ("#/compare/1/4", ".two"),
            ("#/?differ=slow+failed%2C+fast+succeeded", ".pairs"),
        ):
            page.goto(f"{address.partition('?')[0]}{view}")
            page.wait_for_selector(selector)
            page.keyboard.press("End")
            assert accessibility_findings(page) == [], view
            for width, height in (WIDE, PHONE):
                page.set_viewport_size({"width": width, "height": height})
                assert page.evaluate("document.documentElement.scrollWidth") <= width, view
        page.close()


def test_an_episode_shows_the_images_of_each_camera(browser: Browser, tmp_path: Path) -> None:
    write_copy(tmp_path, record_of_cameras)
    with served(tmp_path) as address:
        page = opened(browser, address)
        page.goto(f"{address.partition('?')[0]}#/episode/1")
        page.wait_for_selector(".views")
        page.keyboard.press("ArrowRight")
        assert page.locator(".views figcaption").all_inner_texts() == ["left", "rear"]
        sources = [image.get_attribute("src") for image in page.locator(".views img").all()]
        assert sources == ["images/1/2-left.jpg", "images/1/2-rear.jpg"]
        loaded = "[...document.querySelectorAll('.views img')].every((image) => image.naturalWidth === 160)"
        wait_until(lambda: page.evaluate(loaded), "the images are loaded")
        for width, height in (WIDE, PHONE):
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert accessibility_findings(page) == []
        page.close()


def cards_of(page: Page) -> list[str]:
    return [" ".join(text.split()) for text in page.locator(".tile .outcome").all_inner_texts()]


def test_the_gallery_groups_searches_and_plays_episodes_together(browser: Browser, results: Path) -> None:
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        journal.add_event("note", "a cat sat on the chair", author="ada", episode_id=2)
    with served(results) as address:
        page = opened(browser, address)
        page.wait_for_selector(".tile .plan svg")
        wait_until(lambda: page.evaluate("document.querySelector('.shot img').naturalWidth") == 64, "the last picture")
        assert cards_of(page)[0].startswith("✗"), "failures come first"
        page.select_option("#filter-group", "model")
        wait_until(lambda: page.locator(".group").count() == 2, "a group of each model")
        assert [" ".join(text.split()) for text in page.locator(".group").all_inner_texts()] == [
            "slow 3 episodes, 1 of 2 succeeded",
            "fast 2 episodes, 2 of 2 succeeded",
        ]
        page.fill("#search", "CAT")
        wait_until(lambda: page.locator(".tile").count() == 1, "the search looks at notes")
        assert "q=CAT" in page.url
        page.fill("#search", "")
        wait_until(lambda: page.locator(".tile").count() == 5, "all are shown again")
        for number in (1, 2, 4, 5):
            page.get_by_label(f"side by side: episode {number}", exact=True).check()
        page.get_by_label("side by side: episode 3").click()
        assert page.get_by_label("side by side: episode 3").is_checked() is False, "at most four"
        page.get_by_role("link", name="Play 4 together").click()
        page.wait_for_selector(".many .player")
        assert page.locator(".player").count() == 4
        page.keyboard.press("End")
        assert page.locator(".banner.success").count() == 3
        page.close()


def test_previous_and_next_follow_the_order_of_the_results(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = opened(browser, f"{address}#/?model=fast&view=list")
        page.click(".rows .line a")
        page.wait_for_selector(".player")
        assert page.locator(".player h2").inner_text().startswith("#5 ")
        assert page.locator("#previous").count() == 0
        page.click("#next")
        page.wait_for_selector(".player h2:has-text('#4')")
        assert page.locator("#next").count() == 0
        page.keyboard.press("k")
        page.wait_for_selector(".player h2:has-text('#5')")
        page.close()


def test_repeated_events_are_one_line_with_what_most_have_in_common(browser: Browser, results: Path) -> None:
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        for step, metres in enumerate((0.25, 0.25, 0.25, 0.31), start=1):
            text = f"obstacle {metres:.2f} m ahead of the front ({step} depth pixels)"
            journal.add_event("blocked", text, author="", episode_id=1, step_number=step)
    with served(results) as address:
        page = opened(browser, address)
        page.goto(f"{address.partition('?')[0]}#/episode/1")
        page.wait_for_selector(".history summary")
        assert page.locator(".history summary").inner_text() == "blocked 4 times, mostly at 0.25 m"
        assert page.locator(".history ul li").count() == 4
        page.close()


def test_the_table_has_no_empty_column(browser: Browser, results: Path) -> None:
    headings = "[role=columnheader]"
    with served(results) as address:
        page = opened(browser, address)
        page.goto(f"{address.partition('?')[0]}#/?view=list")
        page.wait_for_selector(headings)
        assert "tags, notes" not in page.locator(headings).all_inner_texts()
        with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
            journal.add_event("note", "glare", author="ada", episode_id=1)
        wait_until(lambda: "tags, notes" in page.locator(headings).all_inner_texts(), "the column of the note appears")
        page.close()


def test_success_over_time_has_days_and_versions(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = opened(browser, address)
        page.keyboard.press("o")
        page.wait_for_selector(".chart circle")
        days, versions = (
            [[" ".join(cell.split()) for cell in line.split("\t")] for line in table.splitlines() if line.strip()]
            for table in page.locator("table.plain").all_inner_texts()
        )
        assert days[0] == ["day", "slow", "fast"]
        assert [line[1:] for line in days[1:]] == [["1/2", "2/2"]]
        assert [[line[0], *line[-2:]] for line in versions[1:]] == [["slow", "1/2", "50 %"], ["fast", "2/2", "100 %"]]
        places = page.locator(".chart circle").evaluate_all("dots => dots.map(dot => dot.cx.baseVal.value)")
        assert len(set(places)) == 2, "models of one day stand side by side"
        page.close()


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of two trials with films."""
    results = tmp_path_factory.mktemp("filmed")
    make_filmed_record(results)
    return results


def shown_film(browser: Browser, address: str, view: str) -> Page:
    page = opened(browser, address)
    page.goto(f"{address.partition('?')[0]}#/{view}")
    page.wait_for_selector(".plan polygon")
    return page


def image_of(page: Page) -> str:
    return str(page.get_attribute(".camera", "src"))


def test_steps_of_a_film_are_at_the_times_of_their_images(browser: Browser, filmed: Path) -> None:
    with served(filmed) as address:
        page = shown_film(browser, address, "episode/1")
        banner, action = page.locator(".banner"), page.locator(".action")
        assert page.locator(".transport [role=status]").inner_text() == "0.0 of 1.8 s"
        assert banner.inner_text() == "waits for the first answer, 0.0 s"
        assert page.locator(".banner.waits").count() == 1
        found = []
        for _ in range(3):
            page.keyboard.press("ArrowRight")
            found.append((image_of(page), banner.inner_text()))
        assert found == [
            ("images/1/2.jpg", "answer 1 of 3, 0.6 s"),
            ("images/1/3.jpg", "answer 2 of 3, 1.0 s: stale, dropped when 0.40 s old"),
            ("images/1/3-1.jpg", "✓ judged"),
        ]
        page.keyboard.press("ArrowLeft")
        assert "not driven: the robot keeps the path before it" in action.inner_text()
        assert "this is the image of answer 3" in action.inner_text()
        page.keyboard.press("Home")
        assert image_of(page) == "images/1/1.jpg"
        assert page.locator(".timeline").inner_text().split("\n") == [
            "#1: 1.8 s",
            "waits 0.5 s",
            "1 stale answer dropped",
        ]
        page.close()


_WATCH = """() => {
    window.shown = [];
    const image = document.querySelector(".camera");
    new MutationObserver(() => window.shown.push([image.getAttribute("src"), performance.now(),
        document.querySelector(".plan .robot").getAttribute("points").split(" ")[0]]))
        .observe(image, { attributes: true, attributeFilter: ["src"] });
}"""


def test_a_film_plays_each_image_in_order_at_its_time_and_pose(browser: Browser, filmed: Path) -> None:
    with served(filmed) as address:
        page = shown_film(browser, address, "episode/1")
        page.evaluate(_WATCH)
        page.keyboard.press(" ")
        wait_until(lambda: page.locator(".banner.success").count() == 1, "the film has been played to its end")
        assert page.locator("#play").inner_text() == "▶ play"
        shown = page.evaluate("window.shown")
        names = [source.removeprefix("images/1/") for source, _, _ in shown]
        assert names == ["2.jpg", "1-2.jpg", "3.jpg", "2-1.jpg", "3-1.jpg"], "one of the two images at 0.6 s"
        assert len({point for _, _, point in shown}) == len(shown), "the robot is elsewhere in each image"
        assert shown[-1][1] - shown[0][1] >= 900, "in real time: 1 s of the robot's clock"
        page.close()


def test_a_stack_has_the_same_film_with_its_commanded_velocity(browser: Browser, filmed: Path) -> None:
    with served(filmed) as address:
        page = shown_film(browser, address, "episode/2")
        page.locator("#slider").fill("0.85")
        assert page.locator(".banner").inner_text() == "driven by the stack, 0.8 s"
        assert page.locator(".action").inner_text() == "commanded 0.30 m/s, 29°/s"
        assert image_of(page) == "images/2/1-2.jpg"
        page.close()


def test_films_are_accessible_and_fit_the_screen(browser: Browser, filmed: Path) -> None:
    with served(filmed) as address:
        page = shown_film(browser, address, "compare/1/2")
        page.locator("#slider").fill("1.2")
        assert accessibility_findings(page) == []
        for width, height in (WIDE, PHONE):
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.locator("#slider").bounding_box()["width"] > 250
        page.close()


def test_the_grid_fills_while_a_run_goes_on(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = opened(browser, f"{address}#/")
        page.keyboard.press("g")
        page.wait_for_selector(".mark")
        assert page.locator(".mark").count() == 5
        with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
            trials = journal.find_or_create_campaign(plan(seed=7)).trials
            run(journal, trials[3], stopped(success=True))
        wait_until(lambda: page.locator(".mark").count() == 6, "the new episode is in the grid")
        page.close()


def test_the_address_with_the_token_opens_the_episode_that_it_names(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = browser.new_page()
        page.goto(f"{address}#/episode/4")
        page.wait_for_selector(".player")
        assert page.locator(".player h2").inner_text().startswith("#4 ")
        assert "token" not in page.url
        page.close()


def test_the_cause_of_a_failure_is_shown_in_full_on_a_small_screen(browser: Browser, results: Path) -> None:
    with served(results) as address:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{address}#/?view=list")
        page.wait_for_selector(".cell.result.failure")
        overflow = """(cell) => {
            cell.textContent = "✗ failure: reached, did not stop";
            return cell.scrollHeight > cell.clientHeight + 1 || cell.scrollWidth > cell.clientWidth + 1;
        }"""
        assert page.locator(".cell.result.failure").first.evaluate(overflow) is False
        page.close()


def test_names_from_a_record_are_text(browser: Browser, tmp_path: Path) -> None:
    make_record(tmp_path, (HOSTILE, "fast"))
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        journal.add_event("note", HOSTILE, author=HOSTILE, episode_id=1)
    with served(tmp_path) as address:
        page = opened(browser, address)
        for view, selector in (("#/?view=grid", ".grid"), ("#/episode/1", ".history"), ("#/compare/1/4", ".two")):
            page.goto(f"{address.partition('?')[0]}{view}")
            page.wait_for_selector(selector)
        assert "onerror" in page.locator(".history").first.inner_text()
        assert page.evaluate("window.pwned") is None
        page.close()


def test_a_script_in_any_text_of_a_record_does_not_run(browser: Browser, tmp_path: Path) -> None:
    record, site = tmp_path / "results", tmp_path / "site"
    make_record(record)
    with Journal.open(sqlite_url(record / "vsnbench.db")) as journal:
        journal.add_event("note", "text", author="ada", episode_id=1)
    changed = poison(record / "vsnbench.db")
    assert len(changed) > 30, "most tables have texts"
    with served(record) as address:
        page = browser.new_page()
        page.set_default_timeout(60_000)
        for view, selector in (
            ("", ".tile .plan svg"),
            ("#/?view=list", ".rows .line"),
            ("#/?view=time", ".chart svg"),
            ("#/?view=grid", ".grid"),
            ("#/episode/1", ".history"),
            ("#/compare/1/4", ".two"),
        ):
            page.goto(f"{address if not view else address.partition('?')[0]}{view}")
            page.wait_for_selector(selector)
        assert page.evaluate("window.pwned") is None
        page.close()
    done = vsnbench(record, "report", "--website", str(site))
    assert done.returncode in (0, 1), done.stderr
    if done.returncode == 0:
        page = browser.new_page()
        for name, selector in (("index.html", ".tile"), ("report.html", "#answer")):
            page.goto(f"file://{site}/{name}")
            page.wait_for_selector(selector)
        assert page.evaluate("window.pwned") is None
        page.close()


def poison(database: Path) -> list[str]:
    """Put a script into every text of a record that is not a key or one of a few fixed words."""
    fixed = {"action", "key", "uuid", "sha256", "protocol_sha256", "state", "end_reason", "images_directory", "origin"}
    changed = []
    with sqlite3.connect(database) as opened:
        tables = [row[0] for row in opened.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        for table in tables:
            if table in ("alembic_version", "sqlite_sequence"):
                continue
            for column in opened.execute(f"PRAGMA table_info({table})").fetchall():
                name, kind = column[1], column[2]
                if kind != "TEXT" or name in fixed or name.endswith(("_source", "_digest", "_at")):
                    continue
                text = "? || rowid" if (table, name) == ("trial", "goal") else "?"  # unique in a campaign
                update = f"UPDATE {table} SET {name} = {text} WHERE {name} IS NOT NULL"
                opened.execute(update, (HOSTILE,))
                changed.append(f"{table}.{name}")
    return changed
