"""Reads lists of numbers and ranges: `0-9,12`."""

from collections.abc import Callable

from vsnbench.errors import UsageError

MAX_NUMBERS = 100_000
"""Maximum length of a range; a longer one is a typing error."""


def read_numbers(
    text: str, option: str, example: str, check_last: Callable[[int], object] = lambda _: None, *, typed: str = ""
) -> tuple[int, ...]:
    """Return the numbers in a text like `0-9,12`, without duplicates and in the order given.

    Args:
        text: numbers and ranges, separated by commas.
        option: option that the text comes from, for errors.
        example: valid text, for errors.
        check_last: receives the last number of each part before the part is expanded; may raise.
        typed: complete value of the option if `text` is a part of it, for errors.

    Raises:
        UsageError: a part is not a number or range, or a range is empty or too long.
    """
    numbers: dict[int, None] = {}
    where = f"{option} {typed or text}"
    for part in (piece.strip() for piece in text.split(",")):
        first, dash, last = part.partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise UsageError(
                f"cannot read {part!r} in {where}",
                advice=f"give numbers and ranges, like {example}",
                code="invalid-numbers",
            )
        chosen = range(int(first), int(last if dash else first) + 1)
        if not chosen:
            raise UsageError(
                f"the range {part} in {where} is empty", advice="give the smaller number first", code="invalid-numbers"
            )
        check_last(chosen[-1])
        if len(chosen) > MAX_NUMBERS or chosen[-1] >= 2**63:
            raise UsageError(f"the range {part} in {where} has too many or too large numbers", code="invalid-numbers")
        numbers |= dict.fromkeys(chosen)
    return tuple(numbers)
