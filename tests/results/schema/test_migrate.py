import os
import shutil
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import create_engine, event, inspect, text

from tests.results.records_of_a_lab import begun, forward, plan, run, running_elsewhere, stopped
from vsnbench.errors import RecordError
from vsnbench.files.package_data import resource_directory
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_steps, list_episodes
from vsnbench.results.schema import migrate
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.schema.migrate import create_record, get_ready
from vsnbench.results.schema.tables import TableBase
from vsnbench.results.writing.journal import Journal

ROWS_OF_0001 = """
INSERT INTO site VALUES (1, 'cell', '', 'a', '{}');
INSERT INTO robot VALUES (1, 'puck', 'Puck', 'simulated', 1, 'a', '{}');
INSERT INTO model VALUES (1, 'random', 'a', '', '', '{}', NULL, '[]', 0);
INSERT INTO process VALUES (1, 'h', 1, 'b', 'n', 1, '2026-01-01 00:00:00.000000', 'o', 'c', '0', '', 0, '{}', '{}');
INSERT INTO campaign (id, "key", name, created_at, site_id, robot_id, model_id, process_id, protocol,
    protocol_sha256, noise, goals, starts, repetitions, seed, shuffled)
    VALUES (1, 'k', 'first', '2026-01-01 00:00:00.000000', 1, 1, 1, 1, '{}', 'p', '{}', '["chair"]', '[1]', 1, 0, 0);
INSERT INTO trial VALUES (1, 1, 'chair', 1, 1, 0);
INSERT INTO episode (id, uuid, trial_id, process_id, origin, seed, started_at, ended_at, end_reason, error, actions,
    images_directory) VALUES (1, 'u', 1, 1, 'run', 0, '2026-01-01 00:00:00.000000', '2026-01-01 00:01:00.000000',
    'stop', '', 1, 'episodes/000001');
INSERT INTO step (episode_id, number, raw_action, "action", blocked, completed, failure, recorded_at, corrections)
    VALUES (1, 1, 'STOP', 'STOP', 0, 1, '', '2026-01-01 00:00:30.000000', 0);
INSERT INTO verdict (id, episode_id, created_at, success, end_reason, author, source, reason)
    VALUES (1, 1, '2026-01-01 00:01:00.000000', 1, 'stop', 'vsnbench', 'protocol', 'near');
"""
"""Rows of a record with the oldest schema."""


def oldest(url: str, rows: str = "") -> None:
    """Make a database of the first schema."""
    engine = open_engine(url)
    config = migrate._config()
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
    engine.dispose()
    path = sqlite_path(url)
    if rows and path:
        with closing(sqlite3.connect(path)) as database:
            database.executescript(rows)


def differences(url: str) -> list[object]:
    engine = open_engine(url)
    with engine.connect() as connection:
        found = compare_metadata(
            MigrationContext.configure(connection, opts={"compare_type": True}), TableBase.metadata
        )
    engine.dispose()
    return list(found)


def test_an_empty_database_comes_to_exactly_the_tables_of_the_models(url: str) -> None:
    before = migrate.upgrade(open_engine(url))
    assert before.current is None
    assert migrate.schema_state(open_engine(url)).up_to_date
    assert differences(url) == []


def test_the_comparison_notices_a_column_that_no_migration_makes(url: str) -> None:
    engine = open_engine(url)
    migrate.upgrade(engine)
    with engine.begin() as connection:
        connection.execute(text("ALTER TABLE event DROP COLUMN kind"))
    engine.dispose()
    assert differences(url) != []


def test_the_sql_of_an_empty_record_is_that_of_the_migrations() -> None:
    stored = (resource_directory("migrations") / migrate.NEWEST).read_text(encoding="utf-8")
    # Alembic rebuilds a table with its constraints in any order.
    lines, expected = (
        sorted(line.strip(", \t") for line in sql.splitlines()) for sql in (stored, migrate.newest_sql())
    )
    assert lines == expected, "run scripts/make_docs.py after a new migration"


def test_upgrading_twice_changes_nothing(url: str) -> None:
    migrate.upgrade(open_engine(url))
    assert migrate.upgrade(open_engine(url)).up_to_date


@pytest.mark.parametrize("rows", ["", ROWS_OF_0001], ids=["empty", "with rows"])
def test_the_oldest_schema_is_brought_up_to_date_and_keeps_its_rows(sqlite: str, rows: str) -> None:
    oldest(sqlite, rows)
    engine = open_engine(sqlite)
    migrate.upgrade(engine)
    assert differences(sqlite) == []
    episodes = list_episodes(engine, EpisodeFilter())
    assert [(episode.model, episode.goal, episode.success) for episode in episodes] == (
        [("random", "chair", True)] if rows else []
    )
    assert len(episode_steps(engine, 1)) == len(episodes)


@pytest.mark.parametrize(("revision", "table"), [("0002", "study"), ("0003", "session")])
def test_a_record_from_before_there_was_a_table_keeps_its_rows_and_takes_it_in(
    sqlite: str, revision: str, table: str
) -> None:
    oldest(sqlite, ROWS_OF_0001)
    config = migrate._config()
    with create_engine(sqlite).begin() as connection:  # SQLite's own, which holds no foreign keys while tables change
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
    engine = open_engine(sqlite)
    assert table not in inspect(engine).get_table_names()
    migrate.upgrade(engine)
    assert differences(sqlite) == []
    assert [episode.model for episode in list_episodes(engine, EpisodeFilter())] == ["random"]


def test_why_the_guard_ended_or_refused_an_action_gets_a_column_of_its_own(sqlite: str) -> None:
    oldest(sqlite, ROWS_OF_0001)
    config = migrate._config()
    with create_engine(sqlite).begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0010")
        copied = "raw_action, \"action\", {}, 0, '{}', recorded_at, 0 FROM step WHERE number = 1"
        for number, blocked, failure in ((2, 1, "obstacle ahead"), (3, 1, ""), (4, 0, "stuck")):
            columns = 'episode_id, number, raw_action, "action", blocked, completed, failure, recorded_at, corrections'
            values = f"1, {number}, {copied.format(blocked, failure)}"
            connection.execute(text(f"INSERT INTO step ({columns}) SELECT {values}"))
        connection.execute(
            text(
                "INSERT INTO event (episode_id, step_number, created_at, kind, author, text) "
                "VALUES (1, 3, '2026-01-01 00:00:30.000000', 'blocked', '', 'action 3: blind')"
            )
        )
    engine = open_engine(sqlite)
    migrate.upgrade(engine)
    with engine.connect() as connection:
        rows = connection.execute(text("SELECT number, refusal, failure FROM step ORDER BY number")).all()
    assert rows == [(1, "", ""), (2, "obstacle ahead", ""), (3, "blind", ""), (4, "", "stuck")]


def test_foreign_keys_are_on_after_an_upgrade(sqlite: str) -> None:
    engine = open_engine(sqlite)
    migrate.upgrade(engine)
    with engine.connect() as connection:
        assert connection.execute(text("PRAGMA foreign_keys")).scalar() == 1


def with_one_more_migration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str) -> None:
    """Let the next migration be `body`."""
    scripts = tmp_path / "migrations"
    shutil.copytree(resource_directory("migrations"), scripts)
    last = migrate.HEAD
    (scripts / "versions" / "9999_next.py").write_text(
        f"from alembic import op\nimport sqlalchemy as sa\nrevision = '9999'\ndown_revision = '{last}'\n"
        f"def upgrade():\n    {body}\n"
    )
    monkeypatch.setattr(migrate, "resource_directory", lambda name: scripts)
    monkeypatch.setattr(migrate, "HEAD", "9999")


def test_the_newest_migration_is_the_revision_that_is_opened_unasked() -> None:
    assert ScriptDirectory(str(resource_directory("migrations"))).get_current_head() == migrate.HEAD


def test_a_migration_that_fails_half_way_leaves_nothing_behind(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    migrate.upgrade(open_engine(url))
    with_one_more_migration(
        tmp_path, monkeypatch, "op.create_table('half', sa.Column('id', sa.Integer())); raise RuntimeError('half-way')"
    )
    with pytest.raises(RuntimeError, match="half-way"):
        migrate.upgrade(open_engine(url))
    engine = open_engine(url)
    assert "half" not in inspect(engine).get_table_names()
    assert not migrate.schema_state(engine).up_to_date


def test_a_migration_that_orphans_rows_is_refused_and_undone(
    sqlite: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    oldest(sqlite, ROWS_OF_0001)
    migrate.upgrade(open_engine(sqlite))
    with_one_more_migration(tmp_path, monkeypatch, "op.execute('DELETE FROM trial')")
    with pytest.raises(RecordError, match="row 1 of episode refers to a missing row of trial"):
        migrate.upgrade(open_engine(sqlite))
    assert len(list_episodes(open_engine(sqlite), EpisodeFilter())) == 1


def test_a_rebuilt_table_keeps_the_rows_that_point_to_it(
    sqlite: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    oldest(sqlite, ROWS_OF_0001)
    migrate.upgrade(open_engine(sqlite))
    body = "with op.batch_alter_table('episode', recreate='always') as table: table.drop_column('error')"
    with_one_more_migration(tmp_path, monkeypatch, body)
    engine = open_engine(sqlite)
    migrate.upgrade(engine)
    with engine.connect() as connection:
        assert connection.execute(text("SELECT count(*) FROM step JOIN episode ON id = episode_id")).scalar() == 1


def test_a_database_from_a_newer_vsnbench_is_refused_in_a_clear_sentence(url: str) -> None:
    engine = open_engine(url)
    migrate.upgrade(engine)
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '7777'"))
    for refused in (lambda: Journal.open(url), lambda: migrate.open_record(url).__enter__()):
        with pytest.raises(RecordError, match=r"newer vsnbench \(its schema is 7777.*upgrade vsnbench"):
            refused()


def test_a_reader_of_an_older_record_gets_an_upgraded_copy(
    sqlite: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    migrate.upgrade(open_engine(sqlite))
    older = migrate.HEAD
    with_one_more_migration(tmp_path, monkeypatch, "op.execute('CREATE TABLE added (id INTEGER)')")
    with migrate.open_record(sqlite) as engine, engine.connect() as connection:
        copy = Path(str(engine.url.database or ""))
        assert connection.execute(text("SELECT count(*) FROM added")).scalar() == 0
    assert not copy.exists() or copy == Path()
    with open_engine(sqlite, read_only=True).connect() as connection:
        assert connection.execute(text("SELECT version_num FROM alembic_version")).scalar() == older


def test_a_record_is_not_upgraded_under_a_robot_that_writes_to_it(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running_elsewhere(url) as robot:
        kept = int(robot.stdout.readline())
        with_one_more_migration(tmp_path, monkeypatch, "pass")
        for refused in (lambda: migrate.upgrade(open_engine(url)), lambda: Journal.open(url)):
            with pytest.raises(RecordError, match=f"process {robot.pid} .* older vsnbench; it was not upgraded"):
                refused()
        assert [int(robot.stdout.readline()) for _ in range(50)][-1] == kept + 50
    migrate.upgrade(open_engine(url))
    assert migrate.schema_state(open_engine(url)).up_to_date


def test_what_ran_where_nobody_can_look_holds_up_an_upgrade_as_long_as_its_lease(
    postgresql: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Journal.open(postgresql) as journal:
        begun(journal, journal.find_or_create_campaign(plan()).trials[0])
    engine = open_engine(postgresql)
    with engine.begin() as connection:
        connection.execute(text("UPDATE process SET boot_id = 'of another machine', host = 'heron'"))
    with_one_more_migration(tmp_path, monkeypatch, "pass")
    with pytest.raises(RecordError, match="episode 1 is using the database"):
        migrate.upgrade(engine)
    with engine.begin() as connection:
        connection.execute(text("UPDATE episode SET lease_until = now() - interval '1 second'"))
    assert not migrate.upgrade(engine).up_to_date


def test_somebody_elses_database_is_left_alone(sqlite: str, tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as database:
        database.execute("CREATE TABLE recipes (id INTEGER)")
    with pytest.raises(RecordError, match=r"holds other tables \(recipes\)"):
        Journal.open(sqlite)


def test_two_processes_that_start_on_an_empty_server_migrate_it_once(postgresql: str) -> None:
    failures: list[BaseException] = []

    def start() -> None:
        try:
            Journal.open(postgresql).close()
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert migrate.schema_state(open_engine(postgresql)).up_to_date


def test_a_backup_taken_while_steps_are_written_is_whole(sqlite: str, tmp_path: Path) -> None:
    with Journal.open(sqlite) as journal:
        campaign = journal.find_or_create_campaign(plan())
        run(journal, campaign.trials[0], stopped(success=True))
        episode = begun(journal, campaign.trials[1])
        stop = threading.Event()
        written = 0

        def write() -> None:
            nonlocal written
            while not stop.is_set():
                written += 1
                journal.append_step(episode.id, forward(written))

        writer = threading.Thread(target=write)
        writer.start()
        backup(sqlite, tmp_path / "copy.db")
        stop.set()
        writer.join()
    copy = open_engine(sqlite_url(tmp_path / "copy.db"))
    numbers = [step.number for step in episode_steps(copy, episode.id)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) <= written
    assert len(episode_steps(copy, 1)) == 3
    assert not [path.name for path in tmp_path.iterdir() if path.name.endswith(".part")]


@pytest.mark.parametrize("number", range(8))
def test_a_record_created_between_two_queries_of_its_state_is_no_foreign_database(postgresql: str, number: int) -> None:
    engine = open_engine(postgresql)
    count = iter(range(1000))

    def create(*_: object) -> None:
        if next(count) == number:
            migrate.upgrade(open_engine(postgresql))

    event.listen(engine, "before_cursor_execute", create)
    assert migrate.schema_state(engine).current in {None, migrate.HEAD}


def test_a_backup_of_postgresql_is_an_archive(postgresql: str, tmp_path: Path) -> None:
    migrate.upgrade(open_engine(postgresql))
    backup(postgresql, tmp_path / "copy.dump")
    assert (tmp_path / "copy.dump").read_bytes().startswith(b"PGDMP")


def test_a_backup_shows_the_password_to_nobody(
    postgresql: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Journal.open(postgresql).close()
    real, words = shutil.which("pg_dump"), tmp_path / "words"
    program = tmp_path / "bin" / "pg_dump"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" > {words}\nexec {real} "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    with_password = postgresql.replace("postgresql+psycopg://lab@", "postgresql+psycopg2://lab:s3cret%40@")
    backup(with_password, tmp_path / "copy.dump")
    assert (tmp_path / "copy.dump").read_bytes()[:5] == b"PGDMP"
    assert "--dbname" in words.read_text()
    assert "s3cret" not in words.read_text()


def test_a_backup_never_overwrites_and_never_appears_half_written(sqlite: str, tmp_path: Path) -> None:
    migrate.upgrade(open_engine(sqlite))
    (tmp_path / "there.db").write_text("precious")
    with pytest.raises(RecordError, match="already exists"):
        backup(sqlite, tmp_path / "there.db")
    assert (tmp_path / "there.db").read_text() == "precious"
    with pytest.raises(RecordError, match="does not exist"):
        backup(sqlite, tmp_path / "nowhere" / "copy.db")
    with pytest.raises(RecordError, match="nothing to back up"):
        backup(sqlite_url(tmp_path / "absent.db"), tmp_path / "copy.db")
    assert not (tmp_path / "copy.db").exists()


def test_a_record_made_in_memory_equals_a_migrated_one_and_replaces_no_file(sqlite: str, tmp_path: Path) -> None:
    get_ready(sqlite)
    assert not list(tmp_path.iterdir()), "the next run may still be refused"
    create_record(sqlite)
    assert [path.name for path in tmp_path.iterdir()] == ["vsnbench.db"]
    assert migrate.schema_state(open_engine(sqlite)).up_to_date
    assert differences(sqlite) == []
    with Journal.open(sqlite) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
        create_record(sqlite)
    with Journal.open(sqlite) as journal:
        assert len(list_episodes(journal.engine, EpisodeFilter())) == 1
