"""A study's report as Markdown, LaTeX, HTML or JSON; the conclusion comes first."""

import json
from dataclasses import asdict
from typing import Any

from markupsafe import Markup

from vsnbench import __version__
from vsnbench.report.formats import latex, markdown
from vsnbench.report.formats.html import page_environment, page_part
from vsnbench.report.formats.json import known
from vsnbench.report.study.findings import StudyFindings
from vsnbench.report.study.tables import study_tables


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


def to_json(found: StudyFindings) -> str:
    """Return the report as one JSON object; rates and differences from 0 to 1, null if unknown."""
    recorded, shown = found.recorded, found.shown

    def named(arm: str | None) -> str | None:
        return shown.get(arm, arm) if arm else None

    content: dict[str, Any] = {
        "title": recorded.title,
        "question": found.plan.question,
        "conclusion": found.conclusion,
        "primary": {
            "method": found.primary.method,
            "about": found.primary.about,
            "cells": found.primary.cells,
            "trials_per_arm": found.primary.trials,
            "over": found.primary.over,
            "dropped": {named(arm): block for arm, block in found.primary.dropped.items()},
            "answers": [
                asdict(answer)
                | {"first": named(answer.first), "second": named(answer.second)}
                | {"winner": named(answer.winner), "loser": named(answer.loser)}
                for answer in found.primary.answers
            ],
        },
        "plan": {
            "sha256": recorded.locked_sha256,
            "amended_sha256": recorded.sha256,
            "schedule_sha256": recorded.schedule_sha256,
            "locked_at": recorded.locked_at.isoformat(),
            "blind": recorded.is_blind,
        },
        "deviations": [asdict(deviation) for deviation in found.deviations],
        "trials": [
            {
                "rank": trial.rank,
                "block": trial.block,
                "arm": named(trial.arm),
                "goal": trial.trial.goal,
                "start": trial.trial.start,
                "repetition": trial.trial.repetition,
                "episode": trial.episode_id,
                "success": trial.success,
                "progress": trial.progress,
            }
            for trial in found.progress
        ],
    }
    return json.dumps(known(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
