"""Every command line of README is run, in its order, in one directory."""

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import understand
from tests.models.pirlnav.checkpoints import write_checkpoint
from tests.models.remote.servers import STUB, await_port, free_port
from tests.ros1.network import RosNetwork, live_network
from tests.test_docs import example

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
FEW = " --starts 1 --max-steps 6"
"""Enough of a run to see that it is one."""


def commands(text: str) -> list[str]:
    """Return the `vsnbench` lines of a page's blocks, without their comments."""
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    blocks += re.findall(r"^ {4}vsnbench .*$", text, re.MULTILINE)
    lines = re.findall(r"^ *(?:\$ )?(vsnbench .*)$", "\n".join(blocks), re.MULTILINE)
    return [re.split(r"\s{2,}|\s#", line)[0].strip() for line in lines]


def cheaper(command: str) -> str:
    """Return what is run in place of a line: the same, on few trials, and of the episodes that there are."""
    command = re.sub(r"\b17\b", "1", command).replace("~/envs/old/bin/python", sys.executable)
    if command.startswith("vsnbench run"):
        command += FEW
    if command.startswith("vsnbench view") and "--web" not in command:
        command += " --path"  # the window needs a display
    if command.startswith("vsnbench run") and "--robot" in command:
        command += " --unattended"
    return command


def served_model() -> str:
    """Return the model that README serves from another machine."""
    found = re.findall(r"\n(    from vsnbench_policy import.*?serve\(Spinner.*?)\n\n", README, re.DOTALL)
    (example,) = (re.sub(r"^ {4}", "", each, flags=re.MULTILINE) for each in found)
    return f"{example}\n"


class Lab:
    """A directory with what README speaks of: a policy, a site, a checkpoint; and where a robot can be reached."""

    def __init__(self, directory: Path, ros: RosNetwork | None = None) -> None:
        self.directory = directory
        self.ros = ros
        (directory / "mylab").mkdir()
        (spinner,) = re.findall(r"\n(    from vsnbench\.models\.contract.*?)\n\n    vsnbench", README, re.DOTALL)
        (directory / "mylab" / "spinner.py").write_text(re.sub(r"^ {4}", "", spinner, flags=re.MULTILINE) + "\n")
        (directory / "mymodel.py").write_text(served_model())
        (directory / "lab.yaml").write_text(example(), encoding="utf-8")
        write_checkpoint(directory / "objectnav_rl_ft_hd.ckpt")

    @property
    def environment(self) -> dict[str, str]:
        base = self.ros.environment if self.ros else dict(os.environ)
        kept = {name: value for name, value in base.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        return kept | {"PATH": path, "XDG_CACHE_HOME": str(self.directory / "cache")}

    def run(self, command: str, results: str = "results") -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            ["/bin/bash", "-c", command],
            cwd=self.directory,
            env=self.environment | {"VSNBENCH_RESULTS": results},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=280,
        )


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("lab"))


ALL = commands(README)
ON_A_ROBOT = [line for line in ALL if "turtlebot2" in line]
INLINE = re.findall(r"`(vsnbench [^`\n]+)`", README)
"""Named within a sentence: understood, not run."""
SERVING = [line for line in ON_A_ROBOT if " discrete-move" in line]
"""They serve until they are ended."""
HERE = [line for line in ALL if line not in ON_A_ROBOT]


def test_readme_has_command_lines() -> None:
    assert len(HERE) > 12
    assert len(ON_A_ROBOT) >= 3
    assert len(SERVING) == 1, "without it the robot moves for nobody"
    assert len(INLINE) > 4


@pytest.mark.slow
@pytest.mark.parametrize("line", HERE)
def test_a_line_of_readme_does_what_it_says(lab: Lab, line: str) -> None:
    if "--web" in line:
        served_until_ctrl_c(lab, f"{cheaper(line)} --port 0")
        return
    if "ws://gpu-box:8765" in line:
        gpu_box, port = lab.directory / "gpu-box", free_port()
        gpu_box.mkdir()
        (gpu_box / STUB.name).write_bytes(STUB.read_bytes())
        (gpu_box / "mymodel.py").write_text(served_model().replace("8765", str(port)))
        with subprocess.Popen([sys.executable, "mymodel.py"], cwd=gpu_box, stderr=subprocess.DEVNULL) as server:
            await_port(port)
            done = lab.run(cheaper(line).replace("ws://gpu-box:8765", f"ws://127.0.0.1:{port}"))
            server.terminate()
        assert done.returncode == 0, done.stdout + done.stderr
        return
    # The published models are not compared under the demonstration weights of the beginning.
    results = "published" if README.index(line) > README.index("## The paper's models") else "results"
    done = lab.run(cheaper(line), results)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (done.stdout + done.stderr).strip()
    assert "Traceback" not in done.stderr


def served_until_ctrl_c(lab: Lab, command: str) -> None:
    with subprocess.Popen(
        ["/bin/bash", "-c", f"exec {command}"],
        cwd=lab.directory,
        env=lab.environment,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdout is not None
        assert server.stdout.readline().startswith("http://127.0.0.1:")
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 0


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A lab with a simulated Turtlebot 2 behind a real ROS master."""
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        network.start("-m", "vsnbench.cli.main", "ros1", "simulate", "--robot", "turtlebot2", "--site", "apartment")
        network.wait_for_publisher("/odom")
        yield Lab(tmp_path_factory.mktemp("robot-lab"), network)


@pytest.mark.ros
@pytest.mark.slow
def test_the_lines_for_a_real_robot_do_too(robot: Lab) -> None:
    assert robot.ros is not None
    for line in SERVING:
        robot.ros.start("-m", "vsnbench.cli.main", *shlex.split(line)[1:])
    robot.ros.wait_for_service("/discrete_move")
    for line in (line for line in ON_A_ROBOT if line not in SERVING):
        done = robot.run(cheaper(line))
        assert done.returncode == 0, f"{line}: {done.stdout}{done.stderr}"


@pytest.mark.parametrize("line", INLINE)
def test_a_command_within_a_sentence_is_understood(line: str) -> None:
    understand(shlex.split(line)[1:])
