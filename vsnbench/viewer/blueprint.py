"""How the viewer lays an episode out, so that nobody has to click."""

from typing import TYPE_CHECKING

from vsnbench.record.entries import EpisodeHeader
from vsnbench.viewer.still_entities import StillEntities, still_entities

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

TIMELINE = "step"
FLOOR_MARGIN_M = 0.35


def episode_blueprint(header: EpisodeHeader, *, with_scores: bool) -> "rrb.Blueprint":
    """Return the layout of one episode.

    Args:
        header: the episode; the floor plan is framed to its site.
        with_scores: whether the policy gave numbers worth a plot of their own.
    """
    import rerun.blueprint as rrb
    from rerun.blueprint import encodings

    x_m = [x for room in header.site.rooms for x, _ in room.polygon]
    y_m = [y for room in header.site.rooms for _, y in room.polygon]
    bounds = rrb.VisualBounds2D(
        x_range=(min(x_m) - FLOOR_MARGIN_M, max(x_m) + FLOOR_MARGIN_M),
        y_range=(-max(y_m) - FLOOR_MARGIN_M, -min(y_m) + FLOOR_MARGIN_M),
    )
    whole_episode = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
    )
    so_far = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    seen = rrb.Vertical(
        rrb.TextDocumentView(origin="status", name="Now"),
        rrb.Spatial2DView(origin="camera/rgb", name="RGB"),
        rrb.Spatial2DView(origin="camera/depth", name="Depth"),
        row_shares=[2, 6, 5],
    )
    plan = rrb.Spatial2DView(
        origin="/",
        contents="plan/**",
        name="Floor plan",
        visual_bounds=bounds,
        background=[250, 250, 248],
        overrides={"plan/trajectory": [rrb.VisibleTimeRanges([so_far])]},
    )
    # The free corner of a curve that falls towards the goal.
    legend = rrb.PlotLegend(corner="righttop")
    middle = rrb.Vertical(
        plan,
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
    return rrb.Blueprint(
        rrb.Horizontal(seen, middle, texts, column_shares=[5, 7, 5]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def send_layout(recording: "rr.RecordingStream", header: EpisodeHeader, *, with_scores: bool) -> None:
    """Send an episode's layout into its recording and let go of it; arguments as for `episode_blueprint`.

    Rerun's own `send_blueprint` passes the layout through a stream in memory that it never disconnects: two threads
    and a megabyte for each call, for as long as the process lives.
    """
    import rerun as rr
    import rerun_bindings as bindings

    def draw(layout: StillEntities) -> None:
        episode_blueprint(header, with_scores=with_scores)._log_to_stream(layout)  # noqa: SLF001

    stream = rr.RecordingStream._from_native(  # noqa: SLF001 - there is no public way to disconnect it
        bindings.new_blueprint(
            application_id=recording.get_application_id() or "",
            make_default=False,
            make_thread_default=False,
            default_enabled=True,
        )
    )
    stream.set_time("blueprint", sequence=0)
    still_entities(("layout", header.site.sha256, with_scores), draw).send(stream)
    in_memory = stream.memory_recording()
    bindings.send_blueprint(in_memory.storage, True, True, recording=recording.to_native())
    stream.disconnect()
