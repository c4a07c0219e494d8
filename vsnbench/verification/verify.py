"""Verifies a results directory: all checks in order. Nothing is written there, and nothing in it is executed."""

from contextlib import ExitStack
from pathlib import Path

from vsnbench import __version__
from vsnbench.errors import RecordError
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.verification.checks import Check, Progress, Verification
from vsnbench.verification.files import check_files
from vsnbench.verification.judgements import check_judgements
from vsnbench.verification.record import open_copy
from vsnbench.verification.replay import check_replay
from vsnbench.verification.studies import check_studies
from vsnbench.verification.values import check_values


def verify(path: Path, progress: Progress, *, replay: int | None = 0) -> Verification:
    """Verify a results directory.

    Args:
        path: the directory.
        progress: called with the kind of work, the amount done and the total.
        replay: number of simulated episodes to drive again; None for all.

    Raises:
        RecordError: it is not a results directory, or its database cannot be read.
    """
    if not path.exists():
        raise RecordError(f"{path} does not exist")
    with ExitStack() as stack:
        scratch = ScratchDirectory("verify")
        stack.callback(scratch.remove)
        record = stack.enter_context(open_copy(path, scratch.path))
        checks: list[Check] = [check_values(record, progress), check_files(record, progress)]
        judgements, people = check_judgements(record, progress)
        checks += [judgements, check_studies(record, progress)]
        if replay != 0:
            checks.append(check_replay(record, replay, progress))
        return Verification(str(path), __version__, record.versions, tuple(checks), people)
