"""A blinded study of two models on text goals: written, locked, run by an operator with a phone, and reported."""

import json
import random
from pathlib import Path

import pytest

from tests.web.blind_study import ARM_NAMES, BlindStudy
from tests.web.phone_operators import phone_operators
from tests.web.study_faults import study_faults

pytestmark = pytest.mark.browser

GOALS = """\
goals:
  - {id: red-chair, kind: text, text: the red chair, targets: [chair]}
  - {id: doormat, kind: text, text: the mat at the door, targets: [{point: [2.5, 0.4]}]}
"""
READS_TEXT = """
    def reset(self, goal, seed):
        self.left = self.turns
        with open("received.txt", "a") as file:
            print(goal.id, goal.kind, goal, sep="|", file=file)
"""


class TextGoalStudy(BlindStudy):
    """A study of two models that read text, from `vsnbench study new`."""

    def __init__(self, directory: Path, seed: int) -> None:
        super().__init__(directory, 4, seed, in_one_room=True)
        models, room = directory / "aviary.py", directory / "room.yaml"
        text = models.read_text().replace('_sha256="heron0" * 10', '_sha256="heron0" * 10, goal_kinds=TEXT')
        text = text.replace('_sha256="magpie" * 10', '_sha256="magpie" * 10, goal_kinds=TEXT')
        text = text.replace(
            "class Heron", "from vsnbench import GoalKind\nTEXT = frozenset({GoalKind.TEXT})\n\nclass Heron"
        )
        start, end = text.index("    def reset"), text.index("    def act")
        models.write_text(text[:start] + READS_TEXT.lstrip("\n") + text[end:])
        room.write_text(room.read_text() + GOALS)
        (directory / "study.yaml").unlink()
        arms = [word for name in ("Heron", "Magpie") for word in ("--arm", f"{name.lower()}=aviary:{name}")]
        where = ["--site", "room.yaml", "--robot", "simulated:quick.yaml@64x48", "--rehearse", "--seed", str(seed)]
        self.study("new", *arms, "--goal", "red-chair,doormat", *where)


def test_text_goals_are_studied_blind(tmp_path: Path) -> None:
    with TextGoalStudy(tmp_path, 3) as study:
        study.study("lock", "--force")
        with phone_operators(study, random.Random(2), [], names=["Anna"]) as operators:
            operators.run_session()
            assert study_faults(operators) == []
        assert study.code == 0
        received = sorted(set((tmp_path / "received.txt").read_text().splitlines()))
        assert received == [
            "doormat|text|the mat at the door",
            "red-chair|text|the red chair",
        ]
        assert sorted(study.rows("SELECT goal, count(*) FROM trial GROUP BY goal")) == [
            ("doormat", 2),
            ("red-chair", 2),
        ]
        report = study.study("report")
        assert not ARM_NAMES.search(report.encode())
        assert all(f"{goal} (text)" in report for goal in ("red-chair", "doormat"))
        study.study("unblind", "--reason", "the study is complete")
        data = json.loads(study.study("report", "--format", "json"))
        assert {(trial["arm"], trial["goal"]) for trial in data["trials"]} == {
            (arm, goal) for arm in ("heron", "magpie") for goal in ("red-chair", "doormat")
        }
