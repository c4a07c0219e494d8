import sqlite3
from contextlib import closing

import pytest

from tests.database.records_of_a_lab import plan, run, stopped
from vsnbench.database.journal import Journal
from vsnbench.database.soundness import record_fault
from vsnbench.database_url import sqlite_path


@pytest.fixture
def record(sqlite: str) -> str:
    with Journal.open(sqlite) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
    return sqlite


def change(url: str, statement: str) -> None:
    path = sqlite_path(url)
    assert path is not None
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("PRAGMA ignore_check_constraints = ON")
        database.execute(statement)


def test_a_record_of_ours_has_no_fault(url: str) -> None:
    with Journal.open(url) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
    assert record_fault(url) == ""


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE step SET action = 'JUMP'", "step 1/1: action is 'JUMP', not one of STOP"),
        ("UPDATE episode SET started_at = 'soon'", "episode 1: started_at is 'soon', no time"),
        (
            "UPDATE episode SET started_at = '0001-01-01 00:00:00'",
            "started_at is datetime.datetime(1, 1, 1, 0, 0), no time",
        ),
        ("UPDATE episode SET path_length_m = 9e999", "path_length_m is inf, no number that could be measured"),
        ("UPDATE trial SET start = 'a' WHERE id = 1", "start is 'a', no number"),
        ("UPDATE site SET content = '{'", "content is '{', no JSON of ours"),
        ("UPDATE campaign SET protocol = '{\"max_actions\": -1}'", "protocol is none that can be used"),
        ("CREATE TRIGGER t AFTER INSERT ON model BEGIN DELETE FROM site; END", "a trigger, 't'"),
        ("UPDATE trial SET campaign_id = 99", "points to a row of campaign that is not there"),
    ],
)
def test_what_no_vsnbench_writes_is_named_with_its_row(record: str, statement: str, said: str) -> None:
    change(record, statement)
    assert said in record_fault(record)
