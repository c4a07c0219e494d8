"""Takes other tools' episodes into the record: marked as imported, judged only where the tool had judged them."""

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vsnbench.database.journal import Journal
from vsnbench.database.records import (
    CampaignPlan,
    EpisodeEnd,
    EpisodeStart,
    ModelIdentity,
    PlannedTrial,
    StepRecord,
    TrialRecord,
)
from vsnbench.errors import RecordError, UsageError
from vsnbench.exchange.habitat import HabitatEpisode
from vsnbench.exchange.upstream_log import LoggedEpisode
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pictures import decode_picture, encode_jpeg
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.record.confined import read_confined
from vsnbench.whole_files import write_whole

NO_NUMBER = 0
"""Starting position of an episode that does not say from which it started."""


def unsurveyed_site(name: str) -> Site:
    """Return a site of which only the name is known; it can be neither drawn nor driven in."""
    if not name or not all(mark.isascii() and (mark.isalnum() or mark in "_-") for mark in name):
        raise UsageError(f"{name!r} cannot name a site: use letters, digits, - and _")
    return Site.model_construct(
        name=name.lower(), title="", rooms=[], walls=[], doors=[], windows=[], objects=[], starts=[]
    )


def habitat_agent() -> RobotProfile:
    """Return the profile of a simulator's agent, of which only the name is known."""
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
) -> tuple[int, ...]:
    """Write the episodes of an upstream log folder, unjudged, and return their numbers.

    Raises:
        UsageError: they are in the record already.
        RecordError: the record or a picture cannot be used.
    """
    protocol = ProtocolParameters()
    trials = _trials(journal, [episode.goal for episode in episodes], start, model, site, robot, False, source)
    numbers = []
    for episode, trial in zip(episodes, trials, strict=True):
        moment = episode.started_at or datetime.now(UTC)
        handle = journal.begin_episode(
            EpisodeStart(trial.id, seed=0, keeps_images=bool(episode.pictures), origin="imported", started_at=moment)
        )
        for number, action in enumerate(episode.actions, start=1):
            if episode.pictures:
                _keep_picture(episode.pictures[number - 1], results_directory / handle.images_directory, number)
            unknown = MotionResult(completed=True, displacement_m=math.nan, turn_rad=math.nan, duration_s=math.nan)
            journal.append_step(handle.id, StepRecord(number, action.action, action.raw_action, unknown))
        journal.end_episode(
            handle.id,
            EpisodeEnd(
                end_reason=_end(len(episode.actions), episode.stopped, protocol),
                actions=len(episode.actions),
                error="" if episode.stopped else "the imported log ends without STOP",
                ended_at=moment,
            ),
        )
        numbers.append(handle.id)
    return tuple(numbers)


def import_habitat(
    journal: Journal, episodes: Sequence[HabitatEpisode], *, model: str, site: Site, source: Path
) -> tuple[int, ...]:
    """Write a simulator's judged episodes and return their numbers.

    Raises:
        UsageError: they are in the record already.
        RecordError: the record cannot be used.
    """
    protocol = ProtocolParameters()
    goals = [episode.goal for episode in episodes]
    trials = _trials(journal, goals, NO_NUMBER, model, site, habitat_agent(), True, source)
    numbers = []
    for episode, trial in zip(episodes, trials, strict=True):
        handle = journal.begin_episode(
            EpisodeStart(
                trial.id, seed=0, geodesic_m=episode.geodesic_distance_m, keeps_images=False, origin="imported"
            )
        )
        capped = not episode.success and episode.steps >= protocol.max_actions
        reason = EndReason.STEP_LIMIT if capped else EndReason.STOP
        journal.end_episode(
            handle.id, EpisodeEnd(end_reason=reason, actions=episode.steps, path_length_m=episode.path_length_m)
        )
        distance = None
        if episode.distance_to_goal_m is not None:
            distance = GoalDistance(episode.distance_to_goal_m, PoseSource.SIMULATED)
        verdict = Verdict(reason, episode.success, "as the simulator's results say", distance)
        journal.add_verdict(handle.id, verdict, author="habitat", source="import")
        numbers.append(handle.id)
    return tuple(numbers)


def _trials(
    journal: Journal,
    goals: Sequence[str],
    start: int,
    model: str,
    site: Site,
    robot: RobotProfile,
    simulated: bool,
    source: Path,
) -> list[TrialRecord]:
    """Plan one trial an episode; the content of the source makes the campaign its own."""
    seen: Counter[str] = Counter()
    planned = []
    for goal in goals:
        seen[goal] += 1
        planned.append(PlannedTrial(goal, start, seen[goal]))
    digest = hashlib.sha256(source.read_bytes()).digest()
    plan = CampaignPlan(
        site=site,
        robot=RobotIdentity(robot, "imported", simulated),
        model=ModelIdentity(model),
        protocol=ProtocolParameters(),
        seed=int.from_bytes(digest[:7], "big"),
        trials=planned,
        name=f"{model}, imported from {source.name}",
    )
    campaign = journal.find_or_create_campaign(plan)
    if campaign.resumed and len(journal.trials_left(campaign.id)) < len(campaign.trials):
        raise UsageError(f"{source} is in the record already, as campaign {campaign.id}")
    return list(campaign.trials)


def _end(actions: int, stopped: bool, protocol: ProtocolParameters) -> EndReason:
    if actions >= protocol.max_actions:
        return EndReason.STEP_LIMIT
    # A log that just ends was ended by somebody: what happened is for a person to say.
    return EndReason.STOP if stopped else EndReason.ABORTED


def _keep_picture(source: Path, directory: Path, number: int) -> None:
    import cv2

    content = read_confined(source.parent, source.name)
    picture = decode_picture(content, cv2.IMREAD_COLOR) if content else None
    if picture is None:
        raise RecordError(f"{source} is not a picture")
    write_whole(directory / "rgb" / f"{number:04d}.jpg", encode_jpeg(picture[..., ::-1]))
