"""A campaign that is new because its model changed lists the changes."""

from dataclasses import replace

import pytest

from tests.results.records_of_a_lab import plan
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.model_history import differences
from vsnbench.values.model.card import ModelCard

MODEL = ModelCard(
    "lab",
    weights_sha256="a" * 64,
    settings={"temperature": 0.5},
    files={"weights": "b" * 64},
    code={"class": "lab:Lab", "sha256": "c" * 64, "commit": "d" * 40},
)


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (MODEL, ()),
        (replace(MODEL, weights_label="another name"), ()),
        (replace(MODEL, weights_sha256="e" * 64), ("weights (aaaaaaaaaaaa → eeeeeeeeeeee)",)),
        (replace(MODEL, files={"weights": "f" * 64}), ("file --weights (bbbbbbbbbbbb → ffffffffffff)",)),
        (replace(MODEL, files={}), ("file --weights (bbbbbbbbbbbb → none)",)),
        (replace(MODEL, settings={"temperature": 1.0}), ("setting temperature (0.5 → 1.0)",)),
        (
            replace(MODEL, code={**MODEL.code, "sha256": "0" * 64, "commit": "d" * 40 + "+changes"}),
            (f"code commit ({'d' * 40} → {'d' * 40}+)", "code sha256 (cccccccccccc → 000000000000)"),
        ),
        (replace(MODEL, surveyed=True), ("access to the site file",)),
    ],
)
def test_differences_are_named_with_what_was_and_what_is(now: ModelCard, words: tuple[str, ...]) -> None:
    assert differences(MODEL, now) == words


def test_only_a_new_campaign_of_another_model_of_the_same_name_says_so(url: str) -> None:
    first = replace(plan(), model=MODEL)
    edited = replace(first, model=replace(MODEL, files={"weights": "f" * 64}))
    with Journal.open(url) as journal:
        said = [
            journal.model_change(journal.find_or_create_campaign(each), each.model)
            for each in (first, first, edited, replace(edited, seed=8), replace(edited, model=ModelCard("other")))
        ]
    assert said == [
        "",
        "",
        "model lab differs from that of campaign 1: file --weights (bbbbbbbbbbbb → ffffffffffff)",
        "",
        "",
    ]


def test_of_a_nested_setting_only_what_differs_is_told_and_no_hash_is_cut_away() -> None:
    old, new = (
        replace(MODEL, settings={"code": {"class": "mylab.policy:Agent" * 4, "sha256": each * 64}}) for each in "ab"
    )
    assert differences(old, new) == (f"setting code.sha256 ({'a' * 12} → {'b' * 12})",)
