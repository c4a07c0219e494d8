from vsnbench.text.suggestions import closest, unknown_name


def test_a_mistyped_name_gets_the_closest_known_one() -> None:
    assert closest("chiar", ["sofa", "chair"]) == "chair"
    assert unknown_name("goal", "chiar", ["sofa", "chair"], "this record") == (
        "goal 'chiar' is not in this record. Did you mean 'chair'?"
    )


def test_a_name_like_no_other_gets_the_list() -> None:
    assert closest("xyz", ["sofa"]) == ""
    assert unknown_name("site", "xyz", ["lab", "flat"], "this record").endswith("It has flat, lab.")
    assert unknown_name("site", "xyz", [], "this record").endswith("It has none.")
