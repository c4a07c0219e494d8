"""The trial loop. Campaigns, sweeps and studies run through it, in this process and in workers."""

from vsnbench.runner.loop.contract import (
    EpisodeFinished,
    LoopEvent,
    TrialExecutor,
    TrialLost,
    TrialSkipped,
    TrialSource,
)
from vsnbench.runner.operator.contract import Operator, SessionEndedError
from vsnbench.runner.stopping.requests import Stopped
from vsnbench.runtime.garbage import collect_as_usual


def run(source: TrialSource, executor: TrialExecutor, operator: Operator) -> str:
    """Run trials until the source has none left or the session ends early.

    A reason to stop lets the trials that other workers are running finish.

    Returns:
        The reason for an early end, or an empty string.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        VsnbenchError: no trial can be run or recorded.
    """
    collect_as_usual()  # all modules are loaded
    reason: str | None = None
    try:
        while True:
            if reason is None:
                _begin_trials(source, executor)
            # Workers that replace lost ones are neither busy nor free until they are ready.
            if executor.busy or (reason is None and not executor.free):
                for event in executor.events():
                    stop_reason = _follow(event, source, executor, operator)
                    reason = reason or stop_reason
            elif reason is not None or not source.restock(operator):
                return reason or ""
    except SessionEndedError as ended:
        return str(ended)
    except Stopped as stopped:
        executor.stop(stopped.request)
        raise


def _begin_trials(source: TrialSource, executor: TrialExecutor) -> None:
    while executor.free and (trial := source.next_trial()) is not None:
        if not executor.begin(trial):
            source.mark_unavailable(trial)


def _follow(event: LoopEvent, source: TrialSource, executor: TrialExecutor, operator: Operator) -> str | None:
    """Apply what follows an event. Returns the reason to stop, or None to continue."""
    match event:
        case TrialSkipped(trial):
            source.postpone(trial)
            return None
        case TrialLost(trial, cause):
            if trial is not None:
                source.postpone(trial)
            return source.rules.after_lost_worker(cause)
        case EpisodeFinished(trial, outcome):
            follow_up = source.rules.after_episode(outcome, trial.model, executor.busy)
            if follow_up.reloads_model:
                executor.reload_model(trial.model)
            source.add_outcome(event, follow_up)
            source.repeat([*([trial.trial_id] if follow_up.repeats else []), *operator.trials_to_repeat()])
            return follow_up.stop_reason
