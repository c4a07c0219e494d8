"""The current judge agrees with all recomputable verdicts of a record of the first schema."""

import sqlite3
from contextlib import closing
from pathlib import Path

from vsnbench.evidence.verification.judgements import check_judgements
from vsnbench.evidence.verification.record import open_copy
from vsnbench.evidence.verification.values import check_values

RECORD = Path(__file__).parents[2] / "data" / "records" / "0001.sql"


def test_todays_judge_agrees_with_a_record_of_the_first_schema(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as database:
        database.executescript(RECORD.read_text(encoding="utf-8"))
    (tmp_path / "scratch").mkdir()
    with open_copy(tmp_path, tmp_path / "scratch") as record:
        judged, people = check_judgements(record, lambda _what, _done, _of: None)
        values = check_values(record, lambda _what, _done, _of: None)
    assert (judged.checked, judged.findings, values.findings) == (27, [], [])
    assert dict(judged.not_checked) == {
        "imported from another tool: no poses to judge": 6,
        "not ended": 1,
        "wording of a verdict: written by another version": 16,
    }
    assert people == {"ada": 2, "grace": 1}
