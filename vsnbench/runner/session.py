"""Runs a session: connects its record, its robots, its operator, requests to stop and the trial loop."""

from collections.abc import Callable

from vsnbench.runner.loop.contract import Session, SessionResult, TrialSource
from vsnbench.runner.loop.run import run
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.cleanup import sweep_results


def run_session(
    session: Session, operators: OperatorProvider, source_of: Callable[[Session], TrialSource]
) -> SessionResult:
    """Run trials with the operator of a session until none is left or the session ends early.

    Args:
        session: the session, with an open journal and robots that are ready.
        operators: provides its operator.
        source_of: returns the source of the session's trials, once the operator is there.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        VsnbenchError: no trial can be run or recorded.
    """
    journal, recording = session.journal, session.recording
    if recording.viewer is not None:
        recording.viewer.prepare()
    sweep_results(recording.results, journal)
    with session.stop_requests as stop_requests:
        stop_requests.last_acts.append(session.robots.halt)
        journal.patience.gives_up = lambda: stop_requests.session_ends
        with operators.attend(session) as session.operator:
            source = source_of(session)
            return source.result(run(source, session))
