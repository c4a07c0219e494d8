"""Files and records that a page's commands need before the first one."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from tests.docs.pages import ROOT
from tests.docs.reading import Shell
from tests.interop.test_merge import draw, lab
from tests.models.pirlnav.checkpoints import write_checkpoint
from tests.models.vlv.conftest import released_tensors, write_value_network
from tests.report.records import Attempt, Lab
from tests.results.locked_study import lock_drawn, run_ranks
from tests.results.records_of_a_lab import plan
from vsnbench.protocol.judge import EndReason
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal


def _code(page: str, language: str) -> str:
    """Return the first block of a page in a language."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)[0]


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _locked_study(shell: Shell) -> None:
    shell.types("vsnbench study new --arm oracle --arm random --goal chair --seed 7")
    shell.types("vsnbench study lock")


def _spinner(shell: Shell) -> None:
    _write(shell.directory / "examples" / "spinner.py", _code("models.md", "python"))


def _released_pirlnav(shell: Shell) -> None:
    write_checkpoint(shell.directory / "objectnav_rl_ft_hd.ckpt")


def _two_models(shell: Shell) -> None:
    """An episode with images, a record of two models, and results of other tools."""
    shell.types("vsnbench run --model random --goal chair --starts 1")
    lab = Lab(shell.directory / "results")
    for model, successes in (("vlv", 9), ("pirlnav", 6)):
        lab.write([Attempt(start=number, success=number <= successes) for number in range(1, 16)], model=model)
    _write(shell.directory / "log" / "datos.csv", "1700000000.5,chair,['Forward', 'Left', 'Stop'],3\n")
    episode = {"object_category": "bed", "success": 1, "num_steps": 71}
    _write(shell.directory / "episodes.json", json.dumps([episode]))


def _pairs(shell: Shell) -> None:
    """Successes of one model (1 to 3), and failures of another on the same trials (4 to 6), with images."""
    for words in ("oracle", "random --max-steps 3"):
        shell.types(f"vsnbench run --model {words} --goal chair --starts 4-6")


def _awaiting(shell: Shell) -> None:
    """Records of several days; episodes of one of them await a judgement."""
    collided = Attempt(goal="bed", success=False, end_reason=EndReason.COLLISION, distance_m=2.0)
    days = {"results": "vlv", "lab-b/results": "pirlnav", "monday": "random", "tuesday": "forward"}
    for place, model in days.items():
        (shell.directory / place).mkdir(parents=True)
        for number in Lab(shell.directory / place).write([Attempt(start=each) for each in range(1, 16)], model=model):
            _write(shell.directory / place / f"episodes/{number:06}/trajectory.tum", "")
    first = Lab(shell.directory / "results")
    first.write([collided], model="oracle")
    first.write([Attempt(goal="sofa", proposed=True)], model="vlv", simulated=False)


def _robot_of_the_examples(shell: Shell) -> None:
    shutil.copytree(ROOT / "examples", shell.directory / "examples", ignore=shutil.ignore_patterns("__pycache__"))


def _surveyed(shell: Shell) -> None:
    """The example of the site file as lab.yaml, and a ROS map of it."""
    _write(shell.directory / "lab.yaml", _code("site-file.md", "yaml"))
    shell.types("vsnbench sites export lab.yaml --map map.yaml")


def _released_vlv(shell: Shell) -> None:
    write_value_network(shell.directory / "vlv_model.torch", released_tensors())


def _finished_study(shell: Shell) -> None:
    """A record with a campaign, and a study that is over; an SSH key."""
    results = lab(shell.directory / "results", plan(seed=99))
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        study = lock_drawn(journal)
        run_ranks(journal, study, range(16))
        journal.unblind_study(study.id, "all trials are done")
    draw(results)
    shell.types('ssh-keygen -q -t ed25519 -N "" -f lab_key')


BEFORE: dict[str, Callable[[Shell], None]] = {
    "bundle.md": _finished_study,
    "console.md": _locked_study,
    "export.md": _two_models,
    "lab-robots.md": _robot_of_the_examples,
    "look.md": _pairs,
    "models.md": _spinner,
    "pirlnav.md": _released_pirlnav,
    "report.md": _two_models,
    "results.md": _awaiting,
    "robots.md": _robot_of_the_examples,
    "sites.md": _surveyed,
    "vlv.md": _released_vlv,
}
"""Page -> function that prepares its directory; other pages start in an empty one."""
