"""Measures time and memory of the full report on 200,000 episodes.

    python benchmarks/report_scale.py --directory /var/tmp/large                       makes the record once, measures
    python benchmarks/report_scale.py --directory /var/tmp/large --without-indexes     the same without our indexes
    python benchmarks/report_scale.py --directory /var/tmp/large --postgresql URL      the same record on a server

The record is synthetic: SQL statements write 200,000 episodes with 10 million steps (or `--episodes`) into SQLite. The
report is the `vsnbench report` command in a separate process, measured in wall seconds, processor seconds and MiB of
peak memory. `--postgresql` copies the record once into an empty database; the memory is then that of the report process
without the server.
"""

import argparse
import csv
import io
import json
import os
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

from sqlalchemy import inspect

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.schema.migrate import upgrade
from vsnbench.results.schema.tables import Base
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import load_site
from vsnbench.values.model.card import ModelCard
from vsnbench.values.robot_identity import RobotIdentity

MODELS = ("oracle", "random", "vlv", "pirlnav")
STEPS_AN_EPISODE = 50
VOID_SHARE = 0.02
INDEXES = ("ix_step_actions", "ix_verdict_episode_id_proposed_id", "ix_episode_trial_id")


def make_record(directory: Path, episodes: int) -> None:
    """Write a synthetic record of episodes with 25 to 75 steps each."""
    directory.mkdir(parents=True, exist_ok=True)
    site, profile = load_site("apartment"), load_profile("turtlebot2")
    cells = len(MODELS) * 2 * len(GOAL_CATEGORIES) * len(site.starts)
    repetitions = max(1, round(episodes * (1 - VOID_SHARE)) // cells)
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        for model in MODELS:
            for simulated in (True, False):
                journal.find_or_create_campaign(
                    CampaignPlan(
                        site=site,
                        robot=RobotIdentity(profile, "simulated" if simulated else "ros1", simulated),
                        model=ModelCard(model),
                        protocol=ProtocolParameters(),
                        seed=0,
                        trials=[
                            Trial(goal, start.number, repetition)
                            for repetition in range(1, repetitions + 1)
                            for goal in GOAL_CATEGORIES
                            for start in site.starts
                        ],
                    )
                )
    with closing(sqlite3.connect(directory / "vsnbench.db")) as database:
        database.executescript(_FILL.format(episodes=episodes, steps=STEPS_AN_EPISODE))


_FILL = """
PRAGMA synchronous = OFF;
BEGIN;
CREATE TEMP TABLE attempt AS
    SELECT row_number() OVER (ORDER BY void DESC, trial_id) AS id, trial_id, void,
        abs(random()) / 9223372036854775807.0 AS luck,
        {steps} / 2 + abs(random()) % {steps} AS actions,
        abs(random()) / 9223372036854775807.0 AS way
    FROM (
        SELECT id AS trial_id, 0 AS void FROM trial
        UNION ALL
        SELECT * FROM (SELECT id, 1 FROM trial ORDER BY random() LIMIT {episodes} - (SELECT count(*) FROM trial))
    );
INSERT INTO episode (id, uuid, trial_id, process_id, origin, state, seed, started_at, ended_at, end_reason, error,
    actions, path_length_m, geodesic_start_m, geodesic_end_m, duration_s, wall_duration_s, distance_to_goal_m,
    distance_source, goal_instance, start_x_m, start_y_m, start_heading_rad, final_x_m, final_y_m,
    final_heading_rad, final_source, images_directory)
SELECT id, hex(randomblob(16)), trial_id, 1, 'run', CASE WHEN void THEN 'void' ELSE 'judged' END, id,
    strftime('%Y-%m-%d %H:%M:%S.000000', 1700000000 + id * 60, 'unixepoch'),
    strftime('%Y-%m-%d %H:%M:%S.000000', 1700000000 + id * 60 + 50, 'unixepoch'),
    CASE WHEN void THEN 'motion_failed' WHEN luck < 0.5 THEN 'stop' WHEN luck < 0.8 THEN 'step_limit'
        ELSE 'collision' END,
    '', actions, 1 + 8 * way, 1 + 5 * way, 4 * luck, actions * 1.2, actions * 1.3, 4 * luck, 'simulated', 'chair_1',
    1.0, 1.0, 0.0, 1 + 5 * way, 1 + 4 * luck, 0.0, 'simulated', ''
FROM attempt;
INSERT INTO verdict (episode_id, created_at, proposed, success, end_reason, distance_m, distance_source, goal_instance,
    author, source, reason, note)
SELECT e.id, e.ended_at, 0, CASE WHEN a.void THEN NULL ELSE a.luck < 0.25 END, e.end_reason, e.distance_to_goal_m,
    'simulated', 'chair_1', 'vsnbench', 'protocol', 'made up', ''
FROM episode AS e JOIN attempt AS a ON a.id = e.id;
WITH RECURSIVE number(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM number WHERE n < 2 * {steps})
INSERT INTO step (episode_id, number, raw_action, action, blocked, completed, failure, recorded_at, stamp_s,
    observed_x_m, observed_y_m, observed_heading_rad, after_x_m, after_y_m, after_heading_rad, world_x_m, world_y_m,
    world_heading_rad, world_source, displacement_m, turn_rad, duration_s, corrections, rgb_digest, depth_digest,
    sense_s, infer_s, move_s)
SELECT id, n, action, action, (id + n) % 50 = 0, 1, '', '2026-01-01 00:00:00.000000', n * 1.2, n * 0.1, luck, luck,
    n * 0.1, luck, luck, 1 + n * 0.05, 1 + luck, luck, 'simulated', 0.25, 0.0, 1.1, 0,
    'blake3:0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef',
    'blake3:0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef', 0.01, 0.02, 1.0
FROM (
    SELECT id, n, luck, CASE WHEN n = actions AND luck < 0.5 THEN 'STOP'
        WHEN (id * 7919 + n * 104729) % 100 < 55 THEN 'MOVE_FORWARD'
        WHEN (id + n) % 2 THEN 'TURN_LEFT' ELSE 'TURN_RIGHT' END AS action
    FROM attempt CROSS JOIN number ON n <= actions
);
COMMIT;
PRAGMA wal_checkpoint(TRUNCATE);
"""


def copy_record(directory: Path, url: str) -> None:
    """Copy the record into an empty PostgreSQL database, table by table."""
    import psycopg

    engine = open_engine(url)
    upgrade(engine)
    engine.dispose()
    target = url.replace("postgresql+psycopg", "postgresql")
    with closing(sqlite3.connect(directory / "vsnbench.db")) as source, psycopg.connect(target) as server:
        server.execute("SET TIME ZONE 'UTC'")  # SQLite's times have no zone
        server.execute("SET session_replication_role = replica")  # skip key checks: SQLite has done them
        for table in Base.metadata.sorted_tables:
            names = [f'"{column.name}"' for column in table.columns]
            values = ", ".join(rf"coalesce({name}, '\N')" for name in names)
            rows = source.execute(f'SELECT {values} FROM "{table.name}"')
            columns = ", ".join(names)
            words = f'COPY "{table.name}" ({columns}) FROM STDIN WITH (FORMAT csv, NULL $$\\N$$)'
            with server.cursor().copy(words) as copy:
                while batch := rows.fetchmany(20_000):
                    lines = io.StringIO()
                    csv.writer(lines).writerows(batch)
                    copy.write(lines.getvalue())
        server.commit()
        server.autocommit = True
        server.execute("VACUUM ANALYZE")  # as autovacuum would do later: allows index-only counts


def is_empty(url: str) -> bool:
    """Return whether a PostgreSQL database has no record yet."""
    engine = open_engine(url)
    try:
        return not inspect(engine).has_table("episode")
    finally:
        engine.dispose()


def measure(directory: Path, arguments: list[str]) -> dict[str, float]:
    """Run the report command; return its wall seconds, processor seconds and peak memory in MiB."""
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "vsnbench.cli.main", "report", "--results", str(directory), *arguments],
        stdout=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"the report failed with status {status}")
    return {
        "seconds": round(time.perf_counter() - began, 2),
        "cpu_seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "peak_mib": round(usage.ru_maxrss / 1024),
    }


def main() -> None:
    """Make the record if it is missing, measure the report, and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=200_000)
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--without-indexes", action="store_true", help="drop the indexes from the record permanently")
    parser.add_argument("--postgresql", metavar="URL", help="copy the record there if it is empty, and measure on it")
    options = parser.parse_args()
    if not (options.directory / "vsnbench.db").exists():
        began = time.perf_counter()
        make_record(options.directory, options.episodes)
        print(f"made in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    with closing(sqlite3.connect(options.directory / "vsnbench.db")) as database:
        if options.without_indexes:
            for name in INDEXES:
                database.execute(f"DROP INDEX IF EXISTS {name}")
            database.commit()
        (episodes,) = database.execute("SELECT count(*) FROM episode").fetchone()
        (steps,) = database.execute("SELECT count(*) FROM step").fetchone()
    where: list[str] = []
    if options.postgresql:
        where = ["--db", options.postgresql]
        if is_empty(options.postgresql):
            began = time.perf_counter()
            copy_record(options.directory, options.postgresql)
            print(f"copied in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    outcome = {
        "database": "postgresql" if options.postgresql else "sqlite",
        "episodes": episodes,
        "steps": steps,
        "database_mib": (options.directory / "vsnbench.db").stat().st_size // 2**20,
        "indexes": not options.without_indexes,
        "table": measure(options.directory, where),
        "everything": measure(options.directory, [*where, "--output", str(options.directory / "report")]),
    }
    print(json.dumps(outcome, indent=2))


if __name__ == "__main__":
    main()
