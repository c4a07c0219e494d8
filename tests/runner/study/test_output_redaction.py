import logging
import os
import sys

import numpy as np
import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.runner.study.output_redaction import OutputRedaction
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

LOOK = Observation(np.zeros((48, 64, 3), np.uint8), None, Pose(0, 0), 0.0, PROFILE.camera)


class Chatterbox(Policy):
    """Reveals its name in all its outputs."""

    card = ModelCard("chatterbox")

    def reset(self, goal: str, seed: int) -> None:
        self.speak(f"{goal} {seed}")

    def act(self, observation: Observation) -> Decision:
        self.speak("my third eye sees it")
        return Decision(Action.STOP)

    def close(self) -> None:
        self.speak("good night")

    def speak(self, words: str) -> None:
        print(words)
        print(words, file=sys.stderr)
        logging.getLogger("a.package.of.its.own").warning(words)
        for descriptor in (1, 2):
            os.write(descriptor, words.encode())


def test_output_of_a_model_is_discarded_and_other_output_is_kept(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    log = logging.StreamHandler(sys.stderr)
    logging.getLogger().addHandler(log)
    try:
        with OutputRedaction(["chatterbox"]) as unheard:
            print("the run begins")
            policy = unheard.policy(Chatterbox())
            policy.reset("bed", 7)
            logging.getLogger("vsnbench.robots").warning("the chatterbox's robot is slow")
            assert policy.act(LOOK).action is Action.STOP
            logging.getLogger("vsnbench.runner.episode.policy_calls").error("Traceback (most recent call last):")
            os.write(2, b"the robot's driver\n")
            policy.close()  # type: ignore[attr-defined]
            print("chatterbox-2 is no chatterboxes", file=sys.stderr)
        print("the run is over", file=sys.stderr)
        logging.getLogger("vsnbench.models").warning("chatterbox is a fine model")
    finally:
        logging.getLogger().removeHandler(log)
    out, err = capfd.readouterr()
    assert out.splitlines() == ["the run begins"]
    assert err.splitlines() == [
        "the [hidden]'s robot is slow",
        "the robot's driver",
        "[hidden]-2 is no chatterboxes",
        "the run is over",
        "chatterbox is a fine model",
    ]
    assert "third eye" not in caplog.text


def test_output_after_an_error_of_a_model_is_kept(capfd: pytest.CaptureFixture[str]) -> None:
    class Lost(Chatterbox):
        def reset(self, goal: str, seed: int) -> None:
            super().reset(goal, seed)
            raise ValueError(goal)

    with OutputRedaction([]) as unheard:
        policy = unheard.policy(Lost())
        with pytest.raises(ValueError, match="bed"):
            policy.reset("bed", 7)
        print("heard")
        os.write(1, b"also heard\n")
    assert capfd.readouterr().out.splitlines() == ["heard", "also heard"]


def test_a_kept_stream_writes_to_the_terminal_afterwards(capfd: pytest.CaptureFixture[str]) -> None:
    with OutputRedaction([]):
        kept = sys.stdout
        print("during")
    assert kept.isatty() == sys.stdout.isatty()
    kept.write("afterwards\n")
    kept.flush()
    assert capfd.readouterr().out.splitlines() == ["during", "afterwards"]
