"""Lists on the command line: repeated options, commas and ranges."""

from collections.abc import Sequence
from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.text.number_ranges import read_numbers

_FLATS = "flat:"


def split_list(values: Sequence[str] | None) -> tuple[str, ...]:
    """Return the items of a repeated option, without duplicates: `a,b` and `c` are three.

    The path of an existing file is one item, even with a comma in it.
    """
    items: dict[str, None] = {}
    for value in values or ():
        parts = [value] if "," in value and Path(value).is_file() else value.split(",")
        items |= dict.fromkeys(part.strip() for part in parts if part.strip())
    return tuple(items)


def split_numbers(values: Sequence[str] | None, option: str, example: str) -> tuple[int, ...]:
    """Return the numbers of a repeated option whose values are like `0-9,12`.

    Raises:
        UsageError: a value is not a list of numbers and ranges.
    """
    return read_numbers(",".join(values), option, example) if values else ()


def split_sites(values: Sequence[str]) -> tuple[str, ...]:
    """Return the sites of `--site`: names, files, and generated flats as `flat:0-19,25`.

    Raises:
        UsageError: a part of a value is not a site.
    """
    sites: dict[str, None] = {}
    for value in values:
        parts = [value] if Path(value).is_file() else value.split(",")
        in_flats = False  # numbers that follow `flat:` are seeds as well
        for part in (piece.strip() for piece in parts):
            in_flats = part.startswith(_FLATS) or (in_flats and part[:1].isdecimal())
            if in_flats:
                seeds = read_numbers(part.removeprefix(_FLATS), "--site", "flat:0-19", typed=value)
                sites |= dict.fromkeys(f"{_FLATS}{seed}" for seed in seeds)
            elif part:
                sites[part] = None
            else:
                raise UsageError(
                    f"cannot read --site {value!r}", advice="give sites like apartment,flat:0-19", code="invalid-site"
                )
    return tuple(sites)
