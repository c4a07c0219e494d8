import json
import random
import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from tests.cli.test_record_verbs import vsnbench
from tests.database.records_of_a_lab import begun, plan, run, stopped, void
from vsnbench.database.campaign_plan import CampaignPlan
from vsnbench.database.journal import Journal
from vsnbench.database.queries import campaign_states, episode_details, episode_steps, list_episodes
from vsnbench.database.read_shapes import EpisodeFilter
from vsnbench.database_url import sqlite_url
from vsnbench.errors import RecordError, UsageError
from vsnbench.exchange.merge import Merged, merge, other_place
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.record.results import ResultsDirectory

GOALS = ("chair", "sofa", "bed", "toilet")


def image(uuid: str, number: int) -> bytes:
    """Stands for a picture: tells whose it is."""
    return f"{uuid} {number}".encode()


def draw(results: Path) -> None:
    """Give every episode of a record the files that it names."""
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        for episode in list_episodes(journal.engine, EpisodeFilter()):
            directory = results / episode.images_directory
            (directory / "rgb").mkdir(parents=True, exist_ok=True)
            for number in range(1, episode.actions + 1):
                (directory / "rgb" / f"{number:04d}.jpg").write_bytes(image(episode.uuid, number))
            (directory / "trajectory.tum").write_text(episode.uuid)


def lab(results: Path, *plans: CampaignPlan, seed: int = 1) -> Path:
    """A record with an episode or two for most trials of some campaigns, and their files."""
    chance = random.Random(seed)
    results.mkdir()
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        for given in plans or (plan(goals=GOALS), plan(goals=GOALS, seed=8)):
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


def split(results: Path, into: Path, parts: int, seed: int) -> list[Path]:
    """Deal the episodes of a record out at random, each with its files, numbers as they are."""
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
    """What a record says, by what does not depend on its numbers, its files included."""
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        found = {}
        for episode in list_episodes(journal.engine, EpisodeFilter()):
            details = episode_details(journal.engine, episode.id)
            directory = results / episode.images_directory
            found[episode.uuid] = (
                replace(episode, id=0, campaign_id=0, images_directory=""),
                details.verdicts,
                details.events,
                details.provenance,
                episode_steps(journal.engine, episode.id),
                {str(file.relative_to(directory)): file.read_bytes() for file in sorted(directory.rglob("*.*"))},
            )
        states = {state.key: (state.trials, state.done) for state in campaign_states(journal.engine)}
    return {"episodes": found, "campaigns": states}


def merged_into(target: Path, *others: Path, **options: Any) -> Merged:
    return merge(ResultsDirectory.locate(target, None, {}), [other_place(str(other)) for other in others], **options)


def report(results: Path) -> dict[str, Any]:
    done = vsnbench(results, "report", "--format", "json")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def everything(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_a_record_that_was_split_in_five_is_whole_again_with_an_equal_report(tmp_path: Path) -> None:
    whole = lab(tmp_path / "whole")
    parts = split(whole, tmp_path, 5, seed=3)
    before = [everything(part) for part in parts]
    merged = merged_into(tmp_path / "again", *parts)
    assert content(tmp_path / "again") == content(whole)
    assert report(tmp_path / "again") == report(whole)
    assert len(merged.plan.arrivals) == len(content(whole)["episodes"])
    assert [everything(part) for part in parts] == before
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["episodes", "vsnbench.db"]
    assert not list((tmp_path / "again").rglob(".arriv*"))


def test_one_part_after_another_is_the_same_and_twice_is_the_same_as_once(tmp_path: Path) -> None:
    whole = lab(tmp_path / "whole")
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
