"""What a session's end says to whoever stood beside the robot: at the page, and in one line at the terminal."""

from collections.abc import Sequence

from sqlalchemy import Engine

from vsnbench.database.lifecycle import ENDED, EpisodeState
from vsnbench.database.queries import list_episodes
from vsnbench.database.read_shapes import EpisodeFilter
from vsnbench.database.sessions import interventions_in
from vsnbench.runner.board import Board


def session_summary(engine: Engine, campaigns: Sequence[int], board: Board) -> list[tuple[str, str]]:
    """Return names and values, for people: of all that the record has of what is run, whoever ran it.

    Args:
        engine: of the record.
        campaigns: the numbers of what is run.
        board: says whether people are blind to what a model does, and how the battery went.

    Raises:
        RecordError: the record cannot be read.
    """
    found = [
        one
        for campaign in campaigns
        for one in list_episodes(engine, EpisodeFilter(campaign=str(campaign)))
        if one.state in ENDED
    ]
    judged = [one for one in found if one.state == EpisodeState.JUDGED]
    driven_s = sum(one.duration_s or 0.0 for one in found)
    driven_m = sum(one.path_length_m or 0.0 for one in found)
    rows = [
        ("episodes", str(len(found))),
        ("judged", str(len(judged))),
        ("await a judgement", str(sum(one.state == EpisodeState.AWAITING for one in found))),
        ("void", str(sum(one.state == EpisodeState.VOID for one in found))),
        ("interventions", str(interventions_in(engine, campaigns))),
        ("driven", driven_words(driven_s, driven_m)),
    ]
    if board.shows_actions and judged:
        successes = sum(bool(one.success) for one in judged)
        rows.insert(2, ("success so far", f"{successes} of {len(judged)} ({successes / len(judged):.0%})"))
    if words := board.battery_words:
        rows.append(("battery", words))
    return rows


def driven_words(driven_s: float, driven_m: float) -> str:
    """Return how long and how far a robot was driven, in the units of a minute as of an afternoon."""
    hours, minutes = driven_s / 3600, driven_s / 60
    time = f"{hours:.1f} h" if hours >= 1 else f"{minutes:.0f} min" if minutes >= 1 else f"{driven_s:.0f} s"
    return f"{time}, {driven_m / 1000:.2f} km" if driven_m >= 1000 else f"{time}, {driven_m:.1f} m"


def session_words(engine: Engine, campaigns: Sequence[int], board: Board) -> str:
    """Return the same in one line, without what is none; empty where no episode has ended.

    Raises:
        RecordError: the record cannot be read.
    """
    rows = session_summary(engine, campaigns, board)
    return "" if rows[0][1] == "0" else ", ".join(f"{name} {value}" for name, value in rows if value != "0")
