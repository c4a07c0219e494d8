"""The record that is verified: a private copy of its database with the current schema, opened for reading."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from sqlalchemy import Connection, Engine, Row, select

from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.weights import SCANS
from vsnbench.protocol.disturbances import DISTURBANCES, Disturbance, Disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import DATABASE_NAME
from vsnbench.results.goals import with_goals
from vsnbench.results.merging.sources import copy_record
from vsnbench.results.schema.engine import opened_engine, transaction
from vsnbench.results.schema.tables import (
    CampaignRow,
    EpisodeRow,
    EventRow,
    ModelRow,
    ProcessRow,
    RobotRow,
    SiteRow,
    StepRow,
    TrialRow,
    VerdictRow,
)
from vsnbench.results.writing.judging import RETRACTED
from vsnbench.results.writing.steps import step_of_row
from vsnbench.sites.scan import SCAN_SUFFIX
from vsnbench.sites.site import Site as SurveyedSite
from vsnbench.values.robot_identity import REHEARSAL_KEY, SIMULATED
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.values.step import StepRecord

Parsed = TypeVar("Parsed", SurveyedSite, RobotProfile)


@dataclass(frozen=True, slots=True)
class RecordedCondition:
    """A campaign with what its trials ran under."""

    id: int
    row: Row[Any]
    """Columns of the campaign, with those of its robot and model."""
    site: SurveyedSite | None
    """None for an import that names its site only."""
    profile: RobotProfile | None
    """None for an imported robot."""
    parameters: ProtocolParameters

    @property
    def is_simulated_here(self) -> bool:
        """Whether the robot was the simulated one, without a person who places it."""
        return bool(self.row.kind == SIMULATED and self.row.simulated and not self.row.conditions.get(REHEARSAL_KEY))

    @property
    def disturbances(self) -> Disturbances:
        """Disturbances of what the policy saw."""
        recorded = self.row.conditions.get(DISTURBANCES) or {}
        return Disturbances.of(Disturbance(str(name), float(value)) for name, value in recorded.items())


class VerifiedRecord:
    """An untrusted record that is open for reading."""

    def __init__(self, results: Path, engine: Engine, connection: Connection) -> None:
        self.results = results
        """Results directory with the images; nothing is written there."""
        self.engine = engine
        """Engine of the private copy."""
        self.connection = connection
        self._conditions: dict[int, RecordedCondition] = {}

    @property
    def versions(self) -> tuple[str, ...]:
        """Versions of vsnbench that wrote the record."""
        return tuple(sorted(map(str, set(self.connection.scalars(select(ProcessRow.vsnbench_version))))))

    def episodes(self) -> list[Row[Any]]:
        """Return all episodes with their trial and the version that recorded them, by number."""
        query = (
            select(
                EpisodeRow.__table__,
                *(TrialRow.campaign_id, TrialRow.goal, TrialRow.start, TrialRow.repetition),
                ProcessRow.vsnbench_version,
            )
            .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
            .join(ProcessRow, ProcessRow.id == EpisodeRow.process_id)
            .order_by(EpisodeRow.id)
        )
        return list(self.connection.execute(query))

    def condition(self, campaign_id: int) -> RecordedCondition:
        """Return the condition of a campaign.

        Raises:
            ValueError: its protocol is invalid.
        """
        if campaign_id not in self._conditions:
            self._conditions[campaign_id] = self._read_condition(campaign_id)
        return self._conditions[campaign_id]

    def _read_condition(self, campaign_id: int) -> RecordedCondition:
        row = self.connection.execute(
            select(
                *(CampaignRow.key, CampaignRow.seed, CampaignRow.protocol, CampaignRow.conditions),
                *(RobotRow.kind, RobotRow.simulated, RobotRow.profile, SiteRow.content),
                *(
                    ModelRow.name,
                    ModelRow.weights_sha256,
                    ModelRow.code,
                    ModelRow.files,
                    ModelRow.settings,
                    ModelRow.sha256.label("model_sha256"),
                ),
            )
            .join(RobotRow, RobotRow.id == CampaignRow.robot_id)
            .join(ModelRow, ModelRow.id == CampaignRow.model_id)
            .join(SiteRow, SiteRow.id == CampaignRow.site_id)
            .where(CampaignRow.id == campaign_id)
        ).one()
        content = with_goals(self.connection, row.content, [campaign_id])
        site, profile = _parsed(SurveyedSite, content), _parsed(RobotProfile, row.profile)
        if site is not None and site.scan is not None:
            file = self.results.parent / SCANS / f"{site.scan.sha256[:12]}{SCAN_SUFFIX}"
            if file.is_file():  # its hash is compared when it is read
                site = site.model_copy(update={"scan": site.scan.model_copy(update={"path": file})})
        return RecordedCondition(campaign_id, row, site, profile, ProtocolParameters.from_record(row.protocol))

    def steps(self, episode_id: int) -> list[StepRecord]:
        """Return the steps of an episode in order.

        Raises:
            ValueError: a step is invalid.
        """
        query = select(StepRow.__table__).where(StepRow.episode_id == episode_id).order_by(StepRow.number)
        return [step_of_row(row) for row in self.connection.execute(query)]

    def verdicts(self, episode_id: int) -> list[Row[Any]]:
        """Return the verdicts of an episode, oldest first."""
        query = select(VerdictRow.__table__).where(VerdictRow.episode_id == episode_id).order_by(VerdictRow.id)
        return list(self.connection.execute(query))

    def was_retracted(self, episode_id: int) -> bool:
        """Return whether a judgement of an episode was retracted."""
        query = select(EventRow.id).where(EventRow.episode_id == episode_id, EventRow.kind == RETRACTED).limit(1)
        return self.connection.scalar(query) is not None


def _parsed(model: type[Parsed], content: object) -> Parsed | None:
    """Return None for what an import names only; other invalid content is found in the check of the values."""
    try:
        return model.model_validate(content)
    except ValidationError:
        return None


@contextmanager
def open_copy(results: Path, scratch: Path) -> Iterator[VerifiedRecord]:
    """Copy the database of a results directory, upgrade the copy, and open it for reading.

    Raises:
        RecordError: there is no record, it is damaged, it has views or triggers, or its schema is newer.
    """
    source, copy = results / DATABASE_NAME, scratch / DATABASE_NAME
    if source.is_symlink():
        raise RecordError(f"{source} is a link", advice="name the results directory with the file itself")
    if not source.is_file():
        raise RecordError(
            f"no record at {source}",
            advice="name a results directory, or a bundle of `vsnbench bundle`",
            code="no-record",
        )
    copy_record(sqlite_url(source), str(source), copy)
    with opened_engine(sqlite_url(copy), read_only=True) as engine, transaction(engine) as connection:
        yield VerifiedRecord(results, engine, connection)
