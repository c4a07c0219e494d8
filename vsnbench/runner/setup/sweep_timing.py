"""Times one trial of each model without recorded trials, for the estimate of a long sweep."""

import logging
from collections.abc import Iterator
from dataclasses import replace

from vsnbench.errors import VsnbenchError
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.throughput import Throughput, throughput_of
from vsnbench.results.schema.engine import open_engine
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.selection import present_goals
from vsnbench.runner.setup.sweep import Sweep

logger = logging.getLogger(__name__)


def untimed_models(sweep: Sweep, throughput: Throughput) -> list[str]:
    """Return the models of a sweep without recorded episodes."""
    models = dict.fromkeys(request.setup.model for request in sweep)
    return [model for model in models if model not in throughput.seconds]


def time_models(sweep: Sweep, throughput: Throughput, operators: OperatorProvider) -> Throughput:
    """Run one trial of each model without recorded episodes, in a temporary directory.

    Returns:
        The times with those of the timed models. A model whose trial cannot run is left out; its campaign reports why.

    Raises:
        Stopped: a person or the system requested to stop.
    """
    seconds = dict(throughput.seconds)
    for model in untimed_models(sweep, throughput):
        request = next(request for request in sweep if request.setup.model == model)
        with ScratchDirectory("timing") as scratch:
            results = ResultsDirectory.locate(scratch.path / "results", environment={})
            for trial in _single_trials(request, results):
                try:
                    launch(trial, operators)
                except VsnbenchError as error:  # the model may not know this goal
                    logger.debug("%s was not timed: %s", model, error)
                    continue
                if timed := list(_seconds(results).values()):  # a single model, under the name on its card
                    seconds[model] = timed[0]
                break
    return replace(throughput, seconds=seconds)


def _single_trials(request: RunRequest, results: ResultsDirectory) -> Iterator[RunRequest]:
    """Yield requests for one trial each: every goal that the site has, from its first starting position."""
    site = request.setup.site  # of several generated sites, one of them, which may lack a goal
    goals, _ = present_goals(request.setup.goals, site)
    for goal in sorted(site.categories) if "all" in goals else goals:
        open_starts = [start for start in request.start_numbers if (goal, start) not in site.excluded]
        if open_starts:
            yield replace(
                request,
                setup=replace(request.setup, goals=(goal,)),
                starts=(open_starts[0],),
                repetitions=1,
                results=results,
                workers=WorkerOptions(1),
            )


def _seconds(results: ResultsDirectory) -> dict[str, tuple[float, int]]:
    engine = open_engine(results.database_url, read_only=True)
    try:
        return dict(throughput_of(engine).seconds)
    finally:
        engine.dispose()
