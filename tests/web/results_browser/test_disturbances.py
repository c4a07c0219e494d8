"""A disturbance is visible in every list, and a trial with it and without it open side by side."""

import json
from pathlib import Path

import pytest

from tests.cli.chromium import chromium_page
from tests.cli.test_record_verbs import vsnbench
from tests.web.results_browser.served_record import make_record, served
from vsnbench.protocol.disturbances import parse_disturbances

BLUR = "blur=2,glare=0.6"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of one model: campaign 1 with disturbances, 2 without."""
    directory = tmp_path_factory.mktemp("disturbed") / "results"
    make_record(directory, ("same", "same"), parse_disturbances(["glare@3", "blur=2"]))
    return directory


def test_campaigns_in_the_status_differ_by_their_disturbances(results: Path) -> None:
    done = vsnbench(results, "db", "status", "--json")
    campaigns = json.loads(done.stdout)["campaigns"]
    assert [campaign["disturbances"] for campaign in campaigns] == [BLUR, ""]
    shown = vsnbench(results, "db", "status").stdout
    assert shown.count(BLUR) == 1  # the table may break the name before it


@pytest.mark.parametrize(
    ("words", "episodes"),
    [
        (["--disturb", "glare=0.6,blur@2"], [1, 2, 3]),
        (["--disturb", "none"], [4, 5]),
        (["--disturb", "blur"], []),
        ([], [1, 2, 3, 4, 5]),
    ],
)
def test_the_list_is_filtered_by_disturbances(results: Path, words: list[str], episodes: list[int]) -> None:
    listed = json.loads(vsnbench(results, "episodes", "list", "--json", *words).stdout)
    assert sorted(episode["id"] for episode in listed) == episodes
    assert {episode["id"] for episode in listed if episode["disturbances"] == BLUR} == {1, 2, 3} & set(episodes)
    table = vsnbench(results, "episodes", "list", *words).stdout
    assert ("blur=2" in table) == (1 in episodes)


@pytest.mark.browser
def test_a_trial_with_and_without_a_disturbance_open_side_by_side(results: Path) -> None:
    with served(results) as address, chromium_page(1280, 800) as page:
        page.goto(f"{address}#/?view=list")
        page.wait_for_selector(".rows .line")
        models = page.locator(".rows .cell.model").all_inner_texts()
        assert sorted(models) == ["same", "same", *[f"same with {BLUR}"] * 3]
        page.select_option("#filter-disturbances", "none")
        page.wait_for_function("document.querySelectorAll('.rows .line').length === 2")
        page.select_option("#filter-disturbances", BLUR)
        page.wait_for_function("document.querySelectorAll('.rows .line').length === 3")
        page.select_option("#filter-disturbances", "")
        page.select_option("#filter-differ", f"same with {BLUR} failed, same succeeded")
        page.wait_for_selector(".pairs .line")
        page.locator(".rows .open").first.click()
        page.wait_for_selector(".two .player")
        headings = page.locator(".player h2").all_inner_texts()
        assert [heading.split(" ", 1)[1].split(" chair")[0] for heading in headings] == [f"same with {BLUR}", "same"]
        page.goto(f"{address.partition('?')[0]}#/?view=grid")
        page.wait_for_selector(".grid")
        assert page.locator(".grids h2").count() == 2
