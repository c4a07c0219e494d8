"""The trial loop. Campaigns, sweeps and studies run through it, in this process and in workers."""

from vsnbench.runner.loop.contract import (
    ActionsTaken,
    EpisodeEnded,
    LoopEvent,
    Session,
    TrialReturned,
    TrialSource,
)
from vsnbench.runner.operator.contract import SessionEndedError
from vsnbench.runner.stopping.requests import Stopped
from vsnbench.runtime.garbage import collect_as_usual


def run(source: TrialSource, session: Session) -> str:
    """Run trials until the source has none left or the session ends early.

    A reason to stop lets the trials that other workers are running finish.

    Returns:
        The reason for an early end, or an empty string.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        VsnbenchError: no trial can be run or recorded.
    """
    collect_as_usual()  # all modules are loaded
    executor = session.robots
    executor.session_begins(session)
    reason: str | None = None
    try:
        while True:
            while reason is None and executor.free and (trial := source.next_trial()) is not None:
                if not executor.begin(trial):
                    source.mark_unavailable(trial)
            # Workers that replace lost ones are neither busy nor free until they are ready.
            if executor.busy or (reason is None and not executor.free):
                for event in executor.events():
                    stop_reason = _follow(event, source, session)
                    reason = reason or stop_reason
            elif reason is not None or not source.restock(session.operator):
                return reason or ""
    except SessionEndedError as ended:
        return str(ended)
    except Stopped as stopped:
        executor.stop(stopped.request)
        raise


def _follow(event: LoopEvent, source: TrialSource, session: Session) -> str | None:
    """Apply what follows an event. Returns the reason to stop, or None to continue."""
    match event:
        case ActionsTaken():
            return None
        case TrialReturned(trial, lost_worker):
            if trial is not None:
                source.postpone(trial)
            return source.rules.after_lost_worker(lost_worker) if lost_worker else None
        case EpisodeEnded(claim, outcome):
            trial, executor = claim.trial, session.robots
            follow_up = source.rules.after_episode(outcome, trial.campaign_id, executor.busy)
            if follow_up.reloads_model:
                executor.reload_model(trial)
            source.add_outcome(event, follow_up)
            source.repeat([*([trial.id] if follow_up.repeats else []), *session.operator.trials_to_repeat()])
            return follow_up.stop_reason
