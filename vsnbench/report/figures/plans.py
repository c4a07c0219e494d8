"""Floor plans with trajectories by goal and outcome, and with success by starting position."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import shapely
from sqlalchemy import Engine

from vsnbench.palette import COLLISION, FAILURE, LIMIT, SUCCESS
from vsnbench.protocol.judge import EndReason, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Condition, footnotes
from vsnbench.report.analysis.episodes_frame import ReportData, goal_order
from vsnbench.report.analysis.reading import read_courses
from vsnbench.report.analysis.summary import ConditionSummary, Group
from vsnbench.report.figures.style import INK, Drawing, column_in, in_pages, new_figure, page_in, panel_axes, styled
from vsnbench.report.figures.text_layout import legend_below, shown, wrapped
from vsnbench.report.figures.text_layout import width_in as letters_in
from vsnbench.report.plan.floor_plan import PlanStyle, draw_floor_plan, success_outline
from vsnbench.sites.geometry.walls import bounds_of, wall_area
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_OUTCOME_STYLES = {
    "success": (SUCCESS, (0, ()), "o"),
    "STOP, too far": (FAILURE, (0, (4, 1.2)), "s"),
    "collision": (COLLISION, (0, (1, 1)), "X"),
    "step limit": (LIMIT, (0, (4, 1, 1, 1)), "^"),
    "time limit": (LIMIT, (0, (4, 1, 1, 1)), "v"),
    "path limit": (LIMIT, (0, (4, 1, 1, 1)), "D"),
}
"""Outcome -> colour, dashes and end marker."""
_LIMITS = {reason.value: reason.value.replace("_", " ") for reason in EndReason if reason.is_limit}


MAX_MAPS = 6
"""Maps per figure."""
WEAK_RATE = 0.5
"""Success rate under which trajectories have a plan per start."""
MAX_STARTS = 30
"""Maximum number of starts with a plan each."""
_START_COLUMNS = 5
_TITLE_PT = 7.0
_SHARE_PT = 5.5
_DISK_M = 0.27
"""Radius of a starting position's disk, metres."""


@dataclass(frozen=True, slots=True)
class Track:
    """Path of the robot in one episode."""

    episode: int
    goal: str
    start: int
    success: bool
    end_reason: str
    points: tuple[tuple[float, float], ...]
    """(x, y) in the site's frame, metres, starting at the start."""


def read_tracks(engine: Engine, record: ReportData, condition: Condition, max_per_goal: int = 30) -> tuple[Track, ...]:
    """Read the paths of the counted episodes, evenly sampled above `max_per_goal` per goal.

    Poses in the site are used as recorded; without them odometry is added to the start pose.
    """
    rows = record.counted(condition)
    if rows.empty:
        return ()
    strides = {goal: max(1, math.ceil(len(mine) / max_per_goal)) for goal, mine in rows.groupby("goal", observed=True)}
    rank = rows.groupby("goal", observed=True).cumcount()
    chosen = rows[(rank % rows["goal"].astype(str).map(strides).astype(int)) == 0]
    numbers = [int(number) for number in chosen["episode"]]
    courses = read_courses(engine, numbers)
    columns = (chosen["goal"], chosen["start"], chosen["success"], chosen["end_reason"])
    return tuple(
        Track(
            *(number, str(goal), int(start), bool(success), str(reason)),
            tuple(pose.position for pose in courses[number].poses),
        )
        for number, goal, start, success, reason in zip(numbers, *columns, strict=True)
        if number in courses and courses[number].poses
    )


def trajectory_plan(
    site: Site, summary: ConditionSummary, tracks: Sequence[Track], left_out: str = "", *, may_split: bool = True
) -> Drawing | None:
    """Draw plans with tracks by outcome; None without tracks.

    There is one plan per goal; for a model that mostly fails, whose tracks would cover each other, one per start, if it
    may be split so.
    """
    if not tracks:
        return None
    by_start = may_split and _is_weak(summary) and 1 < len({track.start for track in tracks}) <= MAX_STARTS
    panels = _panels_by_start(summary, tracks) if by_start else _panels_by_goal(summary, tracks)
    columns = min(_START_COLUMNS if by_start else 3, len(panels))
    lines = -(-len(panels) // columns)
    width = column_in() if columns == 1 else page_in()
    has_region = any(goal for _, goal, _ in panels)
    with styled():
        title = wrapped(summary.condition.name, width - 0.4, 7.5)
        height = lines * width / columns * plan_shape(site) + 0.25 * lines + 0.13 * len(title.split("\n"))
        figure = new_figure(width, height)
        for axes, (label, goal, mine) in zip(panel_axes(figure, len(panels), columns), panels, strict=True):
            bare_plan(site, axes, goal, summary.condition)
            _draw_tracks(axes, mine)
            axes.set_title(wrapped(label, width / columns - 0.15, _TITLE_PT), pad=2)
        legend_below(figure, *_legend_samples(tracks, with_region=has_region))
        figure.suptitle(title, fontsize=7.5, color=INK)
    name, each = shown(summary.condition.name), "starting position" if by_start else "goal"
    instances = ", with the goal's instances in colour" if has_region else ""
    return Drawing(
        f"trajectories-{summary.condition.number}",
        f"Trajectories of {name}",
        f"Floor plans with the trajectories of {name}, one plan per {each}, by outcome.",
        f"Trajectories, one plan per {each}{instances}; the numbers are successes of episodes."
        f"{' STOP succeeds within the green outline.' if has_region else ''}{left_out}",
        footnotes([summary.condition]),
        figure,
    )


_Panel = tuple[str, str | None, Sequence[Track]]
"""Title, the goal to highlight, and tracks."""


def _is_weak(summary: ConditionSummary) -> bool:
    return summary.total.episodes > 0 and summary.total.success_rate < WEAK_RATE


def _panels_by_goal(summary: ConditionSummary, tracks: Sequence[Track]) -> list[_Panel]:
    goals = sorted({track.goal for track in tracks}, key=goal_order)
    known = {group.goal: group for group in summary.goals}
    return [_panel(goal, goal, known.get(goal), [track for track in tracks if track.goal == goal]) for goal in goals]


def _panels_by_start(summary: ConditionSummary, tracks: Sequence[Track]) -> list[_Panel]:
    goals = {track.goal for track in tracks}
    goal = goals.pop() if len(goals) == 1 else None
    known = {group.start: group for group in summary.starts}
    return [
        _panel(f"start {start}", goal, known.get(start), [track for track in tracks if track.start == start])
        for start in sorted({track.start for track in tracks})
    ]


def _panel(name: str, goal: str | None, group: Group | None, tracks: Sequence[Track]) -> _Panel:
    rate = f" {group.successes}/{group.episodes}" if group else ""
    sample = f", {len(tracks)} drawn" if group and len(tracks) < group.episodes else ""
    return f"{name}{rate}{sample}", goal, tracks


def success_maps(plans: Sequence[tuple[Site, ConditionSummary]]) -> Iterator[Drawing]:
    """Draw one plan per condition with the success rate at each starting position as a filled disk."""
    known = [(site, summary) for site, summary in plans if _places(site, summary)]
    return in_pages(known, MAX_MAPS, _maps)


def _places(site: Site, summary: ConditionSummary) -> dict[int, tuple[float, float]]:
    """Return the starting positions with completed trials, and their coordinates."""
    done = {group.start for group in summary.starts if group.episodes}
    return {start.number: start.position for start in site.starts if start.number in done}


def _maps(plans: Sequence[tuple[Site, ConditionSummary]]) -> Drawing:
    columns = min(2, len(plans))
    room_in = (column_in() if columns == 1 else page_in()) / columns - 0.25
    never = [", ".join(map(str, summary.never_succeeding)) or "none" for _, summary in plans]
    with styled():
        titles = [wrapped(summary.condition.name, room_in, 7.5) for _, summary in plans]
        below = [wrapped(f"no success from: {label}", room_in, 6.0) for label in never]
        letters = max(title.count("\n") + label.count("\n") for title, label in zip(titles, below, strict=True))
        tallest = max(plan_shape(site) for site, _ in plans)
        lines = -(-len(plans) // columns)
        height = lines * ((room_in + 0.25) * tallest + 0.35 + 0.12 * letters)
        figure = new_figure(column_in() if columns == 1 else page_in(), height)
        grid = panel_axes(figure, len(plans), columns)
        for axes, (site, summary), title, label in zip(grid, plans, titles, below, strict=True):
            bare_plan(site, axes, None, summary.condition)
            _draw_shares(axes, site, summary, room_in + 0.25)
            axes.set_title(title, pad=3)
            axes.text(0.5, -0.01, label, transform=axes.transAxes, ha="center", va="top", fontsize=6)
    conditions = [summary.condition for _, summary in plans]
    listed_starts = "; ".join(
        f"{shown(condition.name)}: {label}" for condition, label in zip(conditions, never, strict=True)
    )
    return Drawing(
        "success-map",
        "Success by starting position",
        f"Floor plans with the success rate at each starting position. No success from: {listed_starts}.",
        "The filled part of a disk is the success rate at that starting position.",
        footnotes(conditions),
        figure,
    )


def _draw_shares(axes: "Axes", site: Site, condition_summary: ConditionSummary, width_in: float) -> None:
    from matplotlib.patches import Circle, Wedge
    from matplotlib.patheffects import withStroke

    rates = {group.start: group for group in condition_summary.starts}
    places = _places(site, condition_summary)
    label = {number: f"{rates[number].successes}/{rates[number].episodes}" for number in places}
    label_xy = _label_positions(site, places, label, width_in)
    for number, (x, y) in places.items():
        summary = rates[number]
        axes.add_artist(Circle((x, y), _DISK_M, facecolor="white", edgecolor=INK, linewidth=0.7, zorder=12))
        if summary.successes:
            share = 360 * summary.success_rate
            axes.add_artist(Wedge((x, y), _DISK_M, 90 - share, 90, facecolor=SUCCESS, alpha=0.55, zorder=12.1))
        axes.text(x, y, str(number), ha="center", va="center_baseline", fontsize=6, weight="bold", zorder=13)
        axes.text(
            *(*label_xy[number], label[number]),
            ha="center",
            va="center",
            fontsize=_SHARE_PT,
            zorder=13,
            path_effects=[withStroke(linewidth=1.6, foreground="white")],  # readable over a wall
        )


def _label_positions(
    site: Site, places: Mapping[int, tuple[float, float]], label: Mapping[int, str], plan_in: float
) -> dict[int, tuple[float, float]]:
    """Return the centre of each position's label, metres: below its disk, or next to it where there is room."""
    walls = wall_area(site)
    x_min, _, x_max, _ = walls.bounds
    inch_m = (x_max - x_min + 0.3) / plan_in
    disks = {number: shapely.Point(place).buffer(_DISK_M) for number, place in places.items()}
    middles = {}
    for number, (x, y) in places.items():
        wide, high = letters_in(label[number], _SHARE_PT) * inch_m, _SHARE_PT / 72 * inch_m
        off_x, off_y = _DISK_M + 0.06 + wide / 2, _DISK_M + 0.04 + high / 2
        around = [(x, y - off_y), (x, y + off_y), (x + off_x, y), (x - off_x, y)]
        taken = shapely.union_all([walls, *(disk for other, disk in disks.items() if other != number)])
        middles[number] = next(
            (
                (mid_x, mid_y)
                for mid_x, mid_y in around
                if not taken.intersects(
                    shapely.box(mid_x - wide / 2, mid_y - high / 2, mid_x + wide / 2, mid_y + high / 2)
                )
            ),
            around[0],
        )
    return middles


def outcome(track: Track) -> str:
    """Return the outcome that determines how a track is drawn."""
    if track.success:
        return "success"
    if track.end_reason == EndReason.COLLISION.value:
        return "collision"
    return _LIMITS.get(track.end_reason, "STOP, too far")


def _draw_tracks(axes: "Axes", tracks: Sequence[Track]) -> None:
    """Draw the tracks of one outcome as one artist, for speed."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    starts = [track.points[0] for track in tracks]
    for name, (color, dashes, marker) in _OUTCOME_STYLES.items():
        mine = [track.points for track in tracks if outcome(track) == name]
        if not mine:
            continue
        style: dict[str, Any] = {"linestyles": [dashes], "linewidths": 0.7, "alpha": 0.75, "joinstyle": "round"}
        axes.add_collection(LineCollection(mine, colors=color, zorder=10, **style), autolim=False)
        ends = zip(*(points[-1] for points in mine), strict=True)
        axes.add_artist(
            Line2D(*ends, linestyle="", marker=marker, markersize=2.8, color=color, markeredgewidth=0, zorder=11)
        )
    axes.add_artist(Line2D(*zip(*starts, strict=True), linestyle="", marker="o", markersize=1.6, color=INK, zorder=11))


def _legend_samples(tracks: Sequence[Track], *, with_region: bool) -> "tuple[list[Line2D], list[str]]":
    """Return a sample line of each outcome of the tracks and its label."""
    from matplotlib.lines import Line2D

    present = {outcome(track) for track in tracks}
    styles = {name: style for name, style in _OUTCOME_STYLES.items() if name in present}
    samples = [
        Line2D([], [], color=color, linestyle=dashes, marker=marker, markersize=3, linewidth=0.9)
        for color, dashes, marker in styles.values()
    ]
    samples.append(Line2D([], [], color=INK, marker="o", markersize=2, linestyle="none"))
    labels = [*styles, "start"]
    if with_region:
        samples.append(success_outline([], []))
        labels.append("STOP succeeds within")
    return samples, labels


def bare_plan(site: Site, axes: "Axes", goal: str | None, condition: Condition) -> None:
    """Draw the plan; for a goal, outline where STOP succeeds under the recorded protocol."""
    rules = ProtocolParameters.from_record(condition.protocol) if goal and condition.protocol else None
    style = PlanStyle(
        starts=False,
        labels=False,
        room_names=False,
        scale_bar=False,
        legend=False,
        highlight=goal or "nothing",
        success=success_region(site, goal, rules) if goal and rules and targets_of(site, goal) else None,
    )
    draw_floor_plan(site, axes, style)


def plan_shape(site: Site) -> float:
    """Return the plan's height divided by its width."""
    x_min, y_min, x_max, y_max = bounds_of(site)
    return float((y_max - y_min + 0.3) / (x_max - x_min + 0.3))
