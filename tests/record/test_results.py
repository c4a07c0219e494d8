from pathlib import Path

import pytest

from vsnbench.errors import RecordError
from vsnbench.record import results
from vsnbench.record.results import ResultsDirectory


def test_an_option_goes_before_the_environment_and_that_before_the_default(tmp_path: Path) -> None:
    environment = {"VSNBENCH_RESULTS": str(tmp_path / "environment")}
    assert ResultsDirectory.locate(tmp_path / "option", None, environment).path == tmp_path / "option"
    assert ResultsDirectory.locate(None, None, environment).path == tmp_path / "environment"
    assert ResultsDirectory.locate(None, None, {}).path == Path("results")


def test_the_database_lies_in_the_directory_unless_a_url_says_otherwise(tmp_path: Path) -> None:
    assert ResultsDirectory.locate(tmp_path).shown_database == str(tmp_path / "vsnbench.db")
    elsewhere = ResultsDirectory.locate(tmp_path, "postgresql+psycopg://lab:secret@host/results")
    assert elsewhere.database_url == "postgresql+psycopg://lab:secret@host/results"
    assert "secret" not in elsewhere.shown_database


def test_another_command_is_told_how_to_find_the_same_record(tmp_path: Path) -> None:
    assert ResultsDirectory.locate(None, None, {}).options == ""
    assert ResultsDirectory.locate(Path("my results"), None, {}).options == " --results 'my results'"
    elsewhere = ResultsDirectory.locate(None, "postgresql+psycopg://lab@host/results", {})
    assert elsewhere.options == " --db postgresql+psycopg://lab@host/results"


def test_preparing_makes_the_directory_and_leaves_only_its_own_folder(tmp_path: Path) -> None:
    place = ResultsDirectory.locate(tmp_path / "new" / "results")
    place.prepare()
    place.prepare()
    assert [path.name for path in place.path.iterdir()] == ["episodes"]


def test_a_directory_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RecordError, match=r"cannot write the results directory .*; choose another with --results"):
        ResultsDirectory.locate(tmp_path / "file" / "results").prepare()


def test_a_run_does_not_begin_on_a_nearly_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = ResultsDirectory.locate(tmp_path)
    monkeypatch.setattr(results, "LOW_SPACE_BYTES", place.free_bytes() * 2)
    with pytest.raises(RecordError, match=r"has only \d+ MiB left"):
        place.prepare()
