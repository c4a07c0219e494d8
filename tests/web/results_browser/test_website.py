"""The website is served by Python's own file server, under a path, as a static host would, and opened as files."""

import functools
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import pytest

from tests.cli.chromium import chromium_page
from tests.cli.test_record_verbs import vsnbench
from tests.processes import wait_until
from tests.web.results_browser.filmed_record import make_filmed_record
from tests.web.results_browser.served_record import HOSTILE, make_record
from vsnbench.errors import UsageError
from vsnbench.report.analysis.conditions import Selection
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.journal import Journal
from vsnbench.web.results_browser import single_file
from vsnbench.web.results_browser.single_file import write_single_file


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        pass


@contextmanager
def static_host(directory: Path) -> Iterator[str]:
    handler = functools.partial(_Quiet, directory=str(directory))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The parent of a website `lab` of a record whose first model has a hostile name."""
    folder = tmp_path_factory.mktemp("website")
    make_record(folder / "results", (HOSTILE, "fast"))
    done = vsnbench(folder / "results", "report", "--website", str(folder / "lab"), "--json")
    assert done.returncode == 0, done.stderr
    counts = json.loads(done.stdout)
    assert (counts["episodes"], counts["images"], counts["videos"], counts["problems"]) == (5, 12, 4, [])
    return folder


@pytest.mark.browser
def test_episodes_are_looked_at_without_a_server_of_ours(site: Path) -> None:
    with static_host(site) as address, chromium_page(1280, 800) as page:
        problems: list[str] = []
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: problems.append(request.url) if address not in request.url else None)
        page.goto(f"{address}/lab/")
        page.wait_for_selector(".tile .shot img")
        page.goto(f"{address}/lab/#/compare/1/4")
        page.wait_for_selector(".two .plan svg")
        page.keyboard.press("End")
        assert page.locator(".banner.failure").count() == page.locator(".banner.success").count() == 1
        page.keyboard.press("ArrowLeft")
        wait_until(lambda: page.evaluate("document.querySelector('.camera').naturalWidth") == 64, "an image is shown")
        assert page.locator("[data-annotation]").count() == 0
        page.goto(f"{address}/lab/index.html#/episode/4")
        page.wait_for_selector("#video")
        with page.expect_download() as video:
            page.click("#video")
        assert Path(video.value.path()).read_bytes()[4:8] == b"ftyp"
        page.get_by_role("link", name="Report").click()
        page.wait_for_selector("#answer")
        page.get_by_role("link", name="Episodes").first.click()
        page.wait_for_selector(".tile")
        assert page.evaluate("window.pwned") is None
        assert problems == []


@pytest.mark.browser
def test_episodes_open_as_files(site: Path) -> None:
    address = (site / "lab" / "index.html").as_uri()
    with chromium_page(1280, 800) as page:
        problems: list[str] = []
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.goto(address)
        page.wait_for_selector(".tile .plan svg")
        assert page.locator(".tile").count() == 5
        page.goto(f"{address}#/compare/1/4")
        page.wait_for_selector(".two .plan svg")
        wait_until(lambda: page.evaluate("document.querySelector('.camera').naturalWidth") == 64, "an image is shown")
        page.keyboard.press("End")
        assert page.locator(".banner.failure").count() == page.locator(".banner.success").count() == 1
        page.goto(f"{address}#/episode/77")
        page.wait_for_selector("#message:not([hidden])")
        assert [problem for problem in problems if "ERR_FILE_NOT_FOUND" not in problem] == []


@pytest.mark.browser
def test_films_play_from_files(tmp_path: Path) -> None:
    make_filmed_record(tmp_path / "results")
    done = vsnbench(tmp_path / "results", "report", "--website", str(tmp_path / "lab"), "--without-videos", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["images"] == 2 * (3 + 4), "images of the answers, and of the film between them"
    with chromium_page(390, 844) as page:
        page.goto(f"{(tmp_path / 'lab' / 'index.html').as_uri()}#/episode/1")
        page.wait_for_selector(".plan polygon")
        page.keyboard.press(" ")
        wait_until(lambda: page.locator(".banner.success").count() == 1, "the film has been played to its end")
        assert page.get_attribute(".camera", "src") == "images/1/3-1.jpg"
        wait_until(lambda: page.evaluate("document.querySelector('.camera').naturalWidth") == 64, "an image is shown")


def test_the_headline_has_the_rates_with_schema_and_version(site: Path) -> None:
    headline = json.loads((site / "lab" / "headline.json").read_text())
    assert headline["schema"] == 1
    rates = {condition["name"]: (condition["successes"], condition["episodes"]) for condition in headline["conditions"]}
    assert sorted(rates.values()) == [(1, 2), (2, 2)]
    assert all(0 <= condition["interval"][0] <= condition["interval"][1] <= 1 for condition in headline["conditions"])


def test_a_selection_limits_the_site_and_replaces_the_one_before(site: Path, tmp_path: Path) -> None:
    target = tmp_path / "site"
    for words in ([], ["--model", "fast", "--without-videos"]):
        assert vsnbench(site / "results", "report", "--website", str(target), *words).returncode == 0
    assert sorted(file.name for file in (target / "data").glob("episode-*.js")) == [
        "episode-4.json.js",
        "episode-5.json.js",
    ]
    assert sorted(file.name for file in (target / "images").iterdir()) == ["4", "5"]
    assert not (target / "video").exists()


def test_images_are_made_smaller_and_a_directory_of_others_is_not_touched(site: Path, tmp_path: Path) -> None:
    picture = cv2.imread(str(site / "lab" / "images" / "1" / "1.jpg"))
    assert picture is not None
    assert picture.shape == (48, 64, 3)
    (tmp_path / "thesis.tex").write_text("mine")
    done = vsnbench(site / "results", "report", "--website", str(tmp_path))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.fixture(scope="module")
def single(site: Path) -> Path:
    """The same record, with a note, as a single file."""
    with Journal.open(sqlite_url(site / "results" / "vsnbench.db")) as journal:
        journal.add_event("note", f"the door was half closed {HOSTILE}", author="ada", episode_id=4)
    file = site / "one.html"
    done = vsnbench(site / "results", "report", "--single-file", str(file), "--json")
    assert done.returncode == 0, done.stderr
    written = json.loads(done.stdout)
    assert (written["path"], written["episodes"], written["images"], written["every"]) == (str(file), 5, 12, 1)
    return file


@pytest.mark.browser
def test_a_single_file_shows_all_of_a_record_without_a_request(single: Path, tmp_path: Path) -> None:
    alone = tmp_path / "sent" / "results.html"
    alone.parent.mkdir()
    alone.write_bytes(single.read_bytes())
    with chromium_page(1280, 800, offline=True) as page:
        problems: list[str] = []
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: problems.append(request.url) if asked(request.url, alone) else None)
        page.goto(alone.as_uri())
        page.wait_for_selector(".tile .plan svg")
        assert page.locator(".tile").count() == 5
        wait_until(lambda: page.evaluate("document.querySelector('.shot img').naturalWidth") == 64, "a picture")
        page.fill("#search", "half closed")
        wait_until(lambda: page.locator(".tile").count() == 1, "the note is found")
        page.click(".tile .open")
        page.wait_for_selector(".plan polygon")
        assert "the door was half closed" in page.locator(".history").inner_text()
        page.click("nav a:text('Report')")
        report = page.frame_locator("iframe.report")
        report.locator("nav a", has_text="Tables").click()
        report.locator("nav a", has_text="Episodes").click()
        page.wait_for_selector(".tile")
        assert page.evaluate("window.pwned") is None
        assert problems == []


def asked(address: str, file: Path) -> bool:
    """Return whether an address is neither the file itself nor a part of it."""
    return not address.startswith("data:") and address.partition("#")[0] != file.as_uri()


def test_pictures_are_left_out_until_a_single_file_fits(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = ResultsDirectory.locate(site / "results", None)
    file = tmp_path / "results.html"
    whole = write_single_file(results, Selection(), file)
    sizes = [len(file.read_bytes())]
    monkeypatch.setattr(single_file, "MAX_BYTES", 0)
    least = write_single_file(results, Selection(), file)
    sizes.append(len(file.read_bytes()))
    assert (whole.images, whole.every) == (12, 1)
    assert least.images == 8, "the first and the last of each episode"
    assert sizes[1] < sizes[0]


def test_a_file_of_others_and_too_many_episodes_are_refused(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "thesis.html").write_text("mine")
    done = vsnbench(site / "results", "report", "--single-file", str(tmp_path / "thesis.html"))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert (tmp_path / "thesis.html").read_text() == "mine"
    monkeypatch.setattr(single_file, "MAX_EPISODES", 4)
    with pytest.raises(UsageError) as refused:
        write_single_file(ResultsDirectory.locate(site / "results", None), Selection(), tmp_path / "all.html")
    assert refused.value.code == "too-many-episodes"
    assert not (tmp_path / "all.html").exists()
