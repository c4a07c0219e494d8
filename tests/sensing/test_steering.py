"""A held base gets a stream of zero velocities while another publisher drives it."""

import time

from tests.processes import wait_until
from vsnbench.sensing.steering import ZeroHold


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
