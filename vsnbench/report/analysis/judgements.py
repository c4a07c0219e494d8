"""How often operators overruled the protocol's verdict, and how far blind second judgements agree with it."""

from collections import Counter
from typing import Any

from sqlalchemy import Engine, select

from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.reading.read_model import COUNTED, VOID
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import VerdictRow
from vsnbench.results.second_judgements import Outcome, person_key, second_judgements
from vsnbench.statistics.agreement import JudgedTwice, judge_agreement

PERSON, PROTOCOL = "person", "protocol"


def latest_judgements(engine: Engine) -> dict[int, tuple[Any, Any]]:
    """Return the protocol's first verdict (or None) and the operator's current verdict of each judged episode."""
    judged = select(VerdictRow.episode_id).where(VerdictRow.source == PERSON)
    with record_errors(engine), engine.connect() as connection:
        rows = connection.execute(
            select(
                *(VerdictRow.episode_id, VerdictRow.success, VerdictRow.source, VerdictRow.proposed),
                *(VerdictRow.author, VerdictRow.reason, VerdictRow.note),
            )
            .where(VerdictRow.episode_id.in_(judged))
            .order_by(VerdictRow.episode_id, VerdictRow.id)
        ).all()
    first: dict[int, Any] = {}
    current: dict[int, Any] = {}
    for row in rows:
        if row.source == PROTOCOL:
            first.setdefault(row.episode_id, row)
        if not row.proposed:
            current[row.episode_id] = row
    return {number: (first.get(number), last) for number, last in current.items() if last.source == PERSON}


def read_judgements(engine: Engine, record: ReportData) -> Rows:
    """Return the operators' judgements of each condition that has any, as rows of `tables.failures.JUDGEMENTS`."""
    judgements = latest_judgements(engine)
    if not judgements:
        return ()
    condition_of = dict(zip(record.episodes["episode"].tolist(), record.episodes["condition"].tolist(), strict=True))
    counts: dict[int, int] = {}
    overruled: dict[int, list[dict[str, Any]]] = {}
    for number, (first, last) in judgements.items():
        if first is None or number not in condition_of:
            continue
        condition, before = condition_of[number], first.success
        counts[condition] = counts.get(condition, 0) + 1
        if before != last.success:
            change = {"episode": number, "before": before, "after": last.success}
            change |= {"author": last.author, "reason": last.note or last.reason}
            overruled.setdefault(condition, []).append(change)
    return [
        {"condition": condition, "judged": counts[condition], "overruled": overruled.get(condition, [])}
        for condition in sorted(counts)
    ]


def read_rater_agreements(engine: Engine, record: ReportData) -> Rows:
    """Return the agreement of each rater with the current verdicts, by name, as rows of `tables.second_judgements`.

    Episodes whose verdict was retracted have none and are left out.
    """
    with record_errors(engine), engine.connect() as connection:
        given = second_judgements(connection)
    if not given:
        return ()
    wanted = {judgement.episode for judgement in given}
    rows = record.episodes[record.episodes["episode"].isin(wanted) & record.episodes["state"].isin([COUNTED, VOID])]
    columns = ("condition", "goal", "start", "state", "success")
    known = dict(
        zip(rows["episode"].tolist(), zip(*(rows[name].tolist() for name in columns), strict=True), strict=True)
    )
    sites = {condition.number: condition.site_sha256 for condition in record.conditions}
    twice: dict[str, list[JudgedTwice]] = {}
    differing: dict[str, list[dict[str, Any]]] = {}
    names: dict[str, str] = {}
    for judgement in given:
        if judgement.episode in known:
            condition, goal, start, state, success = known[judgement.episode]
            first = Outcome.VOID if state == VOID else Outcome.of(success)
            key = person_key(judgement.rater)
            names[key] = judgement.rater
            twice.setdefault(key, []).append(JudgedTwice((sites[condition], start), first, judgement.outcome))
            if first is not judgement.outcome:
                found = {"episode": judgement.episode, "goal": goal, "start": start, "first": first}
                differing.setdefault(key, []).append(found | {"second": judgement.outcome, "text": judgement.text})
    return [
        {
            "rater": names[key],
            "agreement": judge_agreement(pairs),
            "outcomes": Counter((pair.first, pair.second) for pair in pairs),
            "differing": differing.get(key, []),
        }
        for key, pairs in sorted(twice.items())
    ]
