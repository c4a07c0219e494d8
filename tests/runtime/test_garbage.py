import gc
from unittest.mock import MagicMock

from vsnbench.runner.executors.in_process import InProcessExecutor
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.loop.run import run
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runtime.garbage import collect_as_usual, collect_rarely


def test_garbage_is_collected_as_usual_once_trials_run() -> None:
    collect_as_usual()
    usual = gc.get_threshold()
    try:
        gc.set_threshold(700, 10, 10)
        collect_rarely()
        assert gc.get_threshold()[0] == 10_000
        source = MagicMock(spec=CampaignSource, **{"next_trial.return_value": None, "restock.return_value": False})
        robots = MagicMock(spec=InProcessExecutor, free=True, busy=False)
        assert run(source, MagicMock(spec=Session, robots=robots, operator=AbsentOperator())) == ""
        assert gc.get_threshold() == (700, 10, 10)
    finally:
        gc.set_threshold(*usual)
