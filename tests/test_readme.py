"""Runs every command of README, in order, in one directory."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
FEW = " --starts 1 --max-steps 6"
"""Shortens a run."""


def commands(text: str) -> list[str]:
    """Return the `vsnbench` lines of a page's indented blocks, without comments."""
    lines = re.findall(r"^ {4}(vsnbench .*)$", text, re.MULTILINE)
    return [re.split(r"\s{2,}|\s#", line)[0].strip() for line in lines]


COMMANDS = commands(README)


def test_readme_is_short_and_has_commands() -> None:
    assert len(README.splitlines()) <= 90
    assert len(COMMANDS) >= 5


class Lab:
    """A directory with the policy that README shows."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        (directory / "mylab").mkdir()
        (block,) = re.findall(r"\n(    from vsnbench import.*?)\n\n    vsnbench", README, re.DOTALL)
        (directory / "mylab" / "spinner.py").write_text(re.sub(r"^ {4}", "", block, flags=re.MULTILINE) + "\n")
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        kept = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        self.environment = kept | {"PATH": path}

    def start(self, command: str) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            ["/bin/bash", "-c", f"exec {command}"],
            cwd=self.directory,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("lab"))


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_readme_succeeds(lab: Lab, command: str) -> None:
    if "--web" in command:
        serve_until_ctrl_c(lab, f"{command} --port 0")
        return
    with lab.start(command + FEW if command.startswith("vsnbench run") else command) as process:
        printed, _ = process.communicate(timeout=280)
    assert process.returncode == 0, printed
    assert printed.strip()
    assert "Traceback" not in printed


def serve_until_ctrl_c(lab: Lab, command: str) -> None:
    with lab.start(command) as server:
        assert server.stdout is not None
        assert any(line.startswith("http://127.0.0.1:") for line in server.stdout)
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 0
