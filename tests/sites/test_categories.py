"""Advice for category names that a site file cannot have."""

import pytest

from vsnbench.sites.categories import suggest_category


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("hamster cage", "write hamster_cage"),
        ("Hamster-Cage", "write hamster_cage"),
        ("Sofa", "write sofa"),
        ("office chair", "write chair, and use the field model for the variant"),
        ("refrigerater", "did you mean refrigerator?"),
    ],
)
def test_the_advice_is_a_name_that_a_site_file_can_have(name: str, advice: str) -> None:
    assert suggest_category(name) == advice


def test_without_a_similar_name_all_categories_are_listed() -> None:
    assert suggest_category("käfig").startswith("known categories: bathtub, bed")
