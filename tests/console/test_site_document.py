import copy
from pathlib import Path

import pytest

from vsnbench.console.site_document import SiteDocument, save_document
from vsnbench.errors import SiteError
from vsnbench.protocol.site import embedded_sites, parse_site

TEXT = embedded_sites()["apartment"].read_text(encoding="utf-8")


def apartment() -> SiteDocument:
    return SiteDocument.of(TEXT, "apartment.yaml")


def changed_lines(before: str, after: str) -> tuple[list[str], list[str]]:
    old, new = before.splitlines(), after.splitlines()
    return [line for line in old if line not in new], [line for line in new if line not in old]


def test_what_nobody_touched_stays_as_it_was() -> None:
    assert apartment().with_content(apartment().for_page()).text == TEXT


def test_a_change_leaves_every_other_line_and_the_comment_behind_it() -> None:
    page = apartment().for_page()
    page["walls"][4]["end"] = [6.4, 7.4]
    gone, come = changed_lines(TEXT, apartment().with_content(page).text)
    assert gone == ["  - { start: [6.4, 3.9], end: [6.4, 7.5] } # bedroom, west"]
    assert come == ["  - { start: [6.4, 3.9], end: [6.4, 7.4] } # bedroom, west"]


def test_entries_come_and_go_and_the_site_says_what_the_page_said() -> None:
    page = apartment().for_page()
    del page["objects"][4], page["starts"][3]
    page["objects"][7]["color"] = "#ffffff"
    page["objects"].append({"id": "stool", "category": "chair", "position": [5, 3.00004], "size_m": [0.4, 0.4, 0.5]})
    page["title"] = "It says: true"
    page["survey_error_m"] = 0.02
    after = apartment().with_content(page)
    site = parse_site(after.text, "after")
    assert (site.title, site.survey_error_m) == ("It says: true", 0.02)
    assert [thing.id for thing in site.objects] == [thing["id"] for thing in page["objects"]]
    assert [start.number for start in site.starts] == [start["number"] for start in page["starts"]]
    assert site.objects[-1].position == (5, 3)
    assert "# Living room" in after.text
    again = after.for_page()
    assert after.with_content(copy.deepcopy(again)).text == after.text


def test_a_new_site_is_filled_and_emptied_again() -> None:
    new = SiteDocument.new("lab")
    page = new.for_page()
    page["walls"].append({"start": [0, 0], "end": [2, 0]})
    filled = new.with_content(page)
    assert "walls:\n  - { start: [0, 0], end: [2, 0] }\n" in filled.text
    emptied = filled.for_page()
    emptied["walls"] = []
    assert filled.with_content(emptied).content["walls"] == []


def test_entries_in_another_order_are_all_there() -> None:
    page = apartment().for_page()
    page["starts"].reverse()
    site = parse_site(apartment().with_content(page).text, "after")
    assert [start.number for start in site.starts] == list(range(15, 0, -1))


def test_a_file_that_somebody_else_changed_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "flat.yaml"
    path.write_text(TEXT, encoding="utf-8")
    opened = SiteDocument.of(TEXT, "flat")
    page = opened.for_page()
    page["title"] = "mine"
    save_document(opened.with_content(page), path, opened.sha256)
    page["title"] = "late"
    with pytest.raises(SiteError, match="changed by somebody else"):
        save_document(opened.with_content(page), path, opened.sha256)
    assert "title: mine" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "words"), [("- a\n", "is a mapping"), ("walls: [1]\n", "walls is no list of entries")]
)
def test_what_is_no_site_at_all_is_refused(text: str, words: str) -> None:
    with pytest.raises(SiteError, match=words):
        SiteDocument.of(text, "flat.yaml")
