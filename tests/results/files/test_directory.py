from pathlib import Path

import pytest

from vsnbench.errors import RecordError
from vsnbench.results.files import directory
from vsnbench.results.files.directory import ResultsDirectory


def test_an_option_goes_before_the_environment_and_that_before_the_default(tmp_path: Path) -> None:
    environment = {"VSNBENCH_RESULTS": str(tmp_path / "environment")}
    assert ResultsDirectory.locate(tmp_path / "option", None, environment).path == tmp_path / "option"
    assert ResultsDirectory.locate(None, None, environment).path == tmp_path / "environment"
    assert ResultsDirectory.locate(None, None, {}).path == Path("results")


def test_the_database_lies_in_the_directory_unless_a_url_says_otherwise(tmp_path: Path) -> None:
    assert ResultsDirectory.locate(tmp_path).database_label == str(tmp_path / "vsnbench.db")
    elsewhere = ResultsDirectory.locate(tmp_path, "postgresql+psycopg://lab:secret@host/results")
    assert elsewhere.database_url == "postgresql+psycopg://lab:secret@host/results"
    assert "secret" not in elsewhere.database_label


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
    monkeypatch.setattr(directory, "LOW_SPACE_BYTES", place.free_bytes() * 2)
    with pytest.raises(RecordError, match=r"has only \d+ MiB left"):
        place.prepare()


def test_a_database_elsewhere_is_named_as_it_can_be_typed_again(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'x.db'}"
    assert ResultsDirectory.locate(None, url, {}).options == f" --db {url}"


def test_a_new_results_directory_is_named_with_the_earlier_one_above_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "vsnbench.db").touch()
    (tmp_path / "walker").mkdir()
    monkeypatch.chdir(tmp_path / "walker")
    note = ResultsDirectory.locate(None, None, {}).new_record_note
    assert str(tmp_path / "walker" / "results") in note
    assert f"--results {tmp_path / 'results'}" in note
    monkeypatch.chdir(tmp_path)
    assert ResultsDirectory.locate(None, None, {}).new_record_note == ""
