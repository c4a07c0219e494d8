"""The layout of an episode in the viewer."""

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from vsnbench.results.files.episode_entries import EpisodeHeader
from vsnbench.viewer.rerun_internals import convert_blueprint, send_blueprint
from vsnbench.viewer.static_entities import StaticEntities, cached_entities

TIMELINE = "step"
FLOOR_MARGIN_M = 0.35


def episode_blueprint(header: EpisodeHeader, *, with_scores: bool) -> rrb.Blueprint:
    """Return the layout of one episode.

    Args:
        header: the episode; the floor plan fits its site.
        with_scores: whether to plot scores of the policy.
    """
    from rerun.blueprint import encodings

    whole_episode = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
    )
    images: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin="status", name="Now"),
        rrb.Spatial2DView(origin="camera/rgb", name="RGB"),
        rrb.Spatial2DView(origin="camera/depth", name="Depth"),
    ]
    if header.cameras:
        further = [rrb.Spatial2DView(origin=f"camera_{role}/rgb", name=role.capitalize()) for role in header.cameras]
        images.insert(2, rrb.Horizontal(*further))
    # A curve that falls towards the goal leaves this corner free.
    legend = rrb.PlotLegend(corner="righttop")
    middle = rrb.Vertical(
        _floor_plan(header),
        rrb.StateTimelineView(origin="actions", name="Actions"),
        rrb.TimeSeriesView(
            origin="distance", name="Distance to the goal (m)", plot_legend=legend, time_ranges=[whole_episode]
        ),
        row_shares=[9, 2, 3],
    )
    documents: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin="verdict", name="Verdict"),
        rrb.TextDocumentView(origin="decision/text", name="Decision"),
    ]
    if with_scores:
        documents.append(
            rrb.TimeSeriesView(origin="decision/scores", name="Scores", plot_legend=legend, time_ranges=[whole_episode])
        )
    columns = rrb.TextLogColumns(
        timeline_columns=[encodings.TimelineColumn(timeline=TIMELINE, visible=True)],
        text_log_columns=[encodings.TextLogColumn(kind="body", visible=True)],
    )
    documents.append(rrb.TextLogView(origin="events", name="Events", columns=columns))
    texts = rrb.Vertical(*documents, row_shares=[6, 4, 3, 2] if with_scores else [6, 5, 3])
    seen = rrb.Vertical(*images, row_shares=[2, 6, 3, 5] if header.cameras else [2, 6, 5])
    return _blueprint(rrb.Horizontal(seen, middle, texts, column_shares=[5, 7, 5]))


def _blueprint(views: rrb.Container) -> rrb.Blueprint:
    """Return a layout that shows these views, without the panels of the viewer."""
    return rrb.Blueprint(
        views,
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _floor_plan(header: EpisodeHeader, prefix: str = "") -> rrb.View:
    """Return the view of the plan, with the path until the cursor of the timeline."""
    until_now = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    x_m = [x for room in header.site.rooms for x, _ in room.polygon]
    y_m = [y for room in header.site.rooms for _, y in room.polygon]
    return rrb.Spatial2DView(
        origin="/",
        contents=f"{prefix}plan/**",
        name="Floor plan",
        visual_bounds=rrb.VisualBounds2D(
            x_range=(min(x_m) - FLOOR_MARGIN_M, max(x_m) + FLOOR_MARGIN_M),
            y_range=(-max(y_m) - FLOOR_MARGIN_M, -min(y_m) + FLOOR_MARGIN_M),
        ),
        background=[250, 250, 248],
        overrides={f"{prefix}plan/trajectory": rrb.VisibleTimeRanges([until_now])},
    )


def pair_blueprint(headers: Sequence[EpisodeHeader], sides: Sequence[str]) -> rrb.Blueprint:
    """Return the layout of several episodes side by side on one timeline.

    Args:
        headers: the episodes.
        sides: prefix of the entities of each.
    """
    columns = [
        rrb.Vertical(
            rrb.TextDocumentView(origin=f"{side}/status", name=f"#{header.episode_id} {header.model}"),
            rrb.Spatial2DView(origin=f"{side}/camera/rgb", name="RGB"),
            _floor_plan(header, f"{side}/"),
            rrb.StateTimelineView(origin=f"{side}/actions", name="Actions"),
            rrb.TextDocumentView(origin=f"{side}/verdict", name="Verdict"),
            row_shares=[3, 8, 7, 3, 4],
        )
        for header, side in zip(headers, sides, strict=True)
    ]
    return _blueprint(rrb.Horizontal(*columns))


def send_layout(recording: rr.RecordingStream, header: EpisodeHeader, *, with_scores: bool) -> None:
    """Send an episode's layout to its recording. Arguments as for `episode_blueprint`."""

    def draw(layout: StaticEntities) -> None:
        convert_blueprint(episode_blueprint(header, with_scores=with_scores), layout)

    send_blueprint(recording, cached_entities(("layout", header.site.sha256, with_scores), draw))
