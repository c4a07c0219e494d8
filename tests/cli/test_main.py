"""The console script: fast start, all verbs, errors in one line."""

import errno
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.console import Typed
from vsnbench import __version__
from vsnbench.cli import main as console_script
from vsnbench.errors import RobotError, UsageError

HEAVY = ("torch", "rerun", "mujoco", "matplotlib", "numba", "numpy", "pandas", "sqlalchemy", "pydantic", "scipy")


def test_help_imports_nothing_heavy_and_the_end_walks_through_nothing() -> None:
    code = (
        "import atexit, gc, sys; sys.argv = ['vsnbench', '--help']\n"
        "atexit.register(lambda: sys.stderr.write(f' frozen={gc.get_freeze_count() > 0}'))\n"
        "from vsnbench.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "sys.stderr.write(' '.join(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "vsnbench run --model pirlnav --goal chair" in run.stdout
    assert set(HEAVY) & set(run.stderr.split()) == set()
    assert run.stderr.endswith("frozen=True")


def test_ctrl_c_while_the_command_line_is_loaded_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    ended = subprocess.run(
        [sys.executable, "-m", "vsnbench", "--help"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])},
    )
    assert (ended.returncode, ended.stderr) == (130, "\nvsnbench: stopped before the command started\n")


@pytest.mark.parametrize("verb", console_script.VERBS)
def test_every_verb_exists_and_teaches_itself(typed: Typed, verb: str) -> None:
    module = importlib.import_module(console_script.VERBS[verb][0])
    assert hasattr(module, "app") or hasattr(module, "command")
    answer = typed(verb, "--help")
    assert answer.code == 0
    assert f"vsnbench {verb}" in answer.out


def test_a_command_group_alone_shows_its_help(typed: Typed) -> None:
    answer = typed("episodes")
    assert answer.code == 2
    assert "Usage: vsnbench episodes" in answer.out + answer.err
    assert "error" not in answer.err


@pytest.mark.parametrize("words", [(), ("run",), ("episodes", "list"), ("robots", "check")])
def test_help_shows_flags_without_a_type(typed: Typed, words: tuple[str, ...]) -> None:
    answer = typed(*words, "--help")
    assert answer.code == 0
    assert "--help" in answer.out
    assert "bool" not in answer.out


def test_an_option_that_takes_several_values_may_be_repeated(typed: Typed) -> None:
    answer = typed("report", "--only-reference", "--model", "vlv", "--model", "pirlnav")
    assert answer.code == 0, answer.err


@pytest.mark.parametrize(("error", "code"), [(UsageError("no such thing"), 2), (RobotError("wedged"), 1)])
def test_a_known_error_is_one_line_and_its_exit_code(
    typed: Typed, error: Exception, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(verb: str | None) -> None:
        raise error

    monkeypatch.setattr(console_script, "build_app", fail)
    answer = typed("run")
    assert answer.code == code
    assert answer.err == f"vsnbench: error: {error}\n"


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        ImportError("cv2.abi3.so: failed to map segment from shared object"),
        RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 3151872 bytes"),
    ],
    ids=repr,
)
def test_want_of_memory_is_one_line(typed: Typed, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(verb: str | None) -> None:
        raise error

    monkeypatch.setattr(console_script, "build_app", fail)
    answer = typed("run")
    assert answer.code == 1
    assert answer.err.count("\n") == 1
    assert "not enough memory" in answer.err


def test_an_unexpected_error_keeps_its_traceback(typed: Typed, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(verb: str | None) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(console_script, "build_app", fail)
    monkeypatch.setattr("vsnbench.results.schema.engine._opened", {})  # other tests' records, broken ones among them
    with pytest.raises(ZeroDivisionError):
        typed("run")


def test_the_version_is_told(typed: Typed) -> None:
    assert typed("--version").out == f"vsnbench {__version__}\n"


MINE = """
from vsnbench.models.contract import ModelCard, Policy
class Mine(Policy):
    card = ModelCard("mine")
    def reset(self, goal, seed): ...
    def act(self, observation): ...
"""


@pytest.mark.parametrize(
    ("words", "looked_into"),
    [
        (("models", "list"), False),
        (("models", "show", "random"), False),
        (("robots", "list"), False),
        (("models", "show", "mine:Mine"), True),
    ],
)
def test_the_working_directory_is_searched_last_and_only_for_a_named_class(
    words: tuple[str, ...], looked_into: bool, tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "numpy.py").write_text("raise SystemExit('the archive ran')")
    code = (
        f"import sys; sys.argv = ['vsnbench', *{words!r}]\n"
        "from vsnbench.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "sys.stderr.write('\\n'.join(sys.path))"
    )
    run = subprocess.run([sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    path = run.stderr.splitlines()
    assert (str(tmp_path) in path) is looked_into
    assert str(tmp_path) not in path[:-1]
