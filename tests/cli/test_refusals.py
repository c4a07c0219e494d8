"""What is typed in a first hour and is no word of ours: one line, exit code 2, and what to type in its place."""

from collections.abc import Callable

import pytest

from tests.cli.console import Answer

Typed = Callable[..., Answer]
RUN = ("run", "--model", "oracle", "--goal", "chair")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("report", "--html"), "`vsnbench report` has no option --html: `--output report/` writes report.html"),
        (("report", "--csv"), "has no option --csv: `--format csv`"),
        (("report", "--mdoel", "x"), "has no option --mdoel: did you mean --model?"),
        (
            ("report", "17"),
            "takes no 17: `vsnbench episodes show 17` has an episode, `vsnbench report --campaign 17` a",
        ),
        (("report", "chair"), "`vsnbench report` takes no chair: `vsnbench report --goal chair`"),
        (("report", "--format", "pdf"), "--format: 'pdf' is not one of 'table', 'markdown', 'latex'"),
        (("report", "--output", "report.html"), "--output report.html is a directory's place: it gets report.html and"),
        (("run", "--goals", "chair"), "`vsnbench run` has no option --goals: did you mean --goal?"),
        (("run",), "`vsnbench run` needs --model: `vsnbench run --model pirlnav --goal chair`, for instance"),
        (("run", "--model"), "--model needs a value, and none follows it"),
        ((*RUN, "--seed", "0-9"), "--seed: '0-9' is no number; `--seeds 0-9` has a campaign for each"),
        ((*RUN, "--seed", "-1"), "--seed: -1 is too small (0 at least); `--seeds 0-9` has a campaign for each"),
        ((*RUN, "--repetitions", "many"), "--repetitions: 'many' is no whole number"),
        ((*RUN, "--sim"), "has no option --sim: a simulated robot is what drives where no --robot is given"),
        ((*RUN, "--output", "x"), "has no option --output: `--results DIR` says where the record lies"),
        ((*RUN, "--resume"), "none is needed: the same `vsnbench run ...` goes on with the trials that are left"),
        (("view", "last"), "episode: 'last' is no whole number; `vsnbench episodes list` has their numbers"),
        (("view",), "`vsnbench view` needs an episode: `vsnbench episodes list` has their numbers"),
        (("compare",), "`vsnbench compare` needs models: `vsnbench compare vlv pirlnav`, for instance"),
        (("sites", "check"), "needs a site name: `vsnbench sites check my-flat.yaml`, for instance"),
        (("sites", "new", "lab.yaml"), "`vsnbench sites edit lab.yaml` draws one, `vsnbench init DIR` writes one"),
        (("sites", "validate", "lab.yaml"), "there is no `vsnbench sites validate`: `vsnbench sites check`"),
        (("sites", "chek"), "there is no `vsnbench sites chek`: `vsnbench sites check`"),
        (("db", "frobnicate"), "there is no `vsnbench db frobnicate`: there are path, status, "),
        (("episodes", "17"), "there is no `vsnbench episodes 17`: `vsnbench episodes show 17`"),
        (("judge", "1", "--success"), "--success: `--confirm` takes the proposal, `--distance 0.84` a measured"),
        (("doctor", "turtlebot2"), "takes no turtlebot2: `vsnbench doctor --robot turtlebot2`?"),
        (("list",), "there is no `vsnbench list`: `vsnbench episodes list` has the attempts, `vsnbench db status` the"),
        (("status",), "there is no `vsnbench status`: `vsnbench episodes list` has the attempts"),
        (("help", "run"), "there is no `vsnbench help`: `vsnbench -h`, or `vsnbench run -h`"),
        (("evaluate", "--model", "x"), "`vsnbench run --model pirlnav --goal chair` runs trials"),
        (("reprot",), "there is no `vsnbench reprot`: `vsnbench report`"),
        (("-v",), "`vsnbench` has no option -v: `vsnbench --version`"),
        (("--\x1b[2Jx",), r"has no option --\x1b[2Jx"),
        (("\x1b[2J",), r"there is no `vsnbench \x1b[2J`"),
    ],
)
def test_what_does_not_parse_is_one_line_that_says_what_to_type(
    typed: Typed, words: tuple[str, ...], said: str
) -> None:
    answer = typed(*words)
    assert answer.code == 2
    assert answer.err.startswith("vsnbench: error: ")
    assert said in answer.err
    assert answer.err.count("\n") == 1
    assert answer.err.removesuffix("\n").isprintable()
    assert answer.out == ""


def test_a_group_of_verbs_alone_teaches_itself(typed: Typed) -> None:
    answer = typed("episodes")
    assert answer.code == 2
    assert "Usage: vsnbench episodes" in answer.out + answer.err
    assert "error" not in answer.err
