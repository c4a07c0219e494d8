"""Summary of a session for its operator: a table for the page, and one line for the terminal."""

from collections.abc import Sequence

from sqlalchemy import Engine

from vsnbench.results.model import Episode
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.writing.sessions import interventions_in
from vsnbench.runner.operator.session_state import SessionState
from vsnbench.text.sanitize import duration_text


def ended_episodes(engine: Engine, campaign_ids: Sequence[int]) -> list[Episode]:
    """Return the finished episodes of some campaigns, by any process.

    Raises:
        RecordError: the results cannot be read.
    """
    return [
        episode
        for campaign in campaign_ids
        for episode in list_episodes(engine, EpisodeFilter(campaign=str(campaign), has_ended=True))
    ]


def session_summary(engine: Engine, campaign_ids: Sequence[int], state: SessionState) -> list[tuple[str, str]]:
    """Return names and values of everything recorded of these campaigns, by any process.

    Raises:
        RecordError: the results cannot be read.
    """
    episodes = ended_episodes(engine, campaign_ids)
    judged = [episode for episode in episodes if episode.success is not None]
    driven_s = sum(episode.duration_s or 0.0 for episode in episodes)
    driven_m = sum(episode.path_m or 0.0 for episode in episodes)
    rows = [
        ("episodes", str(len(episodes))),
        ("judged", str(len(judged))),
        ("await a judgement", str(sum(episode.outcome == "unjudged" for episode in episodes))),
        ("void", str(sum(episode.outcome == "void" for episode in episodes))),
        ("interventions", str(interventions_in(engine, campaign_ids))),
        ("driven", driven_text(driven_s, driven_m)),
    ]
    if state.shows_actions and judged:
        successes = sum(bool(episode.success) for episode in judged)
        rows.insert(2, ("success so far", f"{successes} of {len(judged)} ({successes / len(judged):.0%})"))
    if text := state.battery_text:
        rows.append(("battery", text))
    return rows


def driven_text(driven_s: float, driven_m: float) -> str:
    """Return driving time and distance in suitable units."""
    time = duration_text(driven_s)
    return f"{time}, {driven_m / 1000:.2f} km" if driven_m >= 1000 else f"{time}, {driven_m:.1f} m"


def session_summary_line(engine: Engine, campaign_ids: Sequence[int], state: SessionState) -> str:
    """Return the summary in one line without zeros; empty where no episode has ended.

    Raises:
        RecordError: the results cannot be read.
    """
    rows = session_summary(engine, campaign_ids, state)
    return "" if rows[0][1] == "0" else ", ".join(f"{name} {value}" for name, value in rows if value != "0")
