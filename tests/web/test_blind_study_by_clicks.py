"""A blind study on a phone that is reloaded and loses its network.

`scripts/console_trials.py` does the same with 75 trials, two phones, kills, and every disturbance at every screen.
"""

import random
from pathlib import Path

import pytest

from tests.web.blind_study import BlindStudy
from tests.web.phone_operators import Disturbance, phone_operators
from tests.web.study_faults import study_faults

pytestmark = pytest.mark.browser


@pytest.mark.timeout(900)
def test_disturbances_lose_no_trials_and_reveal_no_arm(tmp_path: Path) -> None:
    disturbances: list[tuple[str, Disturbance]] = [
        *(("sign-in", "reload"), ("placing", "reload"), ("judging", "offline"), ("confirming", "reload")),
        ("finish", "reload"),
    ]
    with BlindStudy(tmp_path, 2, 3, in_one_room=True) as study:
        study.study("lock", "--force")
        with phone_operators(study, random.Random(1), disturbances, names=["Anna"]) as operators:
            operators.spread = False
            operators.run_session()
            assert study_faults(operators) == []
        assert study.code == 0
        assert disturbances == [], "all of them happened"
