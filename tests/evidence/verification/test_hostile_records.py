"""A malicious record is refused or harmless: nothing in it is imported, followed or executed."""

import sys
from pathlib import Path

import pytest

from tests.evidence.verification.conftest import change, lines, verified
from vsnbench.errors import RecordError

SCHEMAS = {
    "view": ("ALTER TABLE event RENAME TO old", "CREATE VIEW event AS SELECT * FROM old"),
    "trigger": ("CREATE TRIGGER t AFTER INSERT ON step BEGIN DELETE FROM verdict; END",),
    "virtual table": ("CREATE VIRTUAL TABLE words USING fts5(text)",),
    "computed column": ("ALTER TABLE event ADD COLUMN more TEXT GENERATED ALWAYS AS (upper(text)) VIRTUAL",),
}


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_schema_that_can_run_code_is_refused_by_name(results: Path, kind: str) -> None:
    change(results, *SCHEMAS[kind])
    with pytest.raises(RecordError, match=kind):
        verified(results)


def test_a_malformed_schema_is_one_line(results: Path) -> None:
    change(
        results,
        "PRAGMA writable_schema = ON",
        "UPDATE sqlite_master SET sql = 'CREATE TABLE step(' WHERE name = 'step'",
    )
    with pytest.raises(RecordError, match="malformed"):
        verified(results)


@pytest.mark.parametrize("path", ["../../etc", "/etc", "episodes/../../..", "episodes/000001/rgb", "e" * 5000])
def test_a_path_that_leads_out_of_the_record_is_not_followed(results: Path, path: str) -> None:
    change(results, f"UPDATE episode SET images_directory = '{path}' WHERE id = 1")
    found = verified(results)
    assert not found.holds
    assert not any("passwd" in line for line in lines(found))


def test_a_database_that_is_a_link_is_refused(results: Path) -> None:
    (results / "vsnbench.db").rename(results / "other.db")
    (results / "vsnbench.db").symlink_to("other.db")
    with pytest.raises(RecordError, match="link"):
        verified(results)


def test_code_that_a_record_names_is_not_imported(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hostile_model.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    change(
        results,
        "UPDATE model SET name = 'hostile_model:Policy', code = '{\"class\": \"hostile_model:Policy\"}' WHERE id = 1",
        "UPDATE robot SET kind = 'hostile_model:Robot'",
    )
    found = verified(results, replay=None)
    assert not found.holds
    assert "hostile_model" not in sys.modules
    assert not (tmp_path / "executed").exists()


def test_markup_and_escapes_in_texts_are_printed_as_text(results: Path) -> None:
    hostile = "\x1b[31m<script>alert(1)</script>"
    change(results, f"UPDATE verdict SET goal_instance = '{hostile}' WHERE episode_id = 1")
    (line,) = [line for line in lines(verified(results)) if "goal_instance" in line]
    assert "\x1b" not in line
    assert "<script>" in line


def test_a_huge_cell_is_refused_before_it_is_read(results: Path) -> None:
    change(results, "UPDATE verdict SET note = zeroblob(80000000) WHERE id = 1")
    found = verified(results)
    assert not found.holds
    assert any("too big" in line for line in lines(found))


def test_a_record_of_a_newer_version_is_one_line(results: Path) -> None:
    change(results, "UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(RecordError, match="newer vsnbench"):
        verified(results)


def test_a_directory_without_a_record_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no record"):
        verified(tmp_path)
