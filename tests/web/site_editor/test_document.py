"""Editing of a site file's text, with comments and layout kept."""

import copy
from pathlib import Path

import pytest

from vsnbench.errors import SiteError
from vsnbench.sites.site import embedded_sites, parse_site
from vsnbench.web.site_editor.document import SiteDocument, save_document

TEXT = embedded_sites()["apartment"].read_text(encoding="utf-8")


def apartment() -> SiteDocument:
    return SiteDocument.of(TEXT, "apartment.yaml")


def changed_lines(before: str, after: str) -> tuple[list[str], list[str]]:
    old, new = before.splitlines(), after.splitlines()
    return [line for line in old if line not in new], [line for line in new if line not in old]


def test_an_unchanged_site_keeps_its_text() -> None:
    assert apartment().with_content(apartment().as_json()).text == TEXT


def test_a_change_keeps_other_lines_and_the_comment_on_its_line() -> None:
    page = apartment().as_json()
    page["walls"][4]["end"] = [6.4, 7.4]
    removed, added = changed_lines(TEXT, apartment().with_content(page).text)
    assert removed == ["  - { start: [6.4, 3.9], end: [6.4, 7.5] } # bedroom, west"]
    assert added == ["  - { start: [6.4, 3.9], end: [6.4, 7.4] } # bedroom, west"]


def test_added_and_removed_entries_are_in_the_site() -> None:
    page = apartment().as_json()
    del page["objects"][4], page["starts"][3]
    page["objects"][7]["color"] = "#ffffff"
    page["objects"].append({"id": "stool", "category": "chair", "position": [5, 3.00004], "size_m": [0.4, 0.4, 0.5]})
    page["title"] = "Flat: true"
    page["survey_error_m"] = 0.02
    after = apartment().with_content(page)
    site = parse_site(after.text, "after")
    assert (site.title, site.survey_error_m) == ("Flat: true", 0.02)
    assert [item.id for item in site.objects] == [item["id"] for item in page["objects"]]
    assert [start.number for start in site.starts] == [start["number"] for start in page["starts"]]
    assert site.objects[-1].position == (5, 3)
    assert "# Living room" in after.text
    again = after.as_json()
    assert after.with_content(copy.deepcopy(again)).text == after.text


def test_lists_of_a_new_site_are_filled_and_emptied() -> None:
    new = SiteDocument.new("lab")
    page = new.as_json()
    page["walls"].append({"start": [0, 0], "end": [2, 0]})
    filled = new.with_content(page)
    assert "walls:\n  - { start: [0, 0], end: [2, 0] }\n" in filled.text
    emptied = filled.as_json()
    emptied["walls"] = []
    assert filled.with_content(emptied).content["walls"] == []


def test_reordered_entries_are_all_kept() -> None:
    page = apartment().as_json()
    page["starts"].reverse()
    site = parse_site(apartment().with_content(page).text, "after")
    assert [start.number for start in site.starts] == list(range(15, 0, -1))


def test_a_file_changed_by_another_program_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "flat.yaml"
    path.write_text(TEXT, encoding="utf-8")
    opened = SiteDocument.of(TEXT, "flat")
    page = opened.as_json()
    page["title"] = "mine"
    save_document(opened.with_content(page), path, opened.sha256)
    page["title"] = "late"
    with pytest.raises(SiteError) as error:
        save_document(opened.with_content(page), path, opened.sha256)
    assert error.value.code == "changed-meanwhile"
    assert "title: mine" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("text", ["- a\n", "walls: [1]\n"])
def test_a_text_without_the_lists_of_a_site_is_refused(text: str) -> None:
    with pytest.raises(SiteError):
        SiteDocument.of(text, "flat.yaml")


GOALS = """
goals: # surveyed with the lab
  - {id: red-armchair, kind: text, text: the red armchair, targets: [armchair]} # by the window
  # the route of the demonstration
  - id: to-the-kitchen
    kind: instruction
    text: >
      leave the bedroom
      and stop in the kitchen
    targets: # the counter counts too
    - region: [[0.6, 5.9], [3.9, 5.9], [3.9, 6.8], [0.6, 6.8]]
      name: kitchen
    - counter-2
    starts:
      - 1
      - 2
"""


def goals_of(text: str) -> list[dict[str, object]]:
    return [goal.content() for goal in parse_site(text, "after").goals]


def test_goals_keep_their_text_and_comments_when_others_change() -> None:
    document = SiteDocument.of(TEXT + GOALS, "lab.yaml")
    page = document.as_json()
    assert document.with_content(page).text == TEXT + GOALS
    page["goals"][0]["text"] = "the old armchair"
    page["goals"].append({"id": "sofa-or-rug", "kind": "text", "text": "a soft place", "targets": ["sofa-1"]})
    after = document.with_content(page)
    removed, added = changed_lines(TEXT + GOALS, after.text)
    assert len(removed) == 1
    assert added == [
        '  - {id: red-armchair, kind: text, text: "the old armchair", targets: [armchair]} # by the window',
        '  - { id: sofa-or-rug, kind: text, text: "a soft place", targets: [sofa-1] }',
    ]
    assert [goal["id"] for goal in goals_of(after.text)] == ["red-armchair", "to-the-kitchen", "sofa-or-rug"]


def test_changed_fields_on_lines_of_their_own_stay_valid() -> None:
    document = SiteDocument.of(TEXT + GOALS, "lab.yaml")
    page = document.as_json()
    page["goals"][1] |= {"text": "stop in the kitchen", "starts": [3], "targets": ["sofa-1", {"point": [1.00004, 2]}]}
    after = document.with_content(page)
    assert "# the route of the demonstration" in after.text
    (goal,) = goals_of(after.text)[1:]
    assert (goal["text"], goal["starts"]) == ("stop in the kitchen", [3])
    assert goal["targets"] == [{"object": "sofa-1"}, {"point": [1.0, 2.0]}]
    del page["goals"][0]
    assert [goal["id"] for goal in goals_of(document.with_content(page).text)] == ["to-the-kitchen"]
