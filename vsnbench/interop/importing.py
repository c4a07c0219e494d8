"""Imports episodes of other tools, with the tool's judgement if there is one."""

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.interop.habitat import HabitatEpisode
from vsnbench.interop.upstream_log import LoggedEpisode
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.images import rgb_path
from vsnbench.results.files.staged_import import StagedImport, remove_stale_imports
from vsnbench.results.reading.queries import images_directories
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.entries import unjudged_end
from vsnbench.results.writing.imports import ImportedEpisode
from vsnbench.results.writing.journal import Journal
from vsnbench.sites.site import Site
from vsnbench.values.encoding.images import decode_picture, encode_jpeg
from vsnbench.values.fix import PoseSource
from vsnbench.values.model.card import ModelCard
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.robot_identity import IMPORTED, RobotIdentity
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.values.step import StepRecord

NO_NUMBER = 0
"""Starting position of episodes without one."""


def unsurveyed_site(name: str) -> Site:
    """Return a site with only a name, which cannot be drawn or used."""
    if not name or not all(mark.isascii() and (mark.isalnum() or mark in "_-") for mark in name):
        raise UsageError(f"{name!r} is not a valid site name", advice="use letters, digits, - and _")
    return Site.model_construct(
        name=name.lower(), title="", rooms=[], walls=[], doors=[], windows=[], objects=[], starts=[]
    )


def habitat_agent() -> RobotProfile:
    """Return the profile of a simulator's agent with only a name."""
    known: dict[str, Any] = {"name": "habitat", "title": "Habitat agent"}
    return RobotProfile.model_construct(**known)


def import_upstream_log(
    journal: Journal,
    results_directory: Path,
    episodes: Sequence[LoggedEpisode],
    *,
    model: str,
    site: Site,
    robot: RobotProfile,
    source: Path,
    start: int = NO_NUMBER,
) -> tuple[int, tuple[int, ...]]:
    """Import the episodes of an upstream log folder, unjudged; return the numbers of their campaign and of each.

    The import includes all images, or fails as a whole.

    Raises:
        UsageError: they are already in the record.
        RecordError: the record or an image cannot be used.
    """
    plan = _plan([episode.goal for episode in episodes], start, model, site, robot, False, source)
    imported = [_logged(episode) for episode in episodes]
    kept = partial(images_directories, journal.engine)
    remove_stale_imports(results_directory, kept)
    with StagedImport(results_directory, kept) as staged:
        for given, episode in zip(imported, episodes, strict=True):
            if given.has_images:
                directory = staged.room_for(given.uuid)
                for number, picture in enumerate(episode.pictures, start=1):
                    _stage_picture(picture, rgb_path(directory, number))
        return journal.import_campaign(plan, imported, staged.place)


def _logged(episode: LoggedEpisode) -> ImportedEpisode:
    unknown = MotionResult(completed=True, displacement_m=math.nan, turn_rad=math.nan, duration_s=math.nan)
    moment = episode.started_at or datetime.now(UTC)
    # The reason for a log that ends without STOP is unknown; an operator decides.
    reason = EndReason.STOP if episode.stopped else EndReason.ABORTED
    if len(episode.actions) >= ProtocolParameters().max_actions:
        reason = EndReason.STEP_LIMIT
    return ImportedEpisode(
        end=unjudged_end(
            reason,
            len(episode.actions),
            error="" if episode.stopped else "the imported log ends without STOP",
            ended_at=moment,
        ),
        steps=[
            StepRecord(number, action.action, action.raw_action, unknown)
            for number, action in enumerate(episode.actions, start=1)
        ],
        started_at=moment,
        has_images=bool(episode.pictures),
    )


def import_habitat(
    journal: Journal,
    episodes: Sequence[HabitatEpisode],
    *,
    model: str,
    site: Site,
    source: Path,
    protocol: ProtocolParameters,
) -> tuple[int, tuple[int, ...]]:
    """Import a simulator's judged episodes, all or none; return the numbers of their campaign and of each.

    The caller gives the protocol of the episodes, which the file does not contain.

    Raises:
        UsageError: they are already in the record, or one is longer than the protocol allows.
        RecordError: the record cannot be used.
    """
    goals = [episode.goal for episode in episodes]
    longest = max(episode.steps for episode in episodes)
    if longest > protocol.max_actions:
        raise UsageError(
            f"{source} has an episode of {longest} steps, more than --max-steps {protocol.max_actions}",
            advice="give the limit of these episodes",
        )
    plan = _plan(goals, NO_NUMBER, model, site, habitat_agent(), True, source, protocol)
    return journal.import_campaign(plan, [_simulated(episode, protocol) for episode in episodes])


def _simulated(episode: HabitatEpisode, protocol: ProtocolParameters) -> ImportedEpisode:
    capped = not episode.success and episode.steps >= protocol.max_actions
    reason = EndReason.STEP_LIMIT if capped else EndReason.STOP
    distance = None
    if episode.distance_to_goal_m is not None:
        distance = GoalDistance(episode.distance_to_goal_m, PoseSource.SIMULATED)
    return ImportedEpisode(
        end=unjudged_end(reason, episode.steps, path_m=episode.path_length_m),
        shortest_m=episode.geodesic_distance_m,
        judged=Verdict(reason, episode.success, "as the simulator's results say", distance),
        author="habitat",
    )


def _plan(
    goals: Sequence[str],
    start: int,
    model: str,
    site: Site,
    robot: RobotProfile,
    simulated: bool,
    source: Path,
    protocol: ProtocolParameters | None = None,
) -> CampaignPlan:
    """Plan one trial per episode; the hash of the source makes the campaign unique."""
    seen: Counter[str] = Counter()
    planned = []
    for goal in goals:
        seen[goal] += 1
        planned.append(Trial(goal, start, seen[goal]))
    digest = hashlib.sha256(source.read_bytes()).digest()
    return CampaignPlan(
        site=site,
        robot=RobotIdentity(robot, IMPORTED, simulated),
        model=ModelCard(model),
        protocol=protocol or ProtocolParameters(),
        seed=int.from_bytes(digest[:7], "big"),
        trials=planned,
        name=f"{model}, imported from {source.name}",
    )


def _stage_picture(source: Path, target: Path) -> None:
    import cv2

    content = read_confined(source.parent, source.name)
    picture = decode_picture(content, cv2.IMREAD_COLOR) if content else None
    if picture is None:
        raise RecordError(f"{source} is not an image; nothing was imported")
    write_atomic(target, encode_jpeg(picture[..., ::-1]))
