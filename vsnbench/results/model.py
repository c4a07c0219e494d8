"""What a record has of campaigns and episodes. Each quantity is declared once, here (`vsnbench.results.fields`).

Lists, tables, exports, pages, JSON and its schema show these quantities under these names.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from sqlalchemy import func, select

from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.protocol.execution import STOP_AND_GO, execution_of
from vsnbench.protocol.metrics import known_progress
from vsnbench.results.fields import fields_of, quantity
from vsnbench.results.goals import GOAL_KINDS, RecordedGoal, goal_text
from vsnbench.results.reading import read_model as read
from vsnbench.results.schema import tables
from vsnbench.results.schema.row_encoding import fix_of_columns
from vsnbench.results.writing.entries import END_REASONS, SequenceLeg
from vsnbench.results.writing.lifecycle import RESULTS
from vsnbench.results.writing.sessions import RecordedPlacement, RecordedSession, RecordedStop
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.person import driver_of_model

SOURCES = "`simulated`, `surveyed`, `measured`, `tape` or `estimated`"
_UNTIL_END = "until the episode has ended"
_ROW = tables.EpisodeRow


def _progress(state: str, shortest_m: float | None, remaining_m: float | None) -> float | None:
    return known_progress(shortest_m, remaining_m) if state in RESULTS else None


def _duration(duration_s: float | None, is_hidden: bool) -> float | None:
    return None if is_hidden else duration_s


def _placement(x_m: float | None, y_m: float | None, heading_rad: float | None, source: str | None) -> Fix | None:
    return fix_of_columns(x_m, y_m, heading_rad, source or PoseSource.ESTIMATED.value)


def _pose(name: str) -> list[Any]:
    return [getattr(_ROW, f"{name}_{part}") for part in ("x_m", "y_m", "heading_rad", "source")]


@dataclass(frozen=True, slots=True)
class Episode:
    """An episode according to its current verdict."""

    id: int = quantity("number of the episode in this record", _ROW.id, column="episode")
    uuid: str = quantity("identity of the episode in every record", _ROW.uuid)
    campaign: str = quantity("name of the campaign", read.CAMPAIGN_NAME)
    campaign_id: int = quantity("number of the campaign in this record", tables.TrialRow.campaign_id, column="campaign")
    model: str = quantity("name of the model; its code while a study is blinded", read.MODEL_NAME)
    driver: str = quantity(
        "name of the person who drove; empty for a model",
        *(tables.ModelRow.name, tables.ModelRow.settings),
        decode=driver_of_model,
        hidden=True,
    )
    disturbances: str = quantity(
        "disturbances, as for `--disturb`; empty without any", tables.CampaignRow.conditions, decode=text_of_conditions
    )
    execution: str = quantity(
        "`stop_and_go`, `continuous`: the robot drives on while the model thinks, or `stack`: a stack drives it",
        tables.CampaignRow.protocol,
        decode=execution_of,
    )
    robot: str = quantity("name of the robot profile", tables.RobotRow.name)
    simulated: bool = quantity("the robot is simulated", tables.RobotRow.simulated)
    site: str = quantity("name of the site", tables.SiteRow.name)
    goal: str = quantity("goal category, or name of a goal of the site file", tables.TrialRow.goal)
    goal_kind: str = quantity(GOAL_KINDS, func.coalesce(tables.GoalRow.kind, GoalKind.CATEGORY.value))
    goal_text: str = quantity(
        "words of a text goal, an instruction or a category of the site file; empty otherwise",
        tables.GoalRow.content,
        decode=lambda content: goal_text(content or {}),
    )
    start: int = quantity("number of the starting position; 0 if unknown", tables.TrialRow.start)
    repetition: int = quantity("number of the repetition, from 1", tables.TrialRow.repetition)
    seed: int = quantity("seed of the random choices of this episode", _ROW.seed)
    origin: str = quantity("`run`, or `imported` from another tool", _ROW.origin)
    state: Literal["counted", "unjudged", "void", "superseded", "running"] = quantity(
        "role of the episode in its trial: only a `counted` one is in rates; `superseded`: an earlier one counts",
        read.PART,
    )
    counts: bool = quantity(
        "the episode counts for its trial: its first result, once it is judged",
        read.PART,
        decode=lambda part: part == read.COUNTED,
    )
    outcome: Literal["success", "failure", "void", "running", "unjudged"] = quantity(
        "outcome according to the latest verdict; `unjudged` awaits one", read.OUTCOME
    )
    end_reason: str | None = quantity(END_REASONS, read.END_REASON, absent=_UNTIL_END)
    ended_with: str | None = quantity("end reason before any judgement", _ROW.end_reason, absent=_UNTIL_END)
    error: str = quantity("error message of a void episode; otherwise empty", read.ERROR)
    success: bool | None = quantity("latest verdict", read.SUCCESS, absent="if void, running or unjudged")
    actions: int = quantity("number of actions; STOP and blocked ones count", _ROW.actions)
    distance_m: float | None = quantity("distance to the goal at the end", read.DISTANCE_M)
    distance_source: str | None = quantity(SOURCES, read.DISTANCE_SOURCE, absent="without a distance")
    goal_instance: str | None = quantity(
        "id of the object nearest to the robot among those that count", read.GOAL_INSTANCE
    )
    goal_in_sight: bool = quantity(
        "an instance was in sight at the end; true if the protocol does not require it", read.GOAL_IN_SIGHT
    )
    collision: bool = quantity("the robot touched something", read.COLLISION)
    path_m: float | None = quantity("length of the driven path", _ROW.path_length_m)
    shortest_m: float | None = quantity(
        "shortest path from the start to the region in which the goal counts as reached", _ROW.geodesic_start_m
    )
    remaining_m: float | None = quantity("shortest path from the end to that region", _ROW.geodesic_end_m)
    progress: float | None = quantity(
        "covered share of the shortest path, 0 to 1; not success",
        *(_ROW.state, _ROW.geodesic_start_m, _ROW.geodesic_end_m),
        decode=_progress,
    )
    duration_s: float | None = quantity(
        "duration on the robot's clock",
        _ROW.duration_s,
        read.HAS_HIDDEN_DURATION,
        decode=_duration,
        absent="if unknown, and for a blinded arm in continuous execution",
    )
    wall_duration_s: float | None = quantity("duration on the computer's clock", _ROW.wall_duration_s, hidden=True)
    thinking_s: float | None = quantity(
        "sum of the inference times", _ROW.thinking_s, absent="until the end, and if a step has none", hidden=True
    )
    started_at: datetime = quantity("time of the start, UTC", _ROW.started_at)
    ended_at: datetime | None = quantity(
        "time of the end, UTC", _ROW.ended_at, absent="until then, and for an arm of a blinded study", hidden=True
    )
    placement: Fix | None = quantity("pose at the start", *_pose("start"), decode=_placement)
    final: Fix | None = quantity("pose at the end", *_pose("final"), decode=fix_of_columns)
    images_directory: str = quantity(
        "directory of the images, relative to the results directory; empty without images", _ROW.images_directory
    )
    success_distance_m: float | None = quantity(
        "success distance of the protocol",
        tables.CampaignRow.protocol["success_distance_m"].as_float(),
        absent="if it has none",
    )
    legs: tuple[SequenceLeg, ...] = quantity(
        "goals of a sequence that were given, in order, as the protocol judged them; empty for another goal",
        _ROW.legs,
        decode=lambda legs: tuple(SequenceLeg(**leg) for leg in legs or ()),
    )
    tags: tuple[str, ...] = quantity("tags in alphabetical order")


@dataclass(frozen=True, slots=True)
class RecordedVerdict:
    """A judgement, or a proposal of the protocol; the latest judgement is current."""

    created_at: datetime = quantity("time of the verdict", tables.VerdictRow.created_at)
    proposed: bool = quantity("proposal of the protocol that awaits a person", tables.VerdictRow.proposed)
    success: bool | None = quantity("success", tables.VerdictRow.success, absent="for void")
    end_reason: str = quantity(END_REASONS, tables.VerdictRow.end_reason)
    distance_m: float | None = quantity("distance to the goal", tables.VerdictRow.distance_m)
    distance_source: str | None = quantity(SOURCES, tables.VerdictRow.distance_source, absent="without a distance")
    goal_instance: str | None = quantity("id of the nearest object that counts", tables.VerdictRow.goal_instance)
    goal_in_sight: bool | None = quantity("no wall hid the goal at the end", tables.VerdictRow.goal_in_sight)
    author: str = quantity("name of the person, or `vsnbench`", tables.VerdictRow.author)
    source: str = quantity("`protocol`, `person`, `recovery` or `import`", tables.VerdictRow.source)
    reason: str = quantity("verdict in words", tables.VerdictRow.reason)
    note: str = quantity("reason that the author gave; may be empty", tables.VerdictRow.note)


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """An event of an episode."""

    created_at: datetime = quantity("time of the event", tables.EventRow.created_at)
    step_number: int | None = quantity(
        "number of the step at which it happened",
        tables.EventRow.step_number,
        absent="if it belongs to the whole episode",
    )
    kind: str = quantity("kind of event, such as `note` or `intervention`", tables.EventRow.kind)
    author: str = quantity("person who caused it; empty without one", tables.EventRow.author)
    text: str = quantity("content of the event", tables.EventRow.text)

    @property
    def statement(self) -> str:
        """The text without the number of the action, with which texts of earlier versions begin."""
        return self.text.removeprefix(f"action {self.step_number}: ")


@dataclass(frozen=True, slots=True)
class EpisodeProvenance:
    """Data that an episode's result depends on."""

    vsnbench_version: str = quantity("version of vsnbench", tables.ProcessRow.vsnbench_version)
    git_commit: str = quantity("commit of a checkout; empty if installed", tables.ProcessRow.git_commit)
    git_dirty: bool = quantity("the checkout had changes", tables.ProcessRow.git_dirty)
    host: str = quantity("name of the computer", tables.ProcessRow.host)
    operator: str = quantity("person who started the command", tables.ProcessRow.operator)
    command: str = quantity("command line, without passwords", tables.ProcessRow.command)
    packages: dict[str, str] = quantity("package → version", tables.ProcessRow.packages)
    platform: dict[str, str] = quantity("facts about the machine and Python", tables.ProcessRow.platform)
    weights_sha256: str = quantity(
        "SHA-256 of the weights file; empty without weights", tables.ModelRow.weights_sha256, hidden=True
    )
    weights_label: str = quantity(
        "name or description of the weights; empty without weights", tables.ModelRow.weights_label, hidden=True
    )
    model_files: dict[str, str] = quantity("file of the model → SHA-256", tables.ModelRow.files, hidden=True)
    model_code: dict[str, str] = quantity(
        "source of the model's class: module, hashes, commit; empty for built-in models",
        tables.ModelRow.code,
        hidden=True,
    )
    model_settings: dict[str, Any] = quantity(
        "settings of the model; keys depend on the model", tables.ModelRow.settings, hidden=True
    )
    robot_kind: str = quantity(
        "kind of robot: `simulated`, `ros1`, `ros2`, `adapter`, `imported` or the class of a plug-in",
        tables.RobotRow.kind,
    )
    robot_profile: dict[str, Any] = quantity("robot profile as recorded", tables.RobotRow.profile)
    site_sha256: str = quantity("SHA-256 of the site's content", tables.SiteRow.sha256)
    site_content: dict[str, Any] = quantity("site file as recorded", tables.SiteRow.content)
    protocol: dict[str, Any] = quantity("parameters of the protocol", tables.CampaignRow.protocol)
    protocol_sha256: str = quantity("SHA-256 of the parameters", tables.CampaignRow.protocol_sha256)
    conditions: dict[str, Any] = quantity("circumstances; keys depend on the robot", tables.CampaignRow.conditions)
    campaign_key: str = quantity("identity of the campaign in every record", tables.CampaignRow.key, hidden=True)
    campaign_seed: int = quantity("seed of the campaign", tables.CampaignRow.seed)


@dataclass(frozen=True, slots=True)
class EpisodeRecord(Episode):
    """An episode with everything that is recorded of it except its steps."""

    goal_definition: RecordedGoal | None = quantity("goal as the site file defined it", absent="for a goal category")
    measured: RecordedPlacement | None = quantity("measured pose at the start", absent="if it was not measured")
    stopped: RecordedStop | None = quantity("pose measured after STOP", absent="if it was not measured")
    session: RecordedSession | None = quantity("operator's session of the episode", absent="without an operator")
    verdicts: tuple[RecordedVerdict, ...] = quantity("all verdicts, oldest first; the latest counts")
    events: tuple[RecordedEvent, ...] = quantity("notes, tags, interventions and other events, oldest first")
    provenance: EpisodeProvenance = quantity("what exactly ran")

    @property
    def current_verdict(self) -> RecordedVerdict | None:
        """The current verdict; None without a judgement, or if it was retracted."""
        if self.outcome == "unjudged":
            return None
        return next((verdict for verdict in reversed(self.verdicts) if not verdict.proposed), None)

    @property
    def proposal(self) -> RecordedVerdict | None:
        """The protocol's latest proposal."""
        return next((verdict for verdict in reversed(self.verdicts) if verdict.proposed), None)


def _trials(*conditions: Any) -> Any:
    trials = select(func.count(tables.TrialRow.id.distinct())).where(
        tables.TrialRow.campaign_id == tables.CampaignRow.id
    )
    return trials.where(*conditions).correlate(tables.CampaignRow).scalar_subquery()


_HAS_RESULT = (
    tables.EpisodeRow.trial_id == tables.TrialRow.id,
    tables.EpisodeRow.state.in_([state.value for state in RESULTS]),
)


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign with its progress."""

    id: int = quantity("number of the campaign in this record", tables.CampaignRow.id)
    key: str = quantity("identity of the campaign in every record", read.CAMPAIGN_KEY)
    name: str = quantity("name of the campaign", read.CAMPAIGN_NAME)
    created_at: datetime = quantity("time of creation", tables.CampaignRow.created_at)
    model: str = quantity("name of the model", read.MODEL_NAME)
    robot: str = quantity("name of the robot profile", tables.RobotRow.name)
    simulated: bool = quantity("the robot is simulated", tables.RobotRow.simulated)
    site: str = quantity("name of the site", tables.SiteRow.name)
    seed: int = quantity("seed of all random choices", tables.CampaignRow.seed)
    trials: int = quantity("number of planned trials", _trials())
    done: int = quantity("number of trials with a result", _trials(*_HAS_RESULT))
    disturbances: str = quantity(
        "disturbances, as for `--disturb`; empty without any", tables.CampaignRow.conditions, decode=text_of_conditions
    )
    execution: str = quantity(
        "`stop_and_go`, `continuous`: the robot drives on while the model thinks, or `stack`: a stack drives it",
        tables.CampaignRow.protocol,
        decode=execution_of,
    )

    @property
    def title(self) -> str:
        """The name with the disturbances and the execution, which the name does not have."""
        driven = "" if self.execution == STOP_AND_GO else f", {self.execution}"
        return f"{self.name} with {self.disturbances}{driven}" if self.disturbances else f"{self.name}{driven}"


EPISODE = fields_of(Episode)
"""JSON has all of these. What a table or a page has of them is chosen in the lists below, in their order."""
TABLE = EPISODE.only(
    *("id", "campaign_id", "goal", "start", "repetition", "state", "end_reason", "success", "actions", "path_m"),
    *("shortest_m", "remaining_m", "distance_m", "goal_in_sight", "duration_s", "thinking_s", "wall_duration_s"),
    *("started_at", "ended_at", "images_directory"),
)
"""Columns of `export episodes` and of `Results.episodes` in Python, which also have computed ones.

Each is read from one SQL expression, which `Fields.single` requires; `duration_s` from its first, the report itself
hides it.
"""
STEPS_TABLE = EPISODE.only(
    *("id", "model", "robot", "simulated", "site", "goal", "start", "repetition", "end_reason", "success", "counts"),
)
"""Columns of `export csv` about the episode of a step."""
ROW = EPISODE.only(
    *("id", "model", "campaign_id", "robot", "simulated", "site", "goal", "goal_text", "start", "repetition"),
    *(
        "outcome",
        "end_reason",
        "counts",
        "state",
        "actions",
        "distance_m",
        "path_m",
        "shortest_m",
        "duration_s",
        "started_at",
    ),
    *("images_directory", "disturbances", "tags"),
)
"""What the list of the results browser has of each episode; its scripts give each a place."""
FACTS = EPISODE.only("driver", "goal_text")
"""Further lines of an episode's page in the results browser, each with its name, unless empty or unknown."""
EPISODE_RECORD = fields_of(EpisodeRecord)
PROVENANCE = fields_of(EpisodeProvenance)
CAMPAIGN = fields_of(Campaign)
