"""Decides what a bundle contains, and refuses what must not be handed over."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, select

from vsnbench.errors import UsageError
from vsnbench.results.schema.study_tables import Study, StudyArm
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, TrialRow
from vsnbench.results.studies.entries import OVER
from vsnbench.results.studies.queries import read_study, session_of_another, study_progress
from vsnbench.results.writing.lifecycle import ACTIVE
from vsnbench.text.sanitize import sanitize

_NO_PROCESS = 0


@dataclass(frozen=True, slots=True)
class BundleSelection:
    """Campaigns of a bundle, and their study if they are its arms."""

    campaigns: tuple[int, ...]
    study: int | None = None


def select_study(connection: Connection, number: int) -> BundleSelection:
    """Return the arms of a study.

    Raises:
        UsageError: the study does not exist, is blind, or is not over.
    """
    if connection.scalar(select(Study.id).where(Study.id == number)) is None:
        known = ", ".join(map(str, connection.scalars(select(Study.id).order_by(Study.id)))) or "none"
        raise UsageError(f"study {number} does not exist", advice=f"the record has: {known}", code="unknown-study")
    study = read_study(connection, number)
    title = repr(sanitize(study.title))
    if study.is_blind:
        raise UsageError(
            f"the study {title} is blind",
            advice='unblind it first with `vsnbench study unblind --reason "WHY"`',
            code="blind-study",
        )
    if who := session_of_another(connection, number, _NO_PROCESS):
        raise UsageError(f"the study {title} is run by {who}", advice="wait for its end", code="running-study")
    left = sum(trial.left for trial in study_progress(connection, number))
    is_over = study.unblinded_at is not None or any(entry.kind == OVER for entry in study.entries)
    if left and not is_over:
        raise UsageError(
            f"the study {title} is not over: {left} of its trials are left",
            advice="finish it with `vsnbench study run`",
            code="running-study",
        )
    selected = BundleSelection(tuple(sorted(arm.campaign_id for arm in study.arms)), number)
    _check_episodes(connection, selected.campaigns)
    return selected


def select_campaigns(connection: Connection, numbers: Sequence[int]) -> BundleSelection:
    """Return campaigns by number.

    Raises:
        UsageError: a campaign does not exist, runs, is an arm of a study, or has no episodes.
    """
    known = set(connection.scalars(select(CampaignRow.id)))
    if unknown := sorted(set(numbers) - known):
        raise UsageError(
            f"campaign {unknown[0]} does not exist", advice="`vsnbench db status` lists them", code="unknown-campaign"
        )
    arms = connection.execute(
        select(StudyArm.campaign_id, StudyArm.study_id).where(StudyArm.campaign_id.in_(list(numbers)))
    ).first()
    if arms is not None:
        raise UsageError(
            f"campaign {arms[0]} is an arm of study {arms[1]}, which is bundled as a whole",
            advice=f"give --study {arms[1]}",
            code="locked-study",
        )
    selected = BundleSelection(tuple(sorted(set(numbers))))
    _check_episodes(connection, selected.campaigns)
    return selected


def _check_episodes(connection: Connection, campaigns: Sequence[int]) -> None:
    episodes = (
        select(EpisodeRow.id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .where(TrialRow.campaign_id.in_(campaigns))
        .order_by(EpisodeRow.id)
        .limit(1)
    )
    if connection.scalar(episodes) is None:
        raise UsageError("no episodes to bundle", advice="`vsnbench run` runs trials", code="nothing-to-bundle")
    running = connection.scalar(episodes.where(EpisodeRow.state.in_([state.value for state in ACTIVE])))
    if running is not None:
        raise UsageError(
            f"episode {running} is running",
            advice="wait for its end; `vsnbench run` recovers one whose process was killed",
            code="running-episode",
        )
