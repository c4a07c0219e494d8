"""Runs every command of README and docs/ at a shell; a table has the reasons for those that cannot run."""

import os
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import (
    PAGES,
    ROOT,
    Block,
    blocks,
    check_names,
    commands_outside_blocks,
    plain,
    scripts,
    spans,
    understand,
)
from tests.docs.reading import TIME_LIMIT_S, Shell
from tests.docs.warm import warm_vsnbench
from tests.docs.worlds import BEFORE
from tests.ros.ros1.network import RosNetwork, live_network

NOT_RUN = {
    "a robot": "a base, a camera and an operator",
    "a robot on ROS 1": "runs below against a simulated robot, if ROS 1 is installed",
    "ROS 1": "runs below, in four terminals, if ROS 1 is installed",
    "a robot on ROS 2": "tests/ros/ros2 runs the same commands against a simulated robot",
    "ROS 2": "its packages must not share an environment with the tests; tests/ros/ros2 runs the rehearsal",
    "the robot's computer": "drivers of base and camera",
    "a cluster": "tests/runner/executors runs trials on a local Ray cluster",
    "a bare machine": "installs hundreds of megabytes; `make test` begins with `make setup`",
    "a second terminal": "tests/runner/executors/test_served_workers.py serves a model to several workers",
    "Node": "tests/examples/test_node_policy.py starts the server and runs a goal in words, if Node is installed",
    "a person": "tests/web/driver drives through the page, in a run and in a browser",
    "a scan": "tests/cli/test_site_scan.py imports made scans and runs trials in them",
    "a display": "tests/cli/results/test_view.py opens Rerun's viewer in a browser",
    "an address": "of weights; tests/cli/models/test_fetching.py fetches from a local server",
}
"""What a block needs, from the comment before it -> why it is parsed instead of run."""

NEEDS_MORE = re.compile(
    r"vsnbench (doctor|robots (simulate|serve|undock|calibrate))\b"
    r"|--robot (?!simulated|\w+:)|--workers ray|^(pip|make|ray|node|ros\w+) "
)
"""Commands that are allowed only in a block that names its needs."""
SERVED = (
    (re.compile(r"vsnbench sites edit "), " --port 0", 0),
    (re.compile(r"vsnbench report --serve"), "", 0),
    (re.compile(r"vsnbench browse"), " --port 0", 0),
    (re.compile(r"vsnbench judge --second"), " --port 0", 0),
    (re.compile(r"vsnbench (study )?run .*--console$"), " 127.0.0.1:0", 130),
)
"""Commands that serve a page until Ctrl-C, an option for a free port, and the exit code."""
LONG = re.compile(r"vsnbench ((run|stress) (?!.*--starts)|study run)")
"""Commands that take minutes: started, and interrupted when they make progress."""
STAND_INS = {"sqlite3 ": "test -f "}
"""Program that may not be installed -> replacement that checks its argument."""
ENDS_WITH = {"vsnbench place": (0, 1), "vsnbench doctor": (0, 1)}
"""Commands whose exit code depends on what they find."""


def needs_of(page: Path) -> list[Block]:
    return [block for block in blocks(page.read_text(encoding="utf-8")) if block.needs]


def run_here(page: Path) -> list[str]:
    return [
        command for block in blocks(page.read_text(encoding="utf-8")) if not block.needs for command in block.commands
    ]


LONG_PAGES = {
    "command-line.md": "tests/cli/running/test_run_pirlnav.py, tests/cli/running/test_run.py",
    "bundle.md": "tests/evidence/bundle/test_make.py, tests/cli/evidence/test_verify.py",
    "export.md": "tests/cli/results/test_export.py, tests/interop",
    "first-table.md": "tests/cli/results/test_report.py",
    "look.md": "tests/cli/results/test_browse.py, tests/web/results_browser",
    "models.md": "tests/cli/models, tests/cli/test_init.py",
    "pirlnav.md": "tests/cli/running/test_run_pirlnav.py",
    "report.md": "tests/golden, tests/cli/results/test_report.py",
    "scale.md": "tests/runner/executors",
    "stress.md": "tests/cli/running/test_stress.py",
    "study.md": "tests/cli/study",
    "vlv.md": "tests/models/vlv/test_policy.py",
}
"""Pages whose commands take minutes -> tests that run the same commands on smaller input in `make test`, which checks
every option of these pages too."""
TYPED = [page for page in PAGES if run_here(page)]


def test_pages_have_commands_and_every_reason_belongs_to_a_block() -> None:
    assert len(TYPED) > 10
    assert sum(len(run_here(page)) for page in TYPED) > 50
    assert {block.needs for page in PAGES for block in needs_of(page)} == NOT_RUN.keys()
    assert {page.name for page in TYPED} >= BEFORE.keys()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_are_in_shell_blocks_and_name_existing_things(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert commands_outside_blocks(text) == []
    for block in blocks(text):
        for command in block.commands:
            check_names(command)
            assert block.needs or not NEEDS_MORE.search(command), f"{command}: put <!-- needs: ... --> before its block"
    for words in spans(text):
        understand(shlex.split(plain(words))[1:], strict=False)
    assert [script for script in scripts(text) if not (ROOT / script).is_file()] == []


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Environment shared by all pages: a disk cache, and a vsnbench process with its imports done."""
    directory = tmp_path_factory.mktemp("machine")
    with warm_vsnbench(directory / "bin") as warm:
        path = f"{warm}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        yield {"XDG_CACHE_HOME": str(directory / "cache"), "PATH": path}


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=page.name, marks=[pytest.mark.long] * (page.name in LONG_PAGES)) for page in TYPED],
)
def test_the_commands_of_a_page_succeed_in_order(page: Path, machine: dict[str, str], tmp_path: Path) -> None:
    shell = Shell(tmp_path, machine)
    if page.name in BEFORE:
        BEFORE[page.name](shell)
    for command in run_here(page):
        type_as_meant(shell, command)


README = (ROOT / "README.md").read_text(encoding="utf-8")
FEW = " --starts 1 --max-steps 6"
"""Shortens a run of README."""
OF_README = [
    re.split(r"\s{2,}|\s#", line)[0].strip() for line in re.findall(r"^ {4}(vsnbench .*)$", README, re.MULTILINE)
]
"""The `vsnbench` lines of the indented blocks, without comments."""


def test_readme_is_short_and_has_commands() -> None:
    assert len(README.splitlines()) <= 90
    assert len(OF_README) >= 5


@pytest.mark.timeout(900)
def test_the_commands_of_readme_succeed_in_order_with_the_policy_that_it_shows(
    machine: dict[str, str], tmp_path: Path
) -> None:
    (block,) = re.findall(r"\n(    from vsnbench import.*?)\n\n    vsnbench", README, re.DOTALL)
    (tmp_path / "spinner.py").write_text(re.sub(r"^ {4}", "", block, flags=re.MULTILINE) + "\n")
    shell = Shell(tmp_path, machine)
    for command in OF_README:
        if "--web" in command or command == "vsnbench browse":
            shell.types_and_visits(f"{command} --port 0", 0)
        else:
            assert shell.types(command + FEW if command.startswith("vsnbench run") else command).strip()


def type_as_meant(shell: Shell, command: str) -> None:
    """Type a command, and press Ctrl-C if it runs until then."""
    line = command if "\n" in command else plain(command)
    for program, stand_in in STAND_INS.items():
        line = line.replace(program, stand_in)
    for pattern, port, code in SERVED:
        if pattern.search(line):
            shell.types_and_visits(line + port, code)
            return
    if line.endswith("--watch"):
        shell.types_until(line, "waiting for a change", 130)
    elif LONG.search(line):
        shell.types_and_interrupts(line)
    else:
        shell.types(line, next((codes for start, codes in ENDS_WITH.items() if line.startswith(start)), (0,)))


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[RosNetwork]:
    with live_network(tmp_path) as network:
        yield network


@pytest.mark.ros
@pytest.mark.timeout(900)
@pytest.mark.long
def test_the_rehearsal_of_a_robot_on_ros_1_runs_in_its_terminals(ros: RosNetwork, tmp_path: Path) -> None:
    on_it = {name: ros.environment[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")}
    shell = Shell(tmp_path, on_it)
    with_needs = needs_of(ROOT / "docs" / "robot.md")
    (terminals,) = (block.commands for block in with_needs if block.needs == "ROS 1")
    master, simulate, mover, run = map(plain, terminals)
    assert master == "rosmaster --core", "the network's own, on a port of its own"
    with shell.running(simulate), shell.running(mover):
        ros.wait_for_publisher("/odom", TIME_LIMIT_S)  # compiles and renders with cold caches
        ros.wait_for_service("/discrete_move", TIME_LIMIT_S)
        shell.types("vsnbench robots show turtlebot2 > my-robot.yaml")
        for block in with_needs:
            for command in block.commands if block.needs == "a robot on ROS 1" else ():
                type_as_meant(shell, command)
        shell.types_and_interrupts(run)
