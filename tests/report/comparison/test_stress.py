"""Losses in a stress test, against hand-computed numbers."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.protocol.disturbances import Disturbance, parse_disturbances
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.compare import compare
from vsnbench.report.comparison.stress import LostTrial, StressedCampaigns, StressedModel, stressed_model
from vsnbench.report.figures.severity import success_by_severity
from vsnbench.report.tables.stress import STRESSED, stress_table
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.multiple import holm

STARTS = range(1, 16)
LOST_BY_BLUR = {3: {1}, 5: set(range(1, 13))}
"""Starting positions whose only success is lost, by severity."""
UNSUCCESSFUL = {14, 15}


def write(lab: Lab, text: str, succeeds: Callable[[int], bool], actions: int = 10) -> None:
    conditions = parse_disturbances([text] if text else []).conditions
    attempts = [Attempt(start=start, success=succeeds(start), actions=actions) for start in STARTS]
    lab.write(attempts, conditions=conditions)


@pytest.fixture(scope="module")
def stressed(tmp_path_factory: pytest.TempPathFactory) -> StressedModel:
    lab = Lab(tmp_path_factory.mktemp("stressed"))
    write(lab, "", lambda start: start not in UNSUCCESSFUL)
    write(lab, "blur@3", lambda start: start not in UNSUCCESSFUL | LOST_BY_BLUR[3])
    write(lab, "blur@5", lambda start: start not in UNSUCCESSFUL | LOST_BY_BLUR[5], actions=150)
    write(lab, "glare@3", lambda start: start not in UNSUCCESSFUL)
    write(lab, "glare@5", lambda start: start != 15)
    return stressed_in(lab)


def stressed_in(lab: Lab) -> StressedModel:
    record = read(lab.url, Selection())
    numbers = {text: (number,) for number, text in enumerate(("", "blur@3", "blur@5", "glare@3", "glare@5"), start=1)}
    disturbed = {parse_disturbances([text]).members[0]: own for text, own in numbers.items() if text}
    campaigns = StressedCampaigns(numbers[""], disturbed, ("depth_holes",))
    found = stressed_model(record, summarise(record), campaigns)
    assert found is not None
    return found


def test_the_loss_is_undisturbed_minus_disturbed(stressed: StressedModel) -> None:
    losses = {(loss.disturbance.name, loss.disturbance.severity): loss for loss in stressed.losses}
    assert [losses["blur", severity].rate.difference for severity in (3, 5)] == pytest.approx([1 / 15, 12 / 15])
    assert [losses["glare", severity].rate.difference for severity in (3, 5)] == pytest.approx([0, -1 / 15])
    assert [losses["blur", severity].changed for severity in (3, 5)] == [1, 15]
    assert losses["glare", 3].changed == 0
    assert losses["blur", 5].rate.conclusion is Conclusion.FIRST_BETTER
    assert losses["blur", 3].rate.conclusion is Conclusion.NOT_SHOWN


def test_p_values_are_corrected_for_all_conditions_of_the_model(stressed: StressedModel) -> None:
    adjusted = [loss.rate.adjusted_p for loss in stressed.losses]
    assert adjusted == list(holm([loss.rate.p for loss in stressed.losses]))
    assert {loss.rate.questions for loss in stressed.losses} == {4}, "the intervals hold together as well"
    assert min(adjusted) == pytest.approx(4 * 2 / 2**12), "an exact test of 12 losses, times four conditions"


def test_the_most_harmful_has_the_largest_mean_loss_and_examples(stressed: StressedModel) -> None:
    (harm,) = stressed.most_harmful
    assert (harm.name, harm.mean_loss) == ("blur", pytest.approx(13 / 30))
    assert harm.examples == (LostTrial("chair", 1, 1, 16),)
    by_severity = {loss.disturbance: len(loss.lost) for loss in stressed.losses}
    assert by_severity[Disturbance("blur", 10.0)] == 12


def test_the_interval_and_test_are_those_of_compare(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    write(lab, "", lambda start: start not in UNSUCCESSFUL)
    write(lab, "blur@5", lambda start: start > 6)
    record = read(lab.url, Selection())
    results = summarise(record)
    assert [summary.condition.name for summary in results.conditions] == ["vlv undisturbed", "vlv with blur=10"]
    (comparison,) = compare(record, results, ["vlv undisturbed", "vlv with blur=10"])
    (rate,) = comparison.rates
    campaigns = StressedCampaigns((1,), {Disturbance("blur", 10.0): (2,)})
    found = stressed_model(record, results, campaigns)
    assert found is not None
    (loss,) = found.losses
    assert (loss.rate.interval, loss.rate.p, loss.rate.test) == (rate.interval, rate.p, rate.test)


def test_the_table_and_json_state_the_same_numbers(stressed: StressedModel) -> None:
    table = stress_table(stressed)
    assert [[cell.text for cell in row.cells][:4] for row in table.rows][:3] == [
        ["undisturbed", "–", "", "13/15"],
        ["blur", "3", "4 px", "12/15"],
        ["blur", "5", "10 px", "1/15"],
    ]
    assert table.notes[0] == "A loss of success is shown, by interval and Holm p: blur@5."
    assert [cell.text for cell in table.rows[-1].cells][:4] == ["depth_holes", "–", "", "not seen"]
    assert any(note.startswith("Not seen: depth_holes.") for note in table.notes)
    fields = STRESSED.fields(stressed)
    assert fields["unseen"] == ["depth_holes"]
    assert [row["successes"] for row in fields["disturbances"]] == [12, 1, 13, 14]
    assert [row["loss"] for row in fields["disturbances"]] == pytest.approx([1 / 15, 12 / 15, 0, -1 / 15])
    assert fields["undisturbed"]["successes"] == 13
    assert fields["most_harmful"][0]["examples"] == [{"goal": "chair", "start": 1, "undisturbed": 1, "disturbed": 16}]


def test_the_figure_has_a_panel_per_disturbance_and_the_rates(stressed: StressedModel) -> None:
    drawing = success_by_severity([stressed])
    assert drawing.figure is not None
    panels = [axes for axes in drawing.figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in panels] == ["blur: 4, 10 px", "glare: 0.6, 1"]
    line = panels[0].lines[0]
    assert list(line.get_xdata()) == [0, 3, 5]
    assert list(line.get_ydata()) == pytest.approx([100 * 13 / 15, 80, 100 / 15])
    assert drawing.svg().startswith(b"<?xml")


def test_the_figure_marks_what_a_model_does_not_see_and_what_changed_no_trial(stressed: StressedModel) -> None:
    untouched = replace(stressed, losses=tuple(replace(loss, changed=0) for loss in stressed.losses))
    blind = replace(stressed, losses=stressed.losses[:2], unseen=("glare",))
    drawing = success_by_severity([untouched, blind])
    assert drawing.figure is not None
    panels = [axes for axes in drawing.figure.axes if axes.get_visible()]
    assert [[text.get_text() for text in axes.texts] for axes in panels] == [
        ["no trial changed: vlv"],
        ["not seen by vlv\nno trial changed: vlv"],
    ]
    assert "does not use what they change: vlv: depth_holes; vlv: glare." in drawing.caption


def test_a_stress_test_without_undisturbed_results_has_no_losses(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    write(lab, "blur@5", lambda _start: True)
    record = read(lab.url, Selection())
    campaigns = StressedCampaigns((7,), {Disturbance("blur", 10.0): (1,)})
    assert stressed_model(record, summarise(record), campaigns) is None
