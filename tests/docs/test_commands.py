"""Every command of docs/ is typed at a shell, page by page, or stands in one table with the reason why it is not."""

import os
import re
import shlex
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.docs.pages import PAGES, ROOT, Block, blocks, look_at, plain, scripts, spans, typed_elsewhere, understand
from tests.docs.reading import Shell
from tests.docs.warm import warm_vsnbench
from tests.docs.worlds import BEFORE
from tests.ros1.network import RosNetwork, live_network

NOT_RUN = {
    "a robot": "its base, its camera and whoever carries it; robot.md's own are run against `ros1 simulate`, below",
    "a robot on ROS 1": "run below, against `ros1 simulate`, where ROS 1 is",
    "ROS 1": "run below: four terminals, of which one plays the robot",
    "ROS 1 and a person": "tests/console/at_the_page.py plays who carries the robot, in tests/robots and tests/ros2",
    "a robot on ROS 2": "its network; tests/ros2 drives the same verbs against `ros2 simulate`",
    "ROS 2": "its packages must not be in one environment with the tests; tests/ros2 runs the rehearsal",
    "the robot's computer": "drivers of the base and the camera, which are others' programs",
    "a cluster": "its machines; tests/runner/pool runs trials on a Ray cluster of this one",
    "a bare machine": "installs hundreds of megabytes; `make test` itself begins with `make setup`",
    "hours": "measures or trains for as long",
    "an address": "of weights that somebody hands out; tests/cli/test_models.py fetches from a server of its own",
}
"""What a block needs, as the page says in a comment before it -> why its commands are looked at and not run."""

OF_A_ROBOT = re.compile(r"vsnbench (ros[12]|doctor)\b|--robot (?!simulated|\w+:)|--cluster|^(pip|make|ray|ros\w+) ")
"""What a block may ask for only where the page says what it needs."""
SERVED = (
    (re.compile(r"vsnbench sites edit "), " --port 0", 0),
    (re.compile(r"vsnbench report --serve"), "", 0),
    (re.compile(r"vsnbench (study )?run .*--console\b"), " --console-port 0", 130),
)
"""What serves a page until Ctrl-C, the port that keeps two of a machine apart, and the exit code."""
LONG = re.compile(r"vsnbench (run (?!.*--starts)|study run|sites scan .*--auto)")
"""What takes minutes: it is begun, and ended by Ctrl-C when it gets on."""
ANOTHERS = {"sqlite3 ": "test -f "}
"""Another's program, which need not be there -> what sees that it is handed what the page says."""
ENDS_WITH = {"vsnbench place": (0, 1), "vsnbench doctor": (0, 1)}
"""Commands whose exit code tells what they found: a robot off its mark, a machine too busy to play one."""


def needs_of(page: Path) -> list[Block]:
    return [block for block in blocks(page.read_text(encoding="utf-8")) if block.needs]


def run_here(page: Path) -> list[str]:
    return [one for block in blocks(page.read_text(encoding="utf-8")) if not block.needs for one in block.commands]


TYPED = [page for page in PAGES if run_here(page)]


def test_the_pages_have_commands_and_every_reason_is_of_a_block() -> None:
    assert len(TYPED) > 10
    assert sum(len(run_here(page)) for page in TYPED) > 50
    assert {block.needs for page in PAGES for block in needs_of(page)} == NOT_RUN.keys()
    assert {page.name for page in TYPED} >= BEFORE.keys()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_is_to_be_typed_stands_in_a_shell_block_and_names_what_there_is(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert typed_elsewhere(text) == []
    for block in blocks(text):
        for command in block.commands:
            look_at(command)
            assert block.needs or not OF_A_ROBOT.search(command), f"{command}: say <!-- needs: ... --> before its block"
    for words in spans(text):
        understand(shlex.split(plain(words))[1:], strict=False)
    assert [script for script in scripts(text) if not (ROOT / script).is_file()] == []


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """What the pages' directories share: the machine's cache, and a vsnbench that has made its imports."""
    directory = tmp_path_factory.mktemp("machine")
    with warm_vsnbench(directory / "bin") as warm:
        path = f"{warm}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        yield {"XDG_CACHE_HOME": str(directory / "cache"), "PATH": path}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", TYPED, ids=lambda page: page.name)
def test_the_commands_of_a_page_do_what_it_says_one_after_the_other(
    page: Path, machine: dict[str, str], tmp_path: Path
) -> None:
    shell = Shell(tmp_path, machine)
    if page.name in BEFORE:
        BEFORE[page.name](shell)
    for command in run_here(page):
        type_as_meant(shell, command)


def type_as_meant(shell: Shell, command: str) -> None:
    """Type a command; one that goes on until Ctrl-C is given it."""
    line = command if "\n" in command else plain(command)
    for program, stand_in in ANOTHERS.items():
        line = line.replace(program, stand_in)
    for serves, port, code in SERVED:
        if serves.search(line):
            shell.serves(line + port, code)
            return
    if line.endswith("--watch"):
        shell.says(line, "waiting for a change", 130)
    elif LONG.search(line):
        shell.begins(line)
    else:
        shell.types(line, next((codes for start, codes in ENDS_WITH.items() if line.startswith(start)), (0,)))


@pytest.mark.slow
def test_the_question_in_sql_is_answered_by_a_record(tmp_path: Path, machine: dict[str, str]) -> None:
    shell = Shell(tmp_path, machine)
    BEFORE["results.md"](shell)
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    (question,) = re.findall(r"^```sql\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    with closing(sqlite3.connect(tmp_path / "results" / "vsnbench.db")) as record:
        assert record.execute(question).fetchall() == [("bed", 0, 1)]


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[RosNetwork]:
    with live_network(tmp_path) as network:
        yield network


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_rehearsal_of_a_robot_on_ros_1_runs_in_its_terminals(ros: RosNetwork, tmp_path: Path) -> None:
    on_it = {name: ros.environment[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")}
    shell = Shell(tmp_path, on_it)
    of_robot = needs_of(ROOT / "docs" / "robot.md")
    (terminals,) = (block.commands for block in of_robot if block.needs == "ROS 1")
    roscore, simulate, mover, run = map(plain, terminals)
    assert roscore == "roscore", "the network's own, on a port of its own"
    with shell.running(simulate), shell.running(mover):
        ros.wait_for_publisher("/odom")
        ros.wait_for_service("/discrete_move")
        shell.types("vsnbench robots show turtlebot2 > my-robot.yaml")
        for block in of_robot:
            for command in block.commands if block.needs == "a robot on ROS 1" else ():
                type_as_meant(shell, command)
        shell.begins(run)
