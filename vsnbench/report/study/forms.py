"""A study's report as Markdown, LaTeX, HTML or JSON; the conclusion comes first."""

import json
from dataclasses import replace

from markupsafe import Markup

from vsnbench import __version__
from vsnbench.report.formats import latex, markdown
from vsnbench.report.formats.html import page_environment, page_part
from vsnbench.report.measures import (
    COUNT,
    COUNTS,
    FLAG,
    NUMBER,
    NUMBERS,
    TEXT,
    Measure,
    Measures,
    an_object,
    objects,
    values,
)
from vsnbench.report.study.findings import StudyFindings
from vsnbench.report.study.primary import PrimaryAnswer
from vsnbench.report.study.tables import study_tables
from vsnbench.results.studies.entries import StudyTrialProgress


def to_markdown(found: StudyFindings) -> str:
    """Return the report as Markdown."""
    head = [f"# {markdown.escaped(found.recorded.title)}", markdown.escaped(found.plan.question)]
    said = f"**{markdown.escaped(found.conclusion)}**"
    return "\n\n".join([*head, said, markdown.markdown(study_tables(found))])


def to_latex(found: StudyFindings) -> str:
    """Return the tables with title, question and conclusion as comments, and the conclusion as a paragraph."""
    words = latex.escaped(found.conclusion)
    return f"% {latex.escaped(found.recorded.title)}\n{latex.latex(study_tables(found))}\n{words}\n"


def to_html(found: StudyFindings) -> str:
    """Return the report as a self-contained HTML page without scripts."""
    environment = page_environment()
    tables = study_tables(found)
    return environment.get_template(
        "study.html.j2"
    ).render(
        render_table=environment.get_template("table.html.j2").module.render_table,  # type: ignore[attr-defined]
        style=Markup(page_part("page.css")),  # noqa: S704 - our own file, not text from the record
        version=__version__,
        found=found,
        primary=tables[0],
        others=tables[1:],
    )


def _arm(key: str, meaning: str, null: str = "") -> Measure:
    """Return the measure of an arm of an answer, under its displayed name."""

    def shown(row: _Answer) -> str | None:
        found, answer = row
        arm = getattr(answer, key)
        return found.shown.get(arm, arm) if arm else None

    return Measure(key, TEXT, meaning, shown, null=null)


_Answer = tuple[StudyFindings, PrimaryAnswer]
_DIFFERENCE = "first minus second, in `metric`; for a fixed rate the first rate"
_P, _DECIDED = "p-value of the question after correction", "where the interval or a count decides"
_COUNTED = "the remaining trials cannot reverse the lead, and no test decided"
_UNITS = "complete blocks or starting positions that were evaluated; 0 for `stopping: plan`"
_WORDS = (
    "`first better`, `second better`, `equivalent`, `not inferior`, `test only`, `interval only`, `not shown` or "
    "`incomplete`"
)
_ANSWER = Measures(
    _arm("first", "name of the first arm, or its code"),
    _arm("second", "name of the second arm, or its code", "for a fixed rate"),
    *Measures(
        Measure("cells", COUNT, "number of evaluated cells, without repetitions"),
        Measure("trials", COUNT, "trials of each arm in these cells"),
        Measure("successes", NUMBERS, "successes of the first and the second arm"),
        Measure("difference", NUMBER, _DIFFERENCE),
        Measure("low", NUMBER, "lower limit of the interval of `difference`"),
        Measure("high", NUMBER, "upper limit of the interval of `difference`"),
        Measure("p", NUMBER, _P, null=_DECIDED),
        Measure("counted", FLAG, _COUNTED),
        Measure("open", FLAG, "no conclusion is possible yet"),
        Measure("units", COUNT, _UNITS),
        Measure("conclusion", TEXT, _WORDS),
        Measure("metric", TEXT, "`success` or `progress`"),
        Measure("means", values(NUMBER), "mean progress of both arms", null="for success"),
    ).within(lambda row: row[1]),
    _arm("winner", "better arm", "if undecided"),
    _arm("loser", "worse arm", "if undecided"),
)


def _dropped(found: StudyFindings) -> dict[str, int]:
    return {found.shown.get(arm, arm): block for arm, block in found.primary.dropped.items()}


_DROPPED = "beaten arm → number of complete units (blocks or starting positions) after which it was left out"
_OVER = "why the study ended before all trials were done; empty otherwise"
_PRIMARY = Measures(
    *Measures(
        Measure("method", TEXT, "method of the analysis"),
        Measure("about", TEXT, "what the conclusion generalizes to"),
        Measure("cells", COUNT, "planned cells of the shared goals, without repetitions"),
        Measure("trials_per_arm", COUNT, "planned trials of each arm in these cells", "trials"),
        Measure("over", TEXT, _OVER),
        Measure("looks", NUMBERS, "planned looks, in complete starting positions; empty for other rules"),
        Measure("looked", NUMBERS, "looks that took place"),
    ).within("primary"),
    Measure("dropped", COUNTS, _DROPPED, _dropped),
    Measure(
        "answers",
        objects(_ANSWER),
        "one object per pair of arms, or per arm and fixed rate",
        lambda found: [(found, answer) for answer in found.primary.answers],
    ),
)
_PLAN = Measures(
    Measure("sha256", TEXT, "SHA-256 of the plan as locked", "locked_sha256"),
    Measure("amended_sha256", TEXT, "SHA-256 of the plan as last amended", "sha256"),
    Measure("schedule_sha256", TEXT, "SHA-256 of the order of trials"),
    Measure("locked_at", TEXT, "time of the lock"),
    Measure("blind", FLAG, "codes are shown until study unblind", "is_blind"),
)
_DEVIATION = Measures(
    Measure("what", TEXT, "kind of deviation"),
    Measure("words", TEXT, "the deviation in words"),
)
_TRIAL = Measures(
    Measure("rank", COUNT, "place in the schedule"),
    Measure("block", COUNT, "number of the block"),
    Measure("arm", TEXT, "arm or its code"),
    Measure("goal", TEXT, "goal of the trial", "trial.goal"),
    Measure("start", COUNT, "number of the starting position", "trial.start"),
    Measure("repetition", COUNT, "number of the repetition, from 1", "trial.repetition"),
    Measure("episode", COUNT, "number of the episode that counts", "episode_id", null="if the trial is open"),
    Measure("success", FLAG, "verdict", null="without one"),
    Measure("progress", NUMBER, "progress of the episode, 0 to 1"),
)


def _trials(found: StudyFindings) -> list[StudyTrialProgress]:
    return [replace(trial, arm=found.shown.get(trial.arm, trial.arm)) for trial in found.progress]


STUDY = Measures(
    Measure("title", TEXT, "title of the study", "recorded.title"),
    Measure("question", TEXT, "question of the study", "plan.question"),
    Measure("conclusion", TEXT, "conclusion in words"),
    Measure("primary", an_object(_PRIMARY), "the planned analysis", lambda found: found),
    Measure("plan", an_object(_PLAN), "the plan as locked", "recorded"),
    Measure("deviations", objects(_DEVIATION), "deviations from the plan"),
    Measure("trials", objects(_TRIAL), "one object per trial", _trials),
)
"""The JSON object of `StudyFindings`; rates and differences from 0 to 1."""


def to_json(found: StudyFindings) -> str:
    """Return the report as one JSON object, as `STUDY` and docs/schemas/study-report.json describe it."""
    return json.dumps(STUDY.fields(found), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
