import hashlib
import json
import random
import shutil
import sqlite3
import zipfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import text

from tests.cli.test_record_verbs import vsnbench
from tests.results.records_of_a_lab import begun, plan, run, stopped, void
from vsnbench.errors import RecordError, UsageError
from vsnbench.interop.merge import MergeResult, merge, merge_source
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, episode_steps, list_campaigns, list_episodes
from vsnbench.results.writing.campaigns import CampaignPlan
from vsnbench.results.writing.journal import Journal
from vsnbench.values.encoding.image_digest import depth_digest, file_digest
from vsnbench.values.encoding.images import encode_depth_png, encode_jpeg

GOALS = ("chair", "sofa", "bed", "toilet")


DEPTH = np.arange(48, dtype=np.uint16).reshape(6, 8) + 500
"""Depth in millimetres in each step of these records."""


def image(uuid: str, number: int) -> bytes:
    """Return a JPEG whose pixels depend on the episode and the step."""
    chance = np.random.default_rng(list(f"{uuid} {number}".encode()))
    return encode_jpeg(chance.integers(0, 256, (6, 8, 3), np.uint8))


def draw(results: Path) -> None:
    """Write the image files of all episodes of a record, and their digests in the steps."""
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        for episode in list_episodes(journal.engine, EpisodeFilter()):
            draw_episode(results / episode.images_directory, episode.uuid, episode.actions)
            set_file_digests(journal, episode.id, episode.uuid, episode.actions)
        set_depth_digests(journal)


def draw_episode(directory: Path, uuid: str, actions: int) -> None:
    for number in range(1, actions + 1):
        for file, content in (
            (rgb_path(directory, number), image(uuid, number)),
            (depth_path(directory, number), encode_depth_png(DEPTH)),
        ):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
    (directory / "trajectory.tum").write_text(uuid)


def set_file_digests(journal: Journal, number: int, uuid: str, actions: int) -> None:
    digests = [{"step": step, "digest": file_digest(image(uuid, step))} for step in range(1, actions + 1)]
    statement = text(f"UPDATE step SET rgb_file_digest = :digest WHERE episode_id = {number} AND number = :step")
    with journal.engine.begin() as connection:
        for values in digests:
            connection.execute(statement, values)


def set_depth_digests(journal: Journal) -> None:
    with journal.engine.begin() as connection:
        connection.execute(text("UPDATE step SET depth_digest = :digest"), {"digest": depth_digest(DEPTH)})


def lab(results: Path, *plans: CampaignPlan, seed: int = 1) -> Path:
    """Make a record with one or two episodes, and their files, for most trials of some campaigns."""
    chance = random.Random(seed)
    results.mkdir(exist_ok=True)
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        for given in plans:
            for trial in journal.find_or_create_campaign(given).trials:
                if chance.random() < 0.3:
                    run(journal, trial, void(), steps=1)
                if chance.random() < 0.9:
                    episode = run(journal, trial, stopped(success=chance.random() < 0.5))
                    journal.add_event("note", "the light was on", episode_id=episode.id)
                    if chance.random() < 0.2:
                        journal.judge(episode.id, Verdict(EndReason.STOP, False, "the tape says 1.20 m"), author="ada")
    draw(results)
    return results


@pytest.fixture(scope="module")
def lab_a(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of one campaign; tests take copies of it."""
    return lab(tmp_path_factory.mktemp("lab") / "a", plan())


@pytest.fixture(scope="module")
def two_campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lab(tmp_path_factory.mktemp("lab") / "b", plan(goals=GOALS), plan(goals=GOALS, seed=8))


def copy_of(results: Path, there: Path) -> Path:
    shutil.copytree(results, there)
    return there


def split(results: Path, into: Path, parts: int, seed: int) -> list[Path]:
    """Distribute the episodes of a record at random, with their files and numbers."""
    chance = random.Random(seed)
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        episodes = [row[0] for row in database.execute("SELECT id FROM episode ORDER BY id")]
    owner = {episode: chance.randrange(parts) for episode in episodes}
    made = []
    for part in range(parts):
        folder = into / f"part-{part}"
        shutil.copytree(results, folder)
        with closing(sqlite3.connect(folder / "vsnbench.db")) as database:
            for episode in (episode for episode in episodes if owner[episode] != part):
                for table in ("step", "verdict", "event"):
                    database.execute(f"DELETE FROM {table} WHERE episode_id = ?", (episode,))
                database.execute("DELETE FROM episode WHERE id = ?", (episode,))
                shutil.rmtree(folder / "episodes" / f"{episode:06d}", ignore_errors=True)
            database.commit()
        made.append(folder)
    return made


def content(results: Path) -> dict[str, Any]:
    """Return a record's content, with its files, independent of its row numbers."""
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        found = {}
        for episode in list_episodes(journal.engine, EpisodeFilter()):
            details = episode_record(journal.engine, episode.id)
            directory = results / episode.images_directory
            found[episode.uuid] = (
                replace(episode, id=0, campaign_id=0, images_directory=""),
                details.verdicts,
                details.events,
                details.provenance,
                episode_steps(journal.engine, episode.id),
                {str(file.relative_to(directory)): file.read_bytes() for file in sorted(directory.rglob("*.*"))},
            )
        states = {state.key: (state.trials, state.done) for state in list_campaigns(journal.engine)}
    return {"episodes": found, "campaigns": states}


def merged_into(target: Path, *others: Path, **options: Any) -> MergeResult:
    return merge(ResultsDirectory.locate(target, None, {}), [merge_source(str(other)) for other in others], **options)


def report(results: Path) -> dict[str, Any]:
    done = vsnbench(results, "report", "--format", "json")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def everything(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_a_record_that_was_split_in_five_is_whole_again_with_an_equal_report(
    tmp_path: Path, two_campaigns: Path
) -> None:
    whole = two_campaigns
    parts = split(whole, tmp_path, 5, seed=3)
    before = [everything(part) for part in parts]
    merged = merged_into(tmp_path / "again", *parts)
    assert content(tmp_path / "again") == content(whole)
    assert report(tmp_path / "again") == report(whole)
    assert len(merged.plan.new_episodes) == len(content(whole)["episodes"])
    assert [everything(part) for part in parts] == before
    of_a_reader = {"vsnbench.db-wal", "vsnbench.db-shm"}  # SQLite's files while a reader has the record open
    assert {path.name for path in (tmp_path / "again").iterdir()} - of_a_reader == {"episodes", "vsnbench.db"}
    assert not list((tmp_path / "again").rglob(".arriv*"))


def test_one_part_after_another_is_the_same_and_twice_is_the_same_as_once(tmp_path: Path, two_campaigns: Path) -> None:
    whole = two_campaigns
    parts = split(whole, tmp_path, 3, seed=4)
    for part in parts:
        merged_into(tmp_path / "again", part)
    assert {uuid: row[:1] + row[3:] for uuid, row in content(tmp_path / "again")["episodes"].items()} == {
        uuid: row[:1] + row[3:] for uuid, row in content(whole)["episodes"].items()
    }
    once = everything(tmp_path / "again" / "episodes")
    dump = dumped(tmp_path / "again")
    again = merged_into(tmp_path / "again", *parts)
    assert not again.plan.changes
    assert again.plan.known == len(content(whole)["episodes"])
    assert (everything(tmp_path / "again" / "episodes"), dumped(tmp_path / "again")) == (once, dump)


def dumped(results: Path) -> list[str]:
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        return [line for line in database.iterdump() if 'INTO "process"' not in line and "sqlite_sequence" not in line]


def test_two_records_of_a_condition_become_one_campaign_and_first_results_count(
    tmp_path: Path,
) -> None:
    monday, tuesday = lab(tmp_path / "monday", plan(), seed=1), lab(tmp_path / "tuesday", plan(), seed=2)
    merged = merged_into(monday, tuesday)
    with Journal.open(sqlite_url(monday / "vsnbench.db")) as journal:
        assert len(list_campaigns(journal.engine)) == 1
        results = [one for one in list_episodes(journal.engine, EpisodeFilter()) if one.success is not None]
        counted = [one for one in results if episode_record(journal.engine, one.id).counts]
    assert merged.plan.second_results == len(results) - len(counted) > 0
    assert not merged.plan.new_campaigns


def test_verdicts_that_one_side_lacks_are_added_and_move_the_episode_on(tmp_path: Path, lab_a: Path) -> None:
    here, there = copy_of(lab_a, tmp_path / "here"), copy_of(lab_a, tmp_path / "there")
    with Journal.open(sqlite_url(there / "vsnbench.db")) as journal:
        judged = next(one for one in list_episodes(journal.engine, EpisodeFilter()) if one.success)
        journal.judge(judged.id, Verdict(EndReason.ABORTED, None, "the door was shut"), author="ada")
    assert len(merged_into(here, there).plan.updates) == 1
    assert content(here)["episodes"] == content(there)["episodes"]
    assert content(here)["episodes"][judged.uuid][0].outcome == "void"
    assert not merged_into(here, there).plan.changes
    assert not merged_into(there, here).plan.updates


def change(results: Path, statement: str) -> None:
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        database.execute("PRAGMA ignore_check_constraints = ON")
        database.execute(statement)
        database.commit()


@pytest.mark.parametrize(
    ("statement", "line"),
    [
        ("UPDATE step SET action = 'STOP' WHERE episode_id = 1 AND number = 1", "its steps differ"),
        ("UPDATE step SET rgb_digest = 'blake3:2' WHERE number = 3", "the rgb_digest of its step 3 differs"),
        ("UPDATE step SET depth_digest = NULL WHERE number = 2", "the depth_digest of its step 2 differs"),
        (
            "UPDATE step SET depth_digest = replace(depth_digest, 'blake3', 'sha256')",
            "the depth_digest of its step 1, made with blake3 and sha256, cannot be compared",
        ),
        ("UPDATE episode SET actions = 9 WHERE id = 1", "its actions differs"),
        ("UPDATE process SET command = 'other'", "its process differs"),
        (
            "UPDATE verdict SET success = 1 - success WHERE episode_id = 1 OR success IS NOT NULL",
            "its verdicts contradict",
        ),
        ("UPDATE campaign SET seed = seed + 1", "the campaign .* of .* differs from that of the same hash"),
        ("UPDATE site SET content = replace(content, '0.1', '0.2')", "the site .* differs"),
        ("UPDATE episode SET state = 'finished' WHERE id = 1", "is damaged"),
        ("UPDATE episode SET images_directory = '../../etc'", "leads out of it"),
    ],
)
def test_a_contradiction_is_named_and_nothing_is_written(
    tmp_path: Path, lab_a: Path, statement: str, line: str
) -> None:
    here, there = copy_of(lab_a, tmp_path / "here"), copy_of(lab_a, tmp_path / "there")
    with Journal.open(sqlite_url(there / "vsnbench.db")) as journal:
        run(journal, journal.find_or_create_campaign(plan(seed=9)).trials[0], stopped(success=True))
    draw(there)
    change(there, statement)
    before = dumped(here), everything(here / "episodes")
    with pytest.raises(RecordError, match=line) as caught:
        merged_into(here, there)
    assert "\n" not in str(caught.value)
    assert (dumped(here), everything(here / "episodes")) == before


def test_what_still_runs_there_is_left_out_and_said(tmp_path: Path, lab_a: Path) -> None:
    there = copy_of(lab_a, tmp_path / "there")
    with Journal.open(sqlite_url(there / "vsnbench.db")) as journal:
        begun(journal, journal.find_or_create_campaign(plan(seed=9)).trials[0])
        merged = merged_into(tmp_path / "here", there)
    assert merged.plan.active == [1]
    said = vsnbench(tmp_path, "db", "merge", str(there), "--results", str(tmp_path / "further"))
    assert "1 episode still running and left out" in said.stdout
    with Journal.open(sqlite_url(tmp_path / "here" / "vsnbench.db")) as journal:
        assert {one.outcome for one in list_episodes(journal.engine, EpisodeFilter())} <= {"success", "failure", "void"}
        assert len(list_campaigns(journal.engine)) == 2


def test_images_that_are_not_there_are_named_and_only_left_behind_when_asked(tmp_path: Path, lab_a: Path) -> None:
    there = copy_of(lab_a, tmp_path / "there")
    shutil.rmtree(there / "episodes")
    with pytest.raises(
        RecordError, match=r"lacks the images of \d+ of its episodes, the first of which is 1 .*--without-images"
    ):
        merged_into(tmp_path / "here", there)
    assert not (tmp_path / "here").exists()
    merged = merged_into(tmp_path / "here", there, without_images=True)
    assert merged.without_files == len(merged.plan.new_episodes)
    with Journal.open(sqlite_url(tmp_path / "here" / "vsnbench.db")) as journal:
        assert {one.images_directory for one in list_episodes(journal.engine, EpisodeFilter())} == {""}


def test_links_out_of_the_other_directory_are_not_followed(tmp_path: Path, lab_a: Path) -> None:
    there = copy_of(lab_a, tmp_path / "there")
    secret = tmp_path / "secret"
    secret.write_text("a key")
    first = there / "episodes" / "000001"
    (first / "rgb" / "0009.jpg").symlink_to(secret)
    (first / "more").symlink_to(tmp_path)
    merged_into(tmp_path / "here", there)
    assert b"a key" not in everything(tmp_path / "here" / "episodes").values()
    assert not any(path.is_symlink() for path in (tmp_path / "here").rglob("*"))


def test_a_dry_run_says_what_would_come_and_writes_nothing(tmp_path: Path, lab_a: Path) -> None:
    there = copy_of(lab_a, tmp_path / "there")
    words = ("db", "merge", str(there), "--results", str(tmp_path / "here"))
    told = vsnbench(tmp_path, *words, "--dry-run", "--json")
    assert not (tmp_path / "here").exists()
    assert told.returncode == 0, told.stderr
    done = vsnbench(tmp_path, *words, "--json")
    assert {**json.loads(done.stdout), "dry_run": True} == json.loads(told.stdout)
    assert json.loads(done.stdout)["new_episodes"] == len(content(there)["episodes"])
    assert "nothing to do" in vsnbench(tmp_path, *words).stdout


@pytest.mark.parametrize(
    ("other", "line"),
    [
        ("{here}", "is the target of the merge"),
        ("{here}/vsnbench.db", "is the target of the merge"),
        ("{link}", "is the target of the merge"),
        ("{nowhere}", "no record at"),
        ("{empty}", "contains no record"),
        ("{newer}", "{newer} was written by a newer vsnbench"),
        ("{shopping}", "is not a database"),
        ("nonsense://x", "names no database"),
    ],
)
def test_what_cannot_be_merged_is_one_line(tmp_path: Path, lab_a: Path, other: str, line: str) -> None:
    names = {name: tmp_path / name for name in ("here", "link", "nowhere", "empty", "newer", "shopping")}
    copy_of(lab_a, names["here"])
    names["link"].symlink_to(names["here"])
    for name in ("empty", "newer", "shopping"):
        names[name].mkdir()
    (names["empty"] / "vsnbench.db").touch()
    (names["shopping"] / "vsnbench.db").write_text("milk, bread and a longer list than that" * 30)
    Journal.open(sqlite_url(names["newer"] / "vsnbench.db")).close()
    change(names["newer"], "UPDATE alembic_version SET version_num = '9999'")
    before = dumped(names["here"])
    done = vsnbench(tmp_path, "db", "merge", other.format(**names), "--results", str(names["here"]))
    assert done.returncode in (1, 2)
    assert done.stderr.count("\n") == 1
    assert line.format(**names) in done.stderr
    assert dumped(names["here"]) == before


def test_a_record_of_the_oldest_schema_is_upgraded_on_a_copy(tmp_path: Path) -> None:
    there = tmp_path / "there"
    there.mkdir()
    written = Path(__file__).parents[1] / "data" / "records" / "0001.sql"
    with closing(sqlite3.connect(there / "vsnbench.db")) as database:
        database.executescript(written.read_text(encoding="utf-8"))
    before = everything(there)
    merged = merged_into(tmp_path / "here", there, without_images=True)
    assert merged.plan.new_episodes
    assert everything(there) == before
    assert report(tmp_path / "here")["models"]


SINCE_0012 = {"moment", "verdicts_differ", "distance_m", "distance_low_m", "distance_high_m"}
SINCE_0012 |= {"odometry_m", "odometry_low_m", "odometry_high_m"}
"""Columns of `placement`."""


def as_of_0004(results: Path) -> Path:
    """Reduce a record to the content of the schema before digests."""
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        for image in ("rgb", "depth"):
            database.execute(f"UPDATE step SET {image}_digest = replace({image}_digest, 'blake3:', '')")
            database.execute(f"ALTER TABLE step RENAME COLUMN {image}_digest TO {image}_sha256")
        database.execute("UPDATE step SET depth_sha256 = ?", (hashlib.sha256(DEPTH.tobytes()).hexdigest(),))
        database.execute("UPDATE process SET start_ticks = 1")  # the process has ended
        for added_since in ("TABLE study_event", "TABLE released_claim"):
            database.execute(f"DROP {added_since}")
        database.execute("ALTER TABLE study DROP COLUMN log_heads")
        for column in ("movement", "rgb_file_digest", "depth_file_digest", "refusal"):
            database.execute(f"ALTER TABLE step DROP COLUMN {column}")
        database.execute("ALTER TABLE trial DROP COLUMN goal_id")
        database.execute("ALTER TABLE episode DROP COLUMN thinking_s")
        database.execute("DROP TABLE goal")
        (table,) = database.execute("SELECT sql FROM sqlite_master WHERE name = 'placement'").fetchone()
        table = table.replace("_moment UNIQUE (episode_id, moment)", " UNIQUE (episode_id)")
        kept = [line for line in table.splitlines() if line.split()[0] not in SINCE_0012]
        database.execute("DROP TABLE placement")
        database.execute("\n".join(kept))
        database.execute("UPDATE alembic_version SET version_num = '0004'")
        database.commit()
    return results


def digests(results: Path) -> set[str]:
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        return {row[0] for row in database.execute("SELECT rgb_digest FROM step")}


def test_a_record_and_its_copy_before_the_upgrade_merge_with_the_same_report(
    tmp_path: Path, two_campaigns: Path
) -> None:
    old = as_of_0004(copy_of(two_campaigns, tmp_path / "old"))
    new = copy_of(old, tmp_path / "new")
    assert vsnbench(new, "db", "upgrade").returncode == 0
    change(new, "UPDATE episode SET thinking_s = 0.1")  # the sum of a database that adds in another order
    assert digests(new) == {"sha256:" + "0" * 64}
    assert report(new) == report(two_campaigns)
    before = dumped(new), everything(old)
    merged = merged_into(new, old)
    assert (merged.plan.changes, merged.plan.known) == (False, len(content(new)["episodes"]))
    assert (dumped(new), everything(old)) == before


def test_what_was_hashed_in_two_ways_comes_together_as_it_is(tmp_path: Path, lab_a: Path) -> None:
    old = as_of_0004(lab(tmp_path / "old", plan(), seed=2))
    here = copy_of(lab_a, tmp_path / "here")
    assert merged_into(here, old).plan.new_episodes
    assert digests(here) == {"blake3:" + "0" * 64, "sha256:" + "0" * 64}
    assert not merged_into(here, old).plan.changes


def test_a_file_becomes_part_of_a_servers_record_and_comes_back(
    tmp_path: Path, postgresql: str, two_campaigns: Path
) -> None:
    there = two_campaigns
    files = ResultsDirectory.locate(tmp_path / "server", postgresql, {})
    merge(files, [merge_source(str(there))])
    with Journal.open(postgresql) as journal:
        assert len(list_episodes(journal.engine, EpisodeFilter())) == len(content(there)["episodes"])
        with journal.engine.begin() as connection:
            assert connection.execute(text("SELECT max(number) FROM step")).scalar_one() == 3
    assert not merge(files, [merge_source(str(there))]).plan.changes
    with pytest.raises(UsageError, match="is the target of the merge"):
        merge(files, [merge_source(postgresql)])
    merge(ResultsDirectory.locate(tmp_path / "back", None, {}), [merge_source(postgresql)], without_images=True)
    assert report(tmp_path / "back") == report(there)


def test_pictures_of_a_server_come_from_the_directories_of_its_robots(tmp_path: Path, postgresql: str) -> None:
    robots = [tmp_path / name for name in ("first", "second", "third")]
    with Journal.open(postgresql) as journal:
        trials = journal.find_or_create_campaign(plan()).trials
        for robot, trial in zip(robots, trials, strict=False):
            episode = run(journal, trial, stopped(success=True))
            draw_episode(robot / episode.images_directory, episode.uuid, 3)
        set_depth_digests(journal)
    whole = ResultsDirectory.locate(tmp_path / "all", None, {})
    with pytest.raises(RecordError, match="lacks the images of 1 of its episodes"):
        merge(whole, [merge_source(postgresql, robots[:2])])
    stray = robots[2] / episode.images_directory
    shutil.copytree(stray, robots[0] / episode.images_directory)
    with pytest.raises(RecordError, match="both have"):
        merge(whole, [merge_source(postgresql, robots)])
    shutil.rmtree(robots[0] / episode.images_directory)
    assert merge(whole, [merge_source(postgresql, robots)]).files.file_count == 3 * (3 * 2 + 1)
    with Journal.open(whole.database_url) as journal:
        for one in list_episodes(journal.engine, EpisodeFilter()):
            assert (whole.path / one.images_directory / "trajectory.tum").read_text() == one.uuid
    with pytest.raises(RecordError, match="does not exist"):
        merge_source(postgresql, [tmp_path / "nowhere"])


def test_an_archive_is_refused_by_what_it_is(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bundle.zip", "w") as bundle:
        bundle.writestr("vsnbench-bundle.txt", "")
    with pytest.raises(RecordError) as refused:
        merge_source(str(tmp_path / "bundle.zip"))
    assert refused.value.code == "archive-given"
