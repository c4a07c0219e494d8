"""Lists on the command line: repetition, commas and ranges."""

from pathlib import Path

from vsnbench.cli.support.lists import split_list, split_numbers, split_sites


def test_repetition_and_commas_give_one_list_without_duplicates() -> None:
    assert split_list(["a,b", "c", " b , d"]) == ("a", "b", "c", "d")
    assert split_list(None) == split_list([","]) == ()


def test_a_path_with_a_comma_is_one_item(tmp_path: Path) -> None:
    file = tmp_path / "a,b.yaml"
    file.touch()
    assert split_list([str(file)]) == split_sites([str(file)]) == (str(file),)


def test_numbers_are_ranges_in_the_order_given() -> None:
    assert split_numbers(["0-2,7", "5", "1"], "--seed", "0-9") == (0, 1, 2, 7, 5)
    assert split_numbers(None, "--seed", "0-9") == ()


def test_sites_are_names_and_generated_flats_in_any_order() -> None:
    assert split_sites(["lab.yaml,flat:0-2,7,apartment", "flat:9"]) == (
        *("lab.yaml", "flat:0", "flat:1", "flat:2", "flat:7", "apartment", "flat:9"),
    )
