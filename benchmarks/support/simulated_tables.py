"""The command line of benchmarks whose result is a page with several simulated tables."""

import argparse
from collections.abc import Callable
from pathlib import Path

Table = tuple[list[str], list[Callable[[], str]]]
"""The header of a table, and the jobs that return its lines."""


def print_tables(about: str, tables: Callable[[int], dict[str, Table]], page: Path, *, unit: str, count: int) -> None:
    """Simulate and print tables by name; write them into a page between their marks with `--write`.

    Args:
        about: help of the program.
        tables: returns the tables for a number of simulated samples per line.
        page: page of results.
        unit: what is simulated, in the plural: the option with its number.
        count: default of the number.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(f"--{unit}", dest="count", type=int, default=count, help=f"number of {unit} per line")
    parser.add_argument("--only", help="name of one table")
    parser.add_argument("--write", action="store_true", help="write the tables into benchmarks/results/")
    options = parser.parse_args()
    for name, (lines, jobs) in tables(options.count).items():
        if options.only in (None, name):
            print(f"\n{name}", *lines, sep="\n")
            for job in jobs:
                lines.append(job())
                print(lines[-1], flush=True)
            if options.write:
                _write(page, name, lines)


def _write(page: Path, name: str, lines: list[str]) -> None:
    """Write a table between its marks."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    text = page.read_text(encoding="utf-8")
    before, after = text.split(begin)[0], text.split(end)[1]
    page.write_text(before + begin + "\n".join(lines) + "\n" + end + after, encoding="utf-8")
