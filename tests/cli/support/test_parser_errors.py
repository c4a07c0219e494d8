"""Command lines that do not parse: one line with the parser's suggestion, and exit code 2."""

from collections.abc import Callable

import pytest

from tests.cli.console import Answer

Typed = Callable[..., Answer]
RUN = ("run", "--model", "oracle", "--goal", "chair")


@pytest.mark.parametrize(
    ("words", "mentioned"),
    [
        (("report", "--mdoel", "x"), ("--mdoel", "--model", "`vsnbench report -h`")),
        (("report", "17"), ("17", "`vsnbench report -h`")),
        (("report", "--format", "pdf"), ("--format' / '-f': 'pdf'", "'latex'")),
        (("export", "csv"), ("--output", "`vsnbench export csv -h`")),
        (("export", "mcap", "foxglove/", "17"), ("--output foxglove/", "`vsnbench export mcap -h`")),
        (("episodes", "list", "--limit", "-1"), ("--limit", "`vsnbench episodes list -h`")),
        (("episodes", "show", "last"), ("not an integer", "`vsnbench episodes show -h`")),
        (("report", "--output", "report.html"), ("--output", "report.html")),
        (("run", "--goals", "chair"), ("--goals", "--goal")),
        (("run",), ("--model", "`vsnbench run -h`")),
        (("run", "--model"), ("--model", "`vsnbench run -h`")),
        ((*RUN, "--seed", "-1"), ("--seed", "'-1'")),
        ((*RUN, "--seed", "9-0"), ("--seed", "9-0")),
        ((*RUN, "--workers", "many"), ("--workers", "auto", "ray://HEAD:PORT")),
        ((*RUN, "--repetitions", "many"), ("--repetitions", "integer")),
        (("view", "last"), ("EPISODE", "integer")),
        (("view",), ("episode", "`vsnbench view -h`")),
        (("sites", "chek"), ("'chek'", "'check'", "`vsnbench sites -h`")),
        (("db", "frobnicate"), ("'frobnicate'", "`vsnbench db -h`")),
        (("reprot",), ("'reprot'", "'report'", "`vsnbench -h`")),
        (("report", "--results", ""), ("--results is empty",)),
        (("report", "--output="), ("--output is empty",)),
        (("-v", "run", "--seeds", "0-9"), ("--seeds", "--seed")),
        (("-x",), ("-x", "`vsnbench -h`")),
        (("judge", "1", "--void", "--quiet"), ("--void", "'--quiet'")),
        (("--\x1b[2Jx",), (r"--\x1b[2Jx",)),
        (("\x1b[2J",), (r"\x1b[2J",)),
    ],
)
def test_a_command_line_that_does_not_parse_gives_one_line(
    typed: Typed, words: tuple[str, ...], mentioned: tuple[str, ...]
) -> None:
    answer = typed(*words)
    assert answer.code == 2
    assert answer.err.startswith("vsnbench: error: ")
    assert [each for each in mentioned if each not in answer.err] == []
    assert answer.err.count("\n") == 1
    assert answer.err.removesuffix("\n").isprintable()
    assert answer.out == ""


def test_a_command_group_alone_shows_its_help(typed: Typed) -> None:
    answer = typed("episodes")
    assert answer.code == 2
    assert "Usage: vsnbench episodes" in answer.out + answer.err
    assert "error" not in answer.err
