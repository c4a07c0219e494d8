"""How long a check-up waits for the messages of a sensor."""

from types import SimpleNamespace
from typing import Any

import pytest

from vsnbench.robots.checkup import base
from vsnbench.sensing.topic_monitor import TopicMessages


@pytest.mark.parametrize(("every_s", "published", "received"), [(1.0, True, 2), (9.0, True, 0), (1.0, False, 0)])
def test_a_slow_sensor_is_heard_twice_and_a_silent_one_is_given_up(
    monkeypatch: pytest.MonkeyPatch, every_s: float, published: bool, received: int
) -> None:
    camera, now_s = TopicMessages(), 0.0

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds
        if now_s >= every_s * (len(camera.arrivals) + 1):
            camera.arrivals.append(now_s)

    monkeypatch.setattr(base, "time", SimpleNamespace(monotonic=lambda: now_s, sleep=sleep))
    check_up: Any = SimpleNamespace(
        names=SimpleNamespace(tf=None), _rates={"/camera": 1.0}, _publishers=lambda _: ["/driver"] if published else []
    )
    listener: Any = SimpleNamespace(listen=lambda _: {"/camera": camera, "/bumper": TopicMessages()})
    base.RosCheckup.listen(check_up, listener)
    assert len(camera.arrivals) == received
    assert now_s < 4
