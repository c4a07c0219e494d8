"""A study's report in every form: Markdown, LaTeX, one HTML page, JSON; the conclusion stands first in each."""

import json
from dataclasses import asdict
from typing import Any

from vsnbench import __version__
from vsnbench.report.forms import latex, markdown
from vsnbench.report.forms.html import page_environment, page_part
from vsnbench.report.forms.whole_json import known
from vsnbench.report.study.findings import StudyFindings
from vsnbench.report.study.sheets import study_sheets


def to_markdown(found: StudyFindings) -> str:
    """Return the report as Markdown."""
    head = [f"# {markdown.escaped(found.recorded.title)}", markdown.escaped(found.plan.question)]
    said = f"**{markdown.escaped(found.conclusion)}**"
    return "\n\n".join([*head, said, markdown.markdown(study_sheets(found))])


def to_latex(found: StudyFindings) -> str:
    """Return the tables, with title, question and conclusion as comments and the conclusion as a paragraph."""
    words = latex.escaped(found.conclusion)
    return f"% {latex.escaped(found.recorded.title)}\n{latex.latex(study_sheets(found))}\n{words}\n"


def to_html(found: StudyFindings) -> str:
    """Return the report as one page: no network, no script."""
    from markupsafe import Markup

    environment = page_environment()
    sheets = study_sheets(found)
    return environment.get_template(
        "study.html.j2"
    ).render(
        table=environment.get_template("table.html.j2").module.table,  # type: ignore[attr-defined]
        style=Markup(page_part("page.css")),  # noqa: S704 - our own file, not text from the record
        version=__version__,
        found=found,
        primary=sheets[0],
        others=sheets[1:],
    )


def to_json(found: StudyFindings) -> str:
    """Return everything as one JSON object; rates and differences are shares, what is unknown is null."""
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
            "over": found.primary.over,
            "dropped": {named(arm): block for arm, block in found.primary.dropped.items()},
            "answers": [
                asdict(one)
                | {"first": named(one.first), "second": named(one.second)}
                | {"winner": named(one.winner), "loser": named(one.loser)}
                for one in found.primary.answers
            ],
        },
        "plan": {
            "sha256": recorded.locked_sha256,
            "amended_sha256": recorded.sha256,
            "schedule_sha256": recorded.schedule_sha256,
            "locked_at": recorded.locked_at.isoformat(),
            "blind": recorded.is_blind,
        },
        "deviations": [asdict(one) for one in found.deviations],
        "trials": [
            {
                "rank": one.rank,
                "block": one.block,
                "arm": named(one.arm),
                "goal": one.trial.goal,
                "start": one.trial.start,
                "repetition": one.trial.repetition,
                "episode": one.episode_id,
                "success": one.success,
            }
            for one in found.standing
        ],
    }
    return json.dumps(known(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
