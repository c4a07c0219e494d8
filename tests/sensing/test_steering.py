"""A held base gets a stream of zero velocities while another publisher drives it."""

import time

from tests.processes import wait_until
from vsnbench.control.command import Command
from vsnbench.sensing.steering import SentCommands, ZeroHold


def test_a_held_base_gets_a_stream_and_not_an_answer_alone() -> None:
    sent_s: list[float] = []
    hold = ZeroHold(lambda: sent_s.append(time.monotonic()))
    hold.hold()
    wait_until(lambda: len(sent_s) > 20, "zero velocities are streamed")
    hold.release()
    wait_until(lambda: hold._thread is None, "the stream ends")
    sent = len(sent_s)
    hold.answer()
    assert len(sent_s) == sent


def test_the_stream_ends_and_begins_again_with_the_rival() -> None:
    sent_s: list[float] = []
    hold = ZeroHold(lambda: sent_s.append(time.monotonic()))
    hold.hold()
    wait_until(lambda: hold._thread is None, "the stream ends after a second")
    assert hold.holding
    sent = len(sent_s)
    hold.answer()
    wait_until(lambda: len(sent_s) > sent + 20, "it is streamed again")
    hold.release()


def test_a_process_recognizes_its_own_velocities() -> None:
    sent = SentCommands()
    sent.add(Command(0.1, 0.0))
    assert Command(0.1, 0.0) in sent
    assert Command(0.2, 0.0) not in sent
