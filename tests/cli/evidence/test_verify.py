"""`vsnbench verify`: output, exit codes and signer."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from tests.cli.test_record_verbs import vsnbench as bundle
from tests.evidence.verification.conftest import change
from tests.shared_records import small_record
from vsnbench.evidence.bundle.archive import open_bundle


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record, and a signed bundle of it."""
    place = tmp_path_factory.mktemp("place")
    results = shutil.copytree(small_record(tmp_path_factory), place / "results")
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", "key"], check=True, cwd=place)
    words = ("bundle", "--campaign", "1", "--sign", str(place / "key"), str(place / "signed.zip"))
    assert bundle(results, *words).returncode == 0
    (place / "signers").write_text(f"ada {(place / 'key.pub').read_text()}")
    return place


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setenv("COLUMNS", "80")
    return lambda *words: vsnbench(monkeypatch, capsys, "verify", *map(str, words))


def test_an_intact_bundle_ends_with_0_and_names_the_signer(place: Path, typed) -> None:
    answer = typed(place / "signed.zip", "--replay", "all", "--signers", place / "signers")
    assert (answer.code, answer.err) == (0, "")
    assert "signed by ada with ED25519 key SHA256:" in answer.out
    assert "everything that could be checked holds" in answer.out
    assert max(map(len, answer.out.partition("\n\n")[0].splitlines())) <= 80


def test_findings_end_with_1_one_line_each_and_as_json(place: Path, tmp_path: Path, typed) -> None:
    results = Path(shutil.copytree(place / "results", tmp_path / "results"))
    change(results, "UPDATE verdict SET success = 1 - success WHERE id = 1")
    answer = typed(results)
    assert answer.code == 1
    assert "verdict 1: success: " in answer.out
    found = json.loads(typed(results, "--json").out)
    assert found["holds"] is False
    failed = {check["check"]: check["failed"] for check in found["checks"]}
    assert failed == {"values": 0, "files": 0, "verdicts": 1, "studies": 0}
    (finding,) = [finding for check in found["checks"] for finding in check["findings"]]
    assert finding["where"] == "verdict 1: success"


def test_an_unknown_signer_and_a_missing_signature_do_not_hold(place: Path, tmp_path: Path, typed) -> None:
    (tmp_path / "others").write_text(
        (place / "signers").read_text().replace("AAAAC3NzaC1lZDI1NTE5AAAAI", "AAAAC3NzaC1lZDI1NTE5AAAAJ")
    )
    unknown = typed(place / "signed.zip", "--signers", tmp_path / "others")
    assert (unknown.code, "not by a signer of" in unknown.out) == (1, True)
    directory = open_bundle(place / "signed.zip", tmp_path / "bundle").directory
    shutil.rmtree(directory / "signatures")
    unsigned = typed(directory, "--signers", place / "signers")
    assert (unsigned.code, "the bundle is not signed" in unsigned.out) == (1, True)
