"""Figures have no clipped elements and no overlapping texts, even with long names."""

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.report.records import Attempt, Lab, step
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.report.figures.choose import MAX_TRAJECTORIES, drawings
from vsnbench.report.figures.style import COLUMN_IN, Drawing, column_in, column_of, new_figure, styled
from vsnbench.report.figures.text_layout import shown, width_in, wrapped
from vsnbench.values.movement import Action

GOALS = ("chair", "sofa", "bed", "toilet", "monitor", "plant", "table", "a goal with a name of some length")
LONG = "mylab.policies.semantic:FrontierPolicyWithAName"
WEIGHTS = "embedded demonstration weights, trained in simulated apartments, not the published model"
_ALLOWED_PX = 1.0


@dataclass(frozen=True)
class Words:
    """Position of a drawn text, pixels from the lower left."""

    text: str
    left: float
    bottom: float
    right: float
    top: float

    def over(self, other: "Words") -> bool:
        wide = min(self.right, other.right) - max(self.left, other.left)
        high = min(self.top, other.top) - max(self.bottom, other.bottom)
        return wide > _ALLOWED_PX and high > _ALLOWED_PX


def words_drawn(figure: Figure) -> list[Words]:
    """Return the texts that are drawn; matplotlib also keeps texts of invisible ticks."""
    drawn: list[Text] = []
    draw = Text.draw

    def draw_and_note(self: Text, renderer: object) -> None:
        drawn.append(self)
        draw(self, renderer)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw_and_note)
        figure.canvas.draw()
    boxes = {text: text.get_window_extent() for text in drawn if text.get_text() and text.get_visible()}
    return [Words(text.get_text(), box.x0, box.y0, box.x1, box.y1) for text, box in boxes.items()]


def faults(drawing: Drawing) -> Iterator[str]:
    """Yield texts that are clipped by the figure or overlap other texts."""
    figure = drawing.figure
    assert figure is not None
    with styled():
        words = words_drawn(figure)
        around = figure.get_tightbbox()
    wide, high = figure.get_size_inches()
    if min(around.x0, around.y0, wide - around.x1, high - around.y1) < -_ALLOWED_PX / figure.dpi:
        yield f"{drawing.name}: something is drawn outside {wide:.2f} x {high:.2f} inches: {around.extents}"
    for one in words:
        if min(one.left, one.bottom, wide * figure.dpi - one.right, high * figure.dpi - one.top) < -_ALLOWED_PX:
            yield f"{drawing.name}: {one.text!r} is cut off"
    for one, other in itertools.combinations(words, 2):
        if one.over(other):
            yield f"{drawing.name}: {one.text!r} lies over {other.text!r}"


def drawn(lab: Lab) -> list[Drawing]:
    return drawings(build(lab.url, Selection(), reference=True), lab.url)


def some_attempts(luck: random.Random, goals: tuple[str, ...]) -> list[Attempt]:
    actions = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)
    attempts = []
    for goal, start in itertools.product(goals, range(1, 16)):
        end = luck.choice([EndReason.STOP, EndReason.STOP, EndReason.COLLISION, EndReason.STEP_LIMIT])
        steps = [
            step(number, luck.choice(actions), "LOOK_DOWN" if number == 5 else "", x_m=number / 10, blocked=number == 3)
            for number in range(1, 8)
        ]
        success = end is EndReason.STOP and luck.random() < 0.6
        attempts.append(
            Attempt(goal, start, success=success, end_reason=end, actions=luck.randint(5, 150), steps=steps)
        )
    return attempts


@pytest.mark.parametrize("models", [1, 2, 10])
def test_nothing_is_cut_off_and_no_words_lie_over_others(tmp_path: Path, models: int) -> None:
    lab, luck = Lab(tmp_path), random.Random(models)
    for number in range(models):
        bound = number == 0 and models > 1
        lab.write(
            some_attempts(luck, GOALS if models < 4 else GOALS[:2]),
            model="oracle" if bound else f"{LONG}{number}",
            weights_label=WEIGHTS,
            surveyed=bound,
            simulated=number % 2 == 0,
        )
    figures = drawn(lab)
    assert {each.name for each in figures} >= {
        *("success-by-goal", "outcomes-over-actions", "actions", "success-map", "success-by-cell"),
        *("trajectories-1", "mileage"),
        *(["differences"] if models > 4 else []),
    }
    assert [fault for figure in figures for fault in faults(figure)] == []


def test_the_check_sees_what_is_cut_and_what_lies_over_other_words() -> None:
    with styled():
        figure = new_figure(2, 1)
        figure.set_layout_engine("none")
        figure.text(0.1, 0.5, "some words")
        figure.text(0.12, 0.5, "other words")
        figure.text(0.5, 0.9, "far too long to fit in here at all")
    found = list(faults(Drawing("bad", "", "", "", (), figure)))
    assert any("drawn outside 2.00 x 1.00 inches" in fault for fault in found)
    assert "bad: 'far too long to fit in here at all' is cut off" in found
    assert "bad: 'some words' lies over 'other words'" in found


def test_every_condition_is_in_some_figure_and_what_is_left_out_is_said(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    names = [f"model{number:02}" for number in range(MAX_TRAJECTORIES + 4)]
    for name in names:
        lab.write([Attempt(steps=[step(1, Action.STOP)]), Attempt(start=2, success=False)], model=name)
    figures = {each.name: each for each in drawn(lab)}
    assert "success-by-goal-2" in figures
    for kind in ("success-by-goal", "outcomes-over-actions", "success-map", "actions"):
        pages = " ".join(each.alt for name, each in figures.items() if name.startswith(kind))
        assert [name for name in names if name not in pages] == []
    left_out = ", ".join(names[MAX_TRAJECTORIES:])
    words = f"Drawn for {MAX_TRAJECTORIES} of {len(names)} conditions; not drawn: {left_out}"
    assert words in figures["trajectories-1"].caption


def test_success_and_failure_end_at_their_shares_of_all_episodes(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    ends = [(True, 10), (True, 40), (False, 5), (False, 60)]
    lab.write([Attempt(start=start, success=ok, actions=actions) for start, (ok, actions) in enumerate(ends, 1)])
    figure = next(each for each in drawn(lab) if each.name == "outcomes-over-actions").figure
    assert figure is not None
    succeeded, failed = (axes.lines[0].get_xydata().tolist() for axes in figure.axes)  # type: ignore[union-attr]
    assert succeeded == [[0, 0], [10, 25], [40, 50], [150, 50]]
    assert failed == [[0, 0], [5, 25], [60, 50], [150, 50]]


def test_success_and_failure_are_drawn_of_shared_goals_and_never_of_unlike_limits(tmp_path: Path) -> None:
    lab, starts = Lab(tmp_path), range(1, 16)
    lab.write([Attempt(goal, start) for goal in ("chair", "bed") for start in starts], model="wide")
    lab.write([Attempt("chair", start, success=False) for start in starts], model="narrow")
    lab.write([Attempt(start=start) for start in starts], model="long", protocol=ProtocolParameters(max_actions=250))
    shared, long = (each for each in drawn(lab) if each.name.startswith("outcomes-over-actions"))
    assert "wide: 15 of 15 succeeded" in shared.alt
    assert "narrow: 0 of 15 succeeded" in shared.alt
    assert "on chair: " in shared.caption
    assert "the limit of 150 actions" in shared.caption
    assert "long" not in shared.alt
    assert long.figure is not None
    assert long.figure.axes[0].lines[0].get_xydata().tolist()[-1] == [250, 100]  # type: ignore[union-attr]


def test_a_caption_says_what_the_names_stand_for(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt(steps=[step(1, Action.STOP)])], weights_label=WEIGHTS)
    figures = drawn(lab)
    assert all(WEIGHTS in each.footnotes[0] for each in figures if each.name != "mileage")
    assert not any(WEIGHTS in each.svg().decode() for each in figures)


def test_words_are_wrapped_to_the_room_they_have() -> None:
    with styled():
        text = f"{LONG} under a setting of its own"
        lines = wrapped(text, COLUMN_IN / 2, 6.5).split("\n")
        assert len(lines) > 1
        assert max(width_in(line, 6.5) for line in lines) <= COLUMN_IN / 2
        assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert shown("a" * 100 + "z" * 100, 21) == "a" * 10 + "…" + "z" * 10


def test_a_figure_has_the_width_of_a_given_column_and_text_of_8_points_in_every_format() -> None:
    with column_of(8.8 / 2.54), styled():
        figure = new_figure(column_in(), 1.0)
        label = figure.subplots().set_xlabel("actions")
        drawing = Drawing("column", "", "", "", (), figure)
    svg, pdf = drawing.svg(), drawing.pdf()
    assert b'width="249.448819pt"' in svg
    assert b"MediaBox [ 0 0 249.4488" in pdf
    assert (drawing.width_in, label.get_fontsize()) == pytest.approx((8.8 / 2.54, 8))
    assert not drawing.is_wide
    assert column_in() == COLUMN_IN
