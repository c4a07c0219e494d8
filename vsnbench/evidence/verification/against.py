"""Compares two records of the same trials, step by step.

Images are compared by their pixels: an encoder may write other bytes for the same pixels.
"""

from typing import Any, TypeAlias

from sqlalchemy import Row

from vsnbench.evidence.verification.checks import Check, Finding, Progress, cell
from vsnbench.evidence.verification.record import VerifiedRecord
from vsnbench.evidence.verification.replay import NOT_DRIVEN
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.results.writing.steps import step_row

_Trial: TypeAlias = tuple[str, str, int, int]
"""Key of the campaign, goal, start, repetition."""


def check_against(record: VerifiedRecord, other: VerifiedRecord, name: str, progress: Progress) -> Check:
    """Compare the first result of every trial that both records have.

    Args:
        record: the record that is verified.
        other: another record.
        name: path of the other one, for the findings.
        progress: called after each episode.
    """
    check = Check("against another record", "episodes")
    with check.failing("the records"):
        own, others = _results(record), _results(other)
        common = [trial for trial in own if trial in others]
        for alone, of in ((len(own) - len(common), "this record"), (len(others) - len(common), name)):
            if alone:
                check.skip(f"trials of {of} only", alone)
        if not common:
            check.fail(name, "has no trial of this record: site, robot, model, protocol, conditions or seed differ")
        for done, trial in enumerate(common, start=1):
            pair = own[trial], others[trial]
            with check.failing(f"episode {pair[0].id}"):
                difference = _first_difference(record, other, *pair, name)
                check.add([] if difference is None else [difference])
            progress("comparing episodes", done, len(common))
    return check


def _results(record: VerifiedRecord) -> dict[_Trial, Row[Any]]:
    """Return the first episode of each trial that ended with a result."""
    found: dict[_Trial, Row[Any]] = {}
    for episode in record.episodes():
        if episode.state in (EpisodeState.JUDGED, EpisodeState.AWAITING):
            key = record.condition(episode.campaign_id).row.key
            found.setdefault((key, episode.goal, episode.start, episode.repetition), episode)
    return found


def _first_difference(
    record: VerifiedRecord, other: VerifiedRecord, own: Row[Any], others: Row[Any], name: str
) -> Finding | None:
    steps, compared = record.steps(own.id), other.steps(others.id)
    for step, counterpart in zip(steps, compared, strict=False):
        was, now = step_row(0, step), step_row(0, counterpart)
        for column in was:
            unknown = column.endswith("_digest") and None in (was[column], now[column])
            if column not in NOT_DRIVEN and not unknown and was[column] != now[column]:
                text = f"{was[column]!r}, and {now[column]!r} in episode {others.id} of {name}"
                return cell("step", f"{own.id}/{step.number}", column, text)
    if len(steps) != len(compared):
        text = f"{len(steps)} steps, and {len(compared)} in episode {others.id} of {name}"
        return cell("episode", own.id, "actions", text)
    if own.end_reason != others.end_reason:
        text = f"{own.end_reason}, and {others.end_reason} in episode {others.id} of {name}"
        return cell("episode", own.id, "end_reason", text)
    return None
