"""The question of a report, answered for comparable models as far as trials allow."""

from tests.report.records import Attempt, Lab
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.report.comparison.question import ModelQuestion
from vsnbench.report.figures.choose import drawings
from vsnbench.report.tables.question import question_tables
from vsnbench.results.writing.campaigns import Trial

STARTS = range(1, 16)


def succeed(lab: Lab, model: str, successes: int, **facts: object) -> None:
    """Write fifteen attempts, of which the first ones succeed."""
    lab.write([Attempt(start=s, success=s <= successes) for s in STARTS], model=model, **facts)  # type: ignore[arg-type]


def asked(lab: Lab) -> tuple[ModelQuestion, ...]:
    return build(lab.url, Selection()).questions


def test_of_two_models_the_better_is_named_with_its_numbers(lab: Lab) -> None:
    succeed(lab, "good", 15)
    succeed(lab, "bad", 1)
    (question,) = asked(lab)
    (answer,) = question.answers
    assert "good succeeds more often than bad: 15/15 against 1/15" in answer
    assert question.where.endswith("simulated, in apartment")


def test_of_several_that_share_the_highest_rate_none_leads(lab: Lab) -> None:
    for model, successes in (("one", 14), ("two", 14), ("bad", 1)):
        succeed(lab, model, successes)
    (answer,) = asked(lab)[0].answers
    assert answer.startswith("On chair: one and two have the highest success rate, 93.3 % [")
    assert "; one succeeds more often than bad (6.7 %); " in answer
    assert "no difference from two (93.3 %) was shown" in answer


def test_of_several_the_best_is_named_with_those_it_cannot_be_told_from(lab: Lab) -> None:
    for model, successes in (("good", 15), ("nearly", 14), ("bad", 1), ("worst", 0)):
        succeed(lab, model, successes)
    (question,) = asked(lab)
    (answer,) = question.answers
    assert answer.startswith("On chair: good has the highest success rate, 100.0 % [")
    assert "it succeeds more often than bad (6.7 %) and worst (0.0 %)" in answer
    assert "no difference from nearly (93.3 %) was shown" in answer
    assert "Holm-corrected for 6 comparisons" in answer
    ranking, pairs = question_tables([question])
    assert (ranking.name, pairs.name, len(pairs.rows)) == ("ranking-1", "pairs-1", 6)


def test_upper_bounds_and_small_samples_are_no_members(lab: Lab) -> None:
    succeed(lab, "a", 10)
    succeed(lab, "b", 5)
    succeed(lab, "oracle", 15, surveyed=True)
    lab.write([Attempt(start=s) for s in (1, 2, 3)], model="few")
    planned = [Trial("chair", start, repetition) for repetition in (1, 2) for start in STARTS]
    lab.write([Attempt(start=s) for s in STARTS], model="unfinished", trials=planned)
    (question,) = asked(lab)
    assert [one.condition.name for one in question.members] == ["a", "b"]
    assert [each.partition(":")[0] for each in question.not_compared] == ["few", "unfinished"]
    assert not any("oracle" in each for each in question.not_compared)


def test_a_person_is_shown_for_reference_and_is_no_member(lab: Lab) -> None:
    succeed(lab, "a", 10)
    succeed(lab, "b", 5)
    succeed(lab, "human", 15, settings={"driver": "ada"})
    (question,) = asked(lab)
    assert [one.condition.name for one in question.members] == ["a", "b"]
    assert not any("human" in text for text in (*question.answers, *question.not_compared))


def test_models_in_other_circumstances_are_another_question(lab: Lab) -> None:
    for simulated in (True, False):
        succeed(lab, "a", 10, simulated=simulated)
        succeed(lab, "b", 5, simulated=simulated)
    succeed(lab, "c", 5, robot="lola2")
    real, simulated_ones = asked(lab)
    assert [one.condition.name for one in real.members] == ["a real", "b real"]
    assert [one.condition.name for one in simulated_ones.members] == ["a simulated", "b simulated"]


def test_one_model_alone_is_no_question(lab: Lab) -> None:
    succeed(lab, "a", 10)
    assert asked(lab) == ()


def test_the_figure_names_the_better_first_and_says_whom_it_tells_apart(lab: Lab) -> None:
    succeed(lab, "bad", 1)
    succeed(lab, "good", 15)
    succeed(lab, "nearly", 14)
    report = build(lab.url, Selection())
    figure = drawings(report, lab.url)[0]
    assert figure.name == "differences"
    assert figure.figure is not None
    labels = [text.get_text() for text in figure.figure.axes[0].get_yticklabels()]
    assert labels == ["good − bad", "nearly − bad", "good − nearly"]
    assert "good minus bad: +93.3" in figure.alt
    assert figure.alt.count(", different") == 2
    assert figure.alt.count(", no difference shown") == 1
