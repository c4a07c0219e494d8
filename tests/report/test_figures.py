"""Figures: drawn from counted episodes, reproducible, with exact names and readable rare actions."""

import io
import multiprocessing
import os
import re
import signal

import PIL.Image
import pytest
import shapely

from tests.report.records import Attempt, Lab, step, void
from vsnbench.errors import VsnbenchError
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.published import PAPER_INTERVALS
from vsnbench.report.build import Report, build
from vsnbench.report.figures import choose
from vsnbench.report.figures.actions import _names
from vsnbench.report.figures.choose import MAX_TRAJECTORIES, build_and_draw, drawings
from vsnbench.report.figures.plans import outcome, read_tracks
from vsnbench.report.figures.style import DOTS_AN_INCH, Drawing
from vsnbench.report.tables.activity import ROBOTS
from vsnbench.values.movement import Action

COMMENT = re.compile(r"<!-- (.*?) -->")


def drawn(lab: Lab) -> tuple[Report, dict[str, Drawing]]:
    report = build(lab.url, Selection(), reference=True)
    return report, {drawing.name: drawing for drawing in drawings(report, lab.url)}


def texts(drawing: Drawing) -> list[str]:
    """Return the texts of a figure; matplotlib writes each as a comment next to its outlines."""
    return COMMENT.findall(drawing.svg().decode())


def test_a_rare_stop_is_counted_and_given_its_share(lab: Lab) -> None:
    steps = [step(number, Action.MOVE_FORWARD) for number in range(1, 500)]
    steps += [step(500, Action.MOVE_FORWARD, "LOOK_DOWN", blocked=True), step(501, Action.STOP)]
    lab.write([Attempt(steps=steps), void(start=2)])
    report, figures = drawn(lab)
    assert report.activity is not None
    assert sum(each["steps"] for each in report.activity.actions) == 501
    words = texts(figures["actions"])
    assert "1 (0.2 %)" in words
    assert {"STOP", "MOVE_FORWARD", "LOOK_DOWN", "blocked"} <= set(words)
    assert "STOP 1 (0.2 %)" in figures["actions"].alt


def test_void_attempts_are_in_no_histogram_but_on_the_odometer(lab: Lab) -> None:
    lab.write([void(), Attempt(steps=[step(1, Action.STOP)], path_m=500.0, duration_s=1800.0)])
    report, figures = drawn(lab)
    assert report.activity is not None
    (robot,) = report.activity.robots
    assert (robot["episodes"], robot["failures"]) == (2, 1)
    assert robot["path_m"] == pytest.approx(502)
    assert ROBOTS.fields(robot)["failures_per_km"] == pytest.approx(1 / 0.502)
    assert "0.50 km in 0.51 h" in figures["mileage"].alt


def test_tracks_begin_at_the_start_and_follow_the_site_or_else_the_odometry(lab: Lab) -> None:
    from dataclasses import replace

    lost = [replace(step(number, Action.MOVE_FORWARD, x_m=0.25 * number), world=None) for number in (1, 2)]
    lab.write([Attempt(start=1, steps=[step(1, Action.MOVE_FORWARD, x_m=0.25)]), Attempt(start=2, steps=lost)])
    report, _ = drawn(lab)
    first, second = read_tracks(lab.engine(), report.record, report.record.conditions[0])
    assert first.points == ((1.0, 1.0), (1.25, 1.0))
    assert second.points == ((1.0, 1.0), (1.25, 1.0), (1.5, 1.0))


def test_many_tracks_are_thinned_evenly(lab: Lab) -> None:
    lab.write([Attempt(start=s, repetition=r, steps=[step(1, Action.STOP)]) for r in (1, 2) for s in range(1, 16)])
    report, _ = drawn(lab)
    tracks = read_tracks(lab.engine(), report.record, report.record.conditions[0], max_per_goal=10)
    assert [track.start for track in tracks] == [1, 4, 7, 10, 13, 1, 4, 7, 10, 13]


def test_outcomes_are_told_apart(lab: Lab) -> None:
    ends = [
        (True, EndReason.STOP, "success"),
        (False, EndReason.STOP, "STOP, too far"),
        (False, EndReason.COLLISION, "collision"),
        (False, EndReason.STEP_LIMIT, "step limit"),
    ]
    lab.write(
        [
            Attempt(start=start, success=success, end_reason=reason, steps=[step(1, Action.STOP)])
            for start, (success, reason, _) in enumerate(ends, start=1)
        ]
    )
    report, figures = drawn(lab)
    tracks = read_tracks(lab.engine(), report.record, report.record.conditions[0])
    assert [outcome(track) for track in tracks] == [name for _, _, name in ends]
    assert {"start 1 1/1", "start 3 0/1", "success", "collision"} <= set(texts(figures["trajectories-1"]))
    assert "no success from: 2, 3, 4" in texts(figures["success-map"])


def test_a_name_is_drawn_as_it_is_written(lab: Lab) -> None:
    lab.write([Attempt()], model="$\\frac{1}$ & <b>")
    _, figures = drawn(lab)
    words = " ".join(texts(figures["outcomes-over-actions"]))
    assert r"$\frac{1}$" in words, words


def test_the_same_record_gives_the_same_bytes(lab: Lab) -> None:
    lab.write([Attempt(steps=[step(1, Action.STOP)])])
    _, first = drawn(lab)
    _, second = drawn(lab)
    assert {name: one.svg() for name, one in first.items()} == {name: one.svg() for name, one in second.items()}
    assert all(one.png().startswith(b"\x89PNG") and one.pdf().startswith(b"%PDF") for one in first.values())


def test_png_keeps_its_resolution_after_the_vector_forms(lab: Lab) -> None:
    lab.write([Attempt(steps=[step(1, Action.STOP)])])
    _, figures = drawn(lab)
    for one in figures.values():
        one.svg(), one.pdf()
        width_px, _ = PIL.Image.open(io.BytesIO(one.png())).size
        assert width_px == pytest.approx(one.width_in * DOTS_AN_INCH, abs=1)


def test_a_campaign_without_results_still_draws(lab: Lab) -> None:
    lab.write([void()])
    report, figures = drawn(lab)
    assert set(figures) == {"success-by-goal", "mileage"}
    assert "no completed trial" in figures["success-by-goal"].alt
    assert report.tables(long=True)


def test_figures_drawn_in_two_processes_are_the_same_and_complete(lab: Lab) -> None:
    for model in ("vlv", "oracle", "random", "pirlnav", "a", "b", "c"):
        lab.write([Attempt(steps=[step(1, Action.STOP)]), Attempt(start=2, success=False)], model=model)
    report, in_process = build_and_draw(lab.url, Selection())
    here = list(drawings(report, lab.url))
    assert [drawing.name for drawing in in_process] == [drawing.name for drawing in here]
    assert [drawing.name for drawing in here][:3] == ["success-by-goal", "success-by-cell", "success-by-cell-2"]
    assert sum(drawing.name.startswith("trajectories") for drawing in here) == 7 < MAX_TRAJECTORIES
    for one, other in zip(in_process, here, strict=True):
        assert one.figure is None, "no figure remains to be drawn"
        assert (one.svg(), one.pdf(), one.png()) == (other.svg(), other.pdf(), other.png())
        assert one.width_in == other.width_in > 0


def test_counts_on_a_success_map_keep_off_walls_and_other_disks(lab: Lab) -> None:
    lab.write([Attempt(start=start.number) for start in lab.site.starts])
    _, figures = drawn(lab)
    figure = figures["success-map"].figure
    assert figure is not None
    figure.canvas.draw()
    (axes,) = figure.axes
    counts = [text for text in axes.texts if "/" in text.get_text()]
    assert len(counts) == len(lab.site.starts)
    walls = shapely.union_all([wall.shape for wall in lab.site.walls])
    places = shapely.MultiPoint([start.position for start in lab.site.starts])
    for text in counts:
        box = shapely.box(*text.get_window_extent().transformed(axes.transData.inverted()).extents).buffer(-0.02)
        assert not box.intersects(walls), text.get_text()
        assert box.distance(places) > 0.2


def test_trajectories_and_cells_say_what_their_marks_are(lab: Lab) -> None:
    lab.write([Attempt(start=1, steps=[step(1, Action.STOP)]), Attempt(start=2, success=False)])
    _, figures = drawn(lab)
    assert "STOP succeeds within" in texts(figures["trajectories-1"])
    assert "half of them" in texts(figures["success-by-cell"])


def test_trajectories_of_a_weak_model_have_a_plan_per_start_and_of_others_one_per_goal(lab: Lab) -> None:
    for model, successes in (("weak", 1), ("even", 2)):
        lab.write(
            [
                Attempt(goal, start, success=start <= successes, steps=[step(1, Action.STOP)])
                for goal in ("chair", "bed")
                for start in range(1, 5)
            ],
            model=model,
        )
    _, figures = drawn(lab)
    weak, even = figures["trajectories-1"], figures["trajectories-2"]
    assert [text for text in texts(weak) if text.startswith("start ")] == [
        *("start 1 2/2", "start 2 0/2", "start 3 0/2", "start 4 0/2"),
    ]
    assert "STOP succeeds within" not in texts(weak), "the goals differ"
    assert {"bed 2/4", "chair 2/4"} <= set(texts(even))


def test_a_figure_names_the_interval_that_it_draws(lab: Lab) -> None:
    lab.write([Attempt(goal, 1, success=True) for goal in ("bed", "chair")])
    _, figures = drawn(lab)
    figure = figures["success-by-goal"]
    assert "success rate (%), 95 % interval" in texts(figure)
    assert "effective sample size" in figure.caption
    assert PAPER_INTERVALS in figure.caption


def test_actions_of_robots_come_before_the_model_s_own() -> None:
    used = [("LOOK_UP", "MOVE_BACKWARD"), ("LOOK_DOWN", "MOVE_FORWARD"), ("ZOOM", "NOOP"), ("STOP", "STOP")]
    counts = [{"raw_action": raw, "action": action, "blocked": False} for raw, action in used]
    assert _names(counts) == ["STOP", "MOVE_FORWARD", "MOVE_BACKWARD", "NOOP", "LOOK_DOWN", "LOOK_UP", "ZOOM"]


def test_a_killed_worker_is_an_error_of_its_own(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    def kill_worker(*_: object) -> tuple[()]:
        for worker in multiprocessing.active_children():
            os.kill(worker.pid or 0, signal.SIGKILL)
        return ()

    lab.write([Attempt(steps=[step(1, Action.STOP)])])
    monkeypatch.setattr(choose, "_charts", kill_worker)
    with pytest.raises(VsnbenchError) as killed:
        build_and_draw(lab.url, Selection())
    assert killed.value.code == "drawing-killed"
