"""A bundle contains the selected part of a record, and is reproducible to the byte."""

import csv
import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from importlib import metadata
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.interop.test_merge import GOALS, content, draw, lab
from tests.results.locked_study import lock_drawn, run_ranks
from tests.results.records_of_a_lab import begun, plan, run, stopped
from tests.shared_records import write_copy
from tests.study.studies import study_text
from vsnbench.evidence.bundle import record_cut
from vsnbench.evidence.bundle.archive import OpenBundle, open_bundle
from vsnbench.evidence.bundle.derived_files import write_derived_files
from vsnbench.evidence.bundle.signatures import check_signatures
from vsnbench.interop.merge import merge, merge_source
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.base import TableBase
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import gather_provenance, package_hashes
from vsnbench.study.lock import read_note


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of two campaigns with images."""
    return lab(tmp_path_factory.mktemp("lab") / "results", plan(goals=GOALS), plan(goals=GOALS, seed=8))


@pytest.fixture(scope="module")
def everything(record: Path, tmp_path_factory: pytest.TempPathFactory) -> OpenBundle:
    """An open bundle of the whole record."""
    return opened(record, tmp_path_factory.mktemp("bundle"), "--campaign", "1,2")


def opened(record: Path, directory: Path, *words: str) -> OpenBundle:
    done = vsnbench(record, "bundle", str(directory / "b.zip"), *words)
    assert done.returncode == 0, done.stderr
    return open_bundle(directory / "b.zip", directory / "opened")


def refusal(record: Path, target: Path, *words: str) -> str:
    """Return the only line of a refused command."""
    done = vsnbench(record, "bundle", str(target), *words)
    assert done.returncode in (1, 2), done.stdout
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def rows(database: Path, query: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(database)) as connection:
        return connection.execute(query).fetchall()


def by_name(database: Path, query: str) -> list[dict[str, object]]:
    """Return rows whose columns may be in another order."""
    with closing(sqlite3.connect(database)) as connection:
        connection.row_factory = sqlite3.Row
        return [dict(row) for row in connection.execute(query)]


def test_a_bundle_has_every_episode_as_it_was(record: Path, everything: OpenBundle, tmp_path: Path) -> None:
    assert everything.problems == ()
    copies = [shutil.copytree(place, tmp_path / name) for name, place in (("a", record), ("b", everything.results))]
    assert content(copies[0]) == content(copies[1])
    assert rows(record / "vsnbench.db", "SELECT id, uuid FROM episode") == rows(
        everything.results / "vsnbench.db", "SELECT id, uuid FROM episode"
    )


def test_the_same_record_gives_the_same_bytes_in_every_process(record: Path, tmp_path: Path) -> None:
    for seed in ("1", "2"):
        command = [sys.executable, "-m", "vsnbench.cli.main", "bundle", "--campaign", "1", "--results", str(record)]
        environment = os.environ | {"PYTHONHASHSEED": seed, "TZ": f"Etc/GMT+{seed}"}
        subprocess.run([*command, str(tmp_path / f"{seed}.zip")], env=environment, check=True, cwd=tmp_path)
    assert (tmp_path / "1.zip").read_bytes() == (tmp_path / "2.zip").read_bytes()


def test_only_the_chosen_campaigns_are_in_it(record: Path, tmp_path: Path) -> None:
    bundle = opened(record, tmp_path, "--campaign", "2")
    file = bundle.results / "vsnbench.db"
    expected = [row[0] for row in rows(record / "vsnbench.db", "SELECT episode.id FROM episode "
                "JOIN trial ON trial.id = trial_id WHERE campaign_id = 2 ORDER BY episode.id")]  # fmt: skip
    assert expected
    assert [row[0] for row in rows(file, "SELECT id FROM episode ORDER BY id")] == expected
    assert {int(path.name) for path in (bundle.results / "episodes").iterdir()} == set(expected)
    ((other,),) = rows(record / "vsnbench.db", "SELECT key FROM campaign WHERE id = 1")
    assert str(other).encode() not in file.read_bytes()
    for table in ("step", "verdict", "event"):
        chosen = f"SELECT * FROM {table} WHERE episode_id IN ({', '.join(map(str, expected))}) ORDER BY 1, 2"
        assert by_name(file, chosen) == by_name(record / "vsnbench.db", chosen)
        assert rows(file, f"SELECT COUNT(*) FROM {table} WHERE episode_id IS NOT NULL") == rows(
            record / "vsnbench.db", chosen.replace("*", "COUNT(*)", 1).partition(" ORDER")[0]
        )


def test_every_table_of_the_schema_has_a_rule() -> None:
    owned = {table.name for table in record_cut._owned()}
    used = {key.column.table.name for table in TableBase.metadata.sorted_tables for key in table.foreign_keys}
    assert {table.name for table in TableBase.metadata.sorted_tables} - owned - used == {"released_claim"}


def test_what_follows_from_the_record_is_rebuilt_to_the_byte(everything: OpenBundle, tmp_path: Path) -> None:
    write_derived_files(everything.results, tmp_path)
    rebuilt = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert rebuilt >= {"report/report.json", "tables/episodes.csv", "environment.json"}
    for name in rebuilt:
        assert (tmp_path / name).read_bytes() == (everything.directory / name).read_bytes(), name


def test_bundling_does_not_write_to_the_record(record: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in record.rglob("*") if path.is_file()}
    opened(record, tmp_path, "--campaign", "1")
    assert {path: path.read_bytes() for path in record.rglob("*") if path.is_file()} == before


def test_without_images_only_rows_and_tables_remain(record: Path, tmp_path: Path) -> None:
    bundle = opened(record, tmp_path, "--campaign", "1", "--without", "images")
    assert not (bundle.results / "episodes").exists()
    assert rows(bundle.results / "vsnbench.db", "SELECT DISTINCT images_directory FROM episode") == [("",)]


def test_a_missing_image_is_named(record: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(record, tmp_path / "copy")
    next((copy / "episodes/000001/depth").iterdir()).unlink()
    assert "episode 1: depth/" in refusal(copy, tmp_path / "b.zip", "--campaign", "1")
    assert not (tmp_path / "b.zip").exists()
    assert not list(tmp_path.glob(".*"))


def test_links_and_other_files_of_an_episode_are_left_out(record: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(record, tmp_path / "copy")
    (copy / "episodes/000001/rgb/9999.jpg").symlink_to("/etc/passwd")
    (copy / "episodes/000001/episode.rrd").write_bytes(b"derived")
    (copy / "episodes/000001/notes of ada.txt").write_bytes(b"private")
    bundle = opened(copy, tmp_path, "--campaign", "1")
    assert {path.name for path in (bundle.results / "episodes/000001").iterdir()} == {"rgb", "depth", "trajectory.tum"}
    assert not (bundle.results / "episodes/000001/rgb/9999.jpg").exists()


def test_a_link_in_place_of_an_image_is_refused(record: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(record, tmp_path / "copy")
    image = next((copy / "episodes/000001/rgb").iterdir())
    image.unlink()
    image.symlink_to("/etc/passwd")
    assert "episode 1: rgb/" in refusal(copy, tmp_path / "b.zip", "--campaign", "1")


def test_an_existing_file_stays(record: Path, tmp_path: Path) -> None:
    (tmp_path / "b.zip").write_bytes(b"mine")
    assert "already exists" in refusal(record, tmp_path / "b.zip", "--campaign", "1")
    assert (tmp_path / "b.zip").read_bytes() == b"mine"


def test_a_running_episode_is_named(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(plan()).trials
        assert "no episodes to bundle" in refusal(tmp_path, tmp_path / "b.zip", "--campaign", "1")
        running = begun(journal, trials[0])
        assert f"episode {running.id} is running" in refusal(tmp_path, tmp_path / "b.zip", "--campaign", "1")


def test_author_licence_and_citation_come_from_the_configuration(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "vsnbench.toml").write_text(
        '[bundle]\nauthor = "Ada Lovelace; Grace Hopper"\nlicence = "CC-BY-4.0"\ncitation = "Lovelace 2026"\n'
    )
    monkeypatch.chdir(tmp_path)
    bundle = opened(record, tmp_path / "there", "--campaign", "1", "--without", "images")
    described = json.loads((bundle.directory / "croissant.json").read_text())
    assert [person["name"] for person in described["creator"]] == ["Ada Lovelace", "Grace Hopper"]
    assert (described["license"], described["citeAs"]) == ("CC-BY-4.0", "Lovelace 2026")
    assert "Lovelace 2026" in (bundle.directory / "README.md").read_text()


def test_weights_are_added_only_when_asked_for(tmp_path: Path) -> None:
    (tmp_path / "weights").mkdir()
    (tmp_path / "weights/il.ckpt").write_bytes(b"weights")
    sha256 = hashlib.sha256(b"weights").hexdigest()
    record = lab(tmp_path / "results", plan())
    assert "weights/" not in str(opened(record, tmp_path / "a", "--campaign", "1").files)
    with closing(sqlite3.connect(record / "vsnbench.db")) as database:
        database.execute("UPDATE model SET weights_sha256 = ?", (sha256,))
        database.commit()
    assert sha256 in refusal(record, tmp_path / "b.zip", "--campaign", "1", "--with-weights")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VSNBENCH_WEIGHTS", str(tmp_path / "weights"))
        bundle = opened(record, tmp_path / "c", "--campaign", "1", "--with-weights")
    assert (bundle.directory / f"weights/{sha256[:12]}.ckpt").read_bytes() == b"weights"


def test_scans_are_added_only_when_asked_for(tmp_path: Path) -> None:
    scan = tmp_path / "flat.scan.npz"
    scan.write_bytes(b"scan")
    scan.with_name("flat.yaml").write_text("")
    sha256 = hashlib.sha256(b"scan").hexdigest()
    record = lab(tmp_path / "results", plan())
    assert "no site" in refusal(record, tmp_path / "0.zip", "--campaign", "1", "--with-scan")
    with closing(sqlite3.connect(record / "vsnbench.db")) as database:
        ((content,),) = database.execute("SELECT content FROM site")
        database.execute(
            "UPDATE site SET content = ?", (json.dumps(json.loads(content) | {"scan": {"sha256": sha256}}),)
        )
        database.execute("UPDATE process SET command = ?", (f"vsnbench run --site {tmp_path}/flat.yaml",))
        database.commit()
    bundle = opened(record, tmp_path / "a", "--campaign", "1", "--with-scan")
    assert (bundle.directory / f"scans/{sha256[:12]}.scan.npz").read_bytes() == b"scan"
    scan.write_bytes(b"another")
    assert sha256 in refusal(record, tmp_path / "b.zip", "--campaign", "1", "--with-scan")


def study_record(directory: Path, trials: int, **changes: object) -> None:
    """Write a record with a campaign outside of the study, and a study with some of its 16 trials done."""
    write_copy(directory, _write_study, trials, study_text(**changes))


def _write_study(directory: Path, trials: int, text: str) -> None:
    lab(directory, plan(seed=99))
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        run_ranks(journal, lock_drawn(journal, text), range(trials))
    draw(directory)


def test_a_study_is_bundled_with_its_plan_log_and_report(tmp_path: Path) -> None:
    study_record(tmp_path / "results", 16)
    with Journal.open(sqlite_url(tmp_path / "results/vsnbench.db")) as journal:
        journal.unblind_study(1, "all trials are done")
    bundle = opened(tmp_path / "results", tmp_path, "--study", "1")
    assert bundle.problems == ()
    file = bundle.results / "vsnbench.db"
    for table in ("study", "study_arm", "study_trial", "study_entry", "study_event"):
        assert by_name(file, f"SELECT * FROM {table}") == by_name(
            tmp_path / "results/vsnbench.db", f"SELECT * FROM {table}"
        )
    assert rows(file, "SELECT COUNT(*) FROM campaign") == [(2,)]
    report = json.loads((bundle.directory / "report/study.json").read_text())
    assert len(report["trials"]) == 16
    found = {deviation["what"] for deviation in report["deviations"]}
    assert not found & {"record changed", "not verified"}, "episodes of other campaigns are not missing ones"
    assert (bundle.directory / "study/study.yaml").read_text() == study_text()


def test_the_lock_file_of_a_study_is_part_of_its_bundle(tmp_path: Path) -> None:
    study_record(tmp_path / "results", 16, blind=False)
    file = tmp_path / "plan.yaml"
    file.write_text(study_text(blind=False))
    assert vsnbench(tmp_path / "results", "study", "lock", str(file)).returncode == 0
    bundle = opened(tmp_path / "results", tmp_path, "--study", str(file))
    note = read_note(bundle.directory / "study/study.yaml")
    assert note is not None
    assert note == read_note(file)
    assert rows(bundle.results / "vsnbench.db", "SELECT uuid FROM study") == [(note.study,)]


def test_a_deleted_episode_stays_missing_in_a_bundle(tmp_path: Path) -> None:
    study_record(tmp_path / "results", 16)
    with Journal.open(sqlite_url(tmp_path / "results/vsnbench.db")) as journal:
        journal.unblind_study(1, "all trials are done")
    with closing(sqlite3.connect(tmp_path / "results/vsnbench.db")) as database:
        (number,) = database.execute("SELECT MAX(episode_id) - 3 FROM step").fetchone()
        for table, column in (("step", "episode_id"), ("verdict", "episode_id"), ("episode", "id")):
            database.execute(f"DELETE FROM {table} WHERE {column} = ?", (number,))
        database.commit()
    bundle = opened(tmp_path / "results", tmp_path, "--study", "1", "--without", "images")
    report = json.loads((bundle.directory / "report/study.json").read_text())
    assert f"episode {number} of this record is missing" in str(report["deviations"])
    assert "an episode was deleted" in str(report["deviations"])


@pytest.mark.parametrize(
    ("trials", "changes", "named"),
    [(16, {}, "is blind"), (5, {}, "is blind"), (5, {"blind": False}, "is not over: 11 of its trials are left")],
)
def test_a_study_that_is_blind_or_not_over_is_refused(
    tmp_path: Path, trials: int, changes: dict[str, object], named: str
) -> None:
    study_record(tmp_path / "results", trials, **changes)
    assert named in refusal(tmp_path / "results", tmp_path / "b.zip", "--study", "1")
    assert "which is bundled as a whole" in refusal(tmp_path / "results", tmp_path / "b.zip", "--campaign", "2")


def test_a_study_that_another_process_runs_is_refused(tmp_path: Path) -> None:
    study_record(tmp_path / "results", 16, blind=False)
    with Journal.open(sqlite_url(tmp_path / "results/vsnbench.db")) as journal:
        journal.note_in_study(1, "session", "eva")
        assert "is run by" in refusal(tmp_path / "results", tmp_path / "b.zip", "--study", "1")


def test_the_tables_load_in_a_library_for_croissant(everything: OpenBundle) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    dataset = mlcroissant.Dataset(everything.directory / "croissant.json")
    assert not dataset.metadata.issues.report()
    for name in ("campaigns", "episodes", "steps", "verdicts"):
        with (everything.directory / f"tables/{name}.csv").open(newline="") as file:
            expected = list(csv.DictReader(file))
        loaded = list(dataset.records(name))
        assert len(loaded) == len(expected) > 0
        for mine, theirs in zip(expected, loaded, strict=True):
            assert {f"{name}/{column}" for column in mine} == set(theirs)
            for column, text in mine.items():
                assert same(text, theirs[f"{name}/{column}"]), (column, text, theirs[f"{name}/{column}"])


def same(text: str, value: object) -> bool:
    """Return whether a library reads a cell with its written value."""
    if isinstance(value, bytes):
        return value.decode() == text
    if text == "":
        return value is None or value != value  # NaN and NaT
    if isinstance(value, bool) or text in ("True", "False"):
        return str(value) == text
    return float(text) == value if isinstance(value, int | float) else str(value)[:19] == text.replace("T", " ")[:19]


def test_the_environment_has_commands_and_packages_with_hashes(tmp_path: Path) -> None:
    record = tmp_path / "results"
    record.mkdir()
    with Journal.open(sqlite_url(record / "vsnbench.db"), gather_provenance(of_run=True)) as journal:
        for trial in journal.find_or_create_campaign(plan()).trials:
            run(journal, trial, stopped(success=True))
    bundle = opened(record, tmp_path, "--campaign", "1", "--without", "images")
    content = json.loads((bundle.directory / "environment.json").read_text())
    (process,) = content["processes"]
    assert process["command"]
    packages = content["environments"][process["environment"]]["packages"]
    numpy = next(package for package in packages if package["name"] == "numpy")
    assert numpy == {"name": "numpy", "version": metadata.version("numpy"), "sha256": package_hashes()["numpy"]}
    assert "package_hashes" not in content["environments"][0]["platform"]


def test_a_record_on_a_server_is_bundled_as_an_sqlite_file(record: Path, tmp_path: Path, postgresql: str) -> None:
    files = ResultsDirectory.locate(tmp_path / "files", postgresql, {})
    Journal.open(postgresql).close()
    merge(files, [merge_source(str(record))])
    bundle = opened(files.path, tmp_path, "--campaign", "1,2", "--db", postgresql)
    assert bundle.problems == ()
    copies = [shutil.copytree(place, tmp_path / name) for name, place in (("a", record), ("b", bundle.results))]
    assert content(copies[0]) == content(copies[1])


@pytest.mark.parametrize("campaigns", ["1", "2", "1,2"])
def test_the_report_is_that_of_the_same_campaigns_in_the_record(record: Path, tmp_path: Path, campaigns: str) -> None:
    bundle = opened(record, tmp_path, "--campaign", campaigns, "--without", "images")
    reported = vsnbench(record, "report", "--campaign", campaigns, "--json").stdout
    assert json.loads((bundle.directory / "report" / "report.json").read_text()) == json.loads(reported)


def test_the_part_of_a_killed_bundling_is_removed(record: Path, tmp_path: Path) -> None:
    left = tmp_path / f".b.zip.{2**22 + 1}.part"
    left.write_bytes(b"half")
    opened(record, tmp_path, "--campaign", "1", "--without", "images")
    assert not left.exists()


def test_a_title_with_html_stays_text(tmp_path: Path) -> None:
    title = "<script>alert(1)</script> | [x](javascript:1)"
    study_record(tmp_path / "results", 16, blind=False, title=title)
    bundle = opened(tmp_path / "results", tmp_path, "--study", "1", "--without", "images")
    assert "<script>" not in (bundle.directory / "README.md").read_text()
    assert json.loads((bundle.directory / "croissant.json").read_text())["name"] == title


def test_a_signed_bundle_names_its_signer(record: Path, tmp_path: Path) -> None:
    key = tmp_path / "ada"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(key)], check=True)
    (tmp_path / "signers").write_text(f"ada@lab {key.with_suffix('.pub').read_text()}")
    bundle = opened(record, tmp_path, "--campaign", "1", "--without", "images", "--sign", str(key))
    (check,) = check_signatures(bundle, tmp_path / "signers")
    assert (check.is_valid, check.signer) == (True, "ada@lab")
