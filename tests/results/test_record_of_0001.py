"""A record of schema 0001 is upgraded without loss; only wrong values are reported differently."""

import json
import sqlite3
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from sqlalchemy import Boolean, DateTime, Engine, MetaData, Table, text
from sqlalchemy.dialects.postgresql import JSONB

from tests.shared_records import write_copy
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import read
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema import migrate
from vsnbench.results.schema.engine import open_engine, opened_engine
from vsnbench.results.writing.journal import Journal

DATA = Path(__file__).parents[1] / "data" / "records"


@pytest.fixture
def before(sqlite: str) -> sqlite3.Connection:
    """The original record, for comparison."""
    path = sqlite_path(sqlite)
    assert path is not None
    write_record(path.parent)
    old = sqlite3.connect(":memory:")
    old.executescript((DATA / "0001.sql").read_text(encoding="utf-8"))
    old.row_factory = sqlite3.Row
    return old


def write_record(directory: Path) -> None:
    with closing(sqlite3.connect(directory / "vsnbench.db")) as database:
        database.executescript((DATA / "0001.sql").read_text(encoding="utf-8"))


def write_upgraded_record(directory: Path) -> None:
    write_record(directory)
    with opened_engine(sqlite_url(directory / "vsnbench.db")) as engine:
        assert migrate.upgrade(engine).current == "0001"


@pytest.fixture
def after(before: sqlite3.Connection, sqlite: str, tmp_path: Path) -> Engine:
    write_copy(tmp_path, write_upgraded_record)
    return open_engine(sqlite)


def rows(engine: Engine, query: str) -> list[tuple[Any, ...]]:
    with engine.connect() as connection:
        return [tuple(row) for row in connection.execute(text(query))]


KEPT = {
    "site": "id, name, title, sha256, content",
    "model": "id, name, sha256, weights_sha256, weights_label, settings, goals, sensors, surveyed",
    "process": "*",
    "verdict": "id, episode_id, created_at, success, end_reason, distance_m, distance_source, author, source, reason",
    "episode": "id, uuid, process_id, origin, seed, started_at, ended_at, end_reason, error, actions, path_length_m, "
    "geodesic_start_m, geodesic_end_m, duration_s, distance_to_goal_m, distance_source, start_x_m, final_x_m, "
    "final_source, images_directory",
}
"""Rows that no upgrade may change."""


@pytest.mark.parametrize("table", sorted(KEPT))
def test_every_row_is_still_there_as_it_was(before: sqlite3.Connection, after: Engine, table: str) -> None:
    query = f"SELECT {KEPT[table]} FROM {table} ORDER BY 1, 2"
    assert rows(after, query) == [tuple(row) for row in before.execute(query)]
    assert rows(after, query)


def test_every_step_is_as_it_was_and_says_what_its_images_were_hashed_with(
    before: sqlite3.Connection, after: Engine
) -> None:
    was = [dict(row) for row in before.execute("SELECT * FROM step ORDER BY episode_id, number")]
    for step in was:
        for image in ("rgb", "depth"):
            hashed = step.pop(f"{image}_sha256")
            step[f"{image}_digest"] = hashed and f"sha256:{hashed}"
        step |= {"movement": None, "rgb_file_digest": None, "depth_file_digest": None, "refusal": ""}
    assert {len(step["rgb_digest"] or "") for step in was} == {0, 71}
    with after.connect() as connection:
        assert [dict(row) for row in connection.execute(text("SELECT * FROM step")).mappings()] == was


def test_the_thinking_time_of_an_ended_episode_is_the_sum_of_its_steps_if_each_has_one(
    before: sqlite3.Connection, after: Engine
) -> None:
    sums = dict.fromkeys(range(1, 35))
    for number, count, known, total_s in before.execute(
        "SELECT episode_id, count(*), count(infer_s), sum(infer_s) FROM step GROUP BY episode_id"
    ):
        sums[number] = total_s if known == count else None
    assert (sums[28], sums[20], sums.pop(34)) == (None, None, pytest.approx(0.1426))
    assert dict(rows(after, "SELECT id, thinking_s FROM episode")) == {**sums, 34: None}  # 34 is running


def test_every_episode_still_belongs_to_its_goal_start_and_repetition(
    before: sqlite3.Connection, after: Engine
) -> None:
    query = (
        "SELECT episode.id, goal, start, repetition, campaign.seed, site.name, model.name, robot.name FROM episode "
        "JOIN trial ON trial.id = trial_id JOIN campaign ON campaign.id = campaign_id JOIN site ON site.id = site_id "
        "JOIN model ON model.id = model_id JOIN robot ON robot.id = robot_id ORDER BY episode.id"
    )
    assert rows(after, query) == [tuple(row) for row in before.execute(query)]


def test_states_say_what_end_and_verdict_said(after: Engine) -> None:
    states = dict(rows(after, "SELECT id, state FROM episode"))
    assert [number for number, state in states.items() if state == "void"] == [3, 20, 21, 29]
    assert [number for number, state in states.items() if state == "awaiting"] == [28, 30]
    assert [number for number, state in states.items() if state == "running"] == [34]
    assert {states[number] for number in (1, 7, 22, 24, 31)} == {"judged"}


def test_a_robot_is_what_carried_out_the_actions_and_not_what_was_typed(after: Engine) -> None:
    assert rows(after, "SELECT name, kind, simulated FROM robot ORDER BY id") == [
        ("turtlebot2", "simulated", 1),
        ("turtlebot2", "ros1", 1),
        ("test-base", "ros1", 0),
        ("turtlebot2", "imported", 0),
        ("habitat", "imported", 1),
    ]


def test_campaigns_of_one_condition_and_seed_are_one_and_say_so(after: Engine) -> None:
    merged = rows(after, "SELECT campaign_id, text FROM event WHERE kind = 'merged' ORDER BY id")
    assert [campaign for campaign, _ in merged] == [3, 3, 9]
    assert merged[0][1].startswith("campaign 4 (forward on turtlebot2 in apartment, of 2026-")
    assert rows(after, "SELECT goal, start, rank FROM trial WHERE campaign_id = 3 ORDER BY rank") == [
        ("bed", 1, 0), ("bed", 2, 1), ("bed", 3, 2), ("bed", 4, 3), ("plant", 2, 4), ("plant", 3, 5),
    ]  # fmt: skip


def test_the_report_is_unchanged_but_for_trials_that_counted_twice(after: Engine, sqlite: str) -> None:
    record = read(sqlite, Selection())
    of_campaign = {campaign: one for one in record.conditions for campaign in one.campaigns}
    compared = 0
    for old in json.loads((DATA / "0001-report.json").read_text(encoding="utf-8")):
        if old["campaigns"] == [10]:  # the base of campaign 9 under another path
            assert 10 not in of_campaign
            continue
        counted = record.counted(of_campaign[old["campaigns"][0]])
        for goal, was in old["goals"].items():
            mine = counted[counted["goal"] == goal]
            assert int(mine["success"].sum()) == was["successes"]
            if (old["model"], goal) == ("forward", "bed"):
                assert (was["episodes"], len(mine)) == (9, 4)
                continue
            compared += len(mine)
            assert len(mine) == was["episodes"], (old["campaigns"], goal)
            for column, measure in (("actions", "mean_actions"), ("spl", "spl")):
                if was[measure] is not None:  # a failure of unknown length has an SPL of 0 since
                    assert mine[column].mean() == pytest.approx(was[measure]), (old["campaigns"], goal, measure)
    assert compared == 16
    assert len(rows(after, "SELECT id FROM campaign")) == 10


def test_only_simulated_noise_is_noise(sqlite: str, after: Engine) -> None:
    record = read(sqlite, Selection())
    assert [one.campaigns for one in record.conditions if one.noisy] == [(2,)]
    assert rows(after, "SELECT conditions FROM campaign WHERE id = 9") == [('{"depth_frames":5}',)]


def test_the_latest_judgement_still_stands(after: Engine) -> None:
    taped = episode_record(after, 7)
    assert (taped.success, taped.distance_m, taped.distance_source) == (
        True, 0.84, "tape",
    )  # fmt: skip
    assert [verdict.author for verdict in taped.verdicts] == ["vsnbench", "grace"]
    assert episode_record(after, 24).end_reason == "collision"
    assert episode_record(after, 3).outcome == "void"


def test_who_intervened_is_a_column_and_no_longer_the_end_of_a_sentence(
    before: sqlite3.Connection, after: Engine
) -> None:
    (was,) = before.execute("SELECT text FROM event WHERE kind = 'intervention'").fetchone()
    assert was == "collision called: the table, by ada"
    (called,) = [event for event in episode_record(after, 24).events if event.kind == "intervention"]
    assert (called.author, called.text) == ("ada", "collision called: the table")
    assert rows(after, "SELECT id, text FROM event WHERE author = '' AND kind <> 'merged' ORDER BY id") == [
        tuple(row) for row in before.execute("SELECT id, text FROM event WHERE kind <> 'intervention' ORDER BY id")
    ]


def test_words_that_end_like_an_author_stay_words(before: sqlite3.Connection, sqlite: str) -> None:
    path = sqlite_path(sqlite)
    assert path is not None
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE event SET text = 'collision called: a cyclist, by the door' WHERE episode_id = 24")
        database.commit()
    engine = open_engine(sqlite)
    migrate.upgrade(engine)
    assert [(event.author, event.text) for event in episode_record(engine, 24).events] == [
        ("", "collision called: a cyclist, by the door")
    ]


def test_a_run_can_go_on_with_it(after: Engine, sqlite: str) -> None:
    after.dispose()
    with Journal.open(sqlite) as journal:
        assert [one.id for one in journal.recovered] == [34]
        journal.judge(28, Verdict(EndReason.STOP, False, "failed: far away"), author="ada")
        assert episode_record(journal.engine, 28).outcome == "failure"


def test_a_server_with_these_rows_comes_to_the_same(before: sqlite3.Connection, after: Engine, postgresql: str) -> None:
    server = open_engine(postgresql)
    config = migrate._config()
    with server.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        tables = MetaData()
        tables.reflect(connection)
        for table in tables.sorted_tables:
            if table.name != "alembic_version":
                values = [_for_a_server(table, row) for row in before.execute(f'SELECT * FROM "{table.name}"')]
                connection.execute(table.insert(), values)
                if "id" in table.columns:
                    sequence = f"pg_get_serial_sequence('{table.name}', 'id')"
                    connection.execute(text(f"SELECT setval({sequence}, (SELECT max(id) FROM {table.name}))"))
    migrate.upgrade(server)
    for query in (
        "SELECT id, state, trial_id, start_source FROM episode ORDER BY id",
        "SELECT id, key, robot_id FROM campaign ORDER BY id",
        "SELECT id, campaign_id, goal, start, repetition, rank FROM trial ORDER BY id",
        "SELECT id, name, kind, sha256 FROM robot ORDER BY id",
        "SELECT id, kind, author, text FROM event WHERE kind <> 'merged' ORDER BY id",
        "SELECT episode_id, number, rgb_digest, depth_digest FROM step ORDER BY episode_id, number",
    ):
        assert rows(server, query) == rows(after, query)


def _for_a_server(table: Table, row: sqlite3.Row) -> dict[str, Any]:
    """Convert a value of SQLite, which stores booleans as numbers, times without a zone and JSON as text."""

    def typed(column: Any, value: Any) -> Any:
        if value is None:
            return None
        if isinstance(column.type, Boolean):
            return bool(value)
        if isinstance(column.type, JSONB):
            return json.loads(value)
        return datetime.fromisoformat(f"{value}+00:00") if isinstance(column.type, DateTime) else value

    return {column.name: typed(column, row[column.name]) for column in table.columns}
