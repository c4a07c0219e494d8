import gc
from types import SimpleNamespace
from typing import Any

from vsnbench.runner.loop.run import run
from vsnbench.runtime.garbage import collect_as_usual, collect_rarely


def test_garbage_is_collected_as_usual_once_trials_run() -> None:
    collect_as_usual()
    usual = gc.get_threshold()
    try:
        gc.set_threshold(700, 10, 10)
        collect_rarely()
        assert gc.get_threshold()[0] == 10_000
        nothing: Any = SimpleNamespace(
            free=True,
            busy=False,
            next_trial=lambda: None,
            restock=lambda _: False,
            session_begins=lambda _: None,
            operator=None,
        )
        assert run(nothing, nothing) == ""
        assert gc.get_threshold() == (700, 10, 10)
    finally:
        gc.set_threshold(*usual)
