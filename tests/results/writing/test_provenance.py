"""A run records the versions of its packages and the hashes of their files."""

from pathlib import Path

import pytest

from vsnbench.results.writing.provenance import gather_provenance, package_hashes

WHEEL = """\
finch/__init__.py,sha256=47DEQpj8HBSa-_TImW-5JCeuQeRkm5NMpJWZG3hSuFU,0
finch/song.py,sha256=YWJj,3
finch-1.0.dist-info/METADATA,sha256=ZGVm,3
"""
ADDED = """\
../../../bin/finch,sha256=c2NyaXB0,6
finch-1.0.dist-info/INSTALLER,sha256=cGlw,4
finch-1.0.dist-info/RECORD,,
finch-1.0.dist-info/REQUESTED,sha256=,0
finch/__pycache__/song.cpython-311.pyc,,
"""


def hash_with(directory: Path, listed: str) -> str:
    information = directory / "finch-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: Finch\nVersion: 1.0\n")
    (information / "RECORD").write_text(listed)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(directory))
        package_hashes.cache_clear()
        found = package_hashes()["finch"]
    package_hashes.cache_clear()
    return found


def test_the_hash_of_a_package_is_the_same_on_every_machine(tmp_path: Path) -> None:
    of_wheel = hash_with(tmp_path / "wheel", WHEEL)
    installed = "".join(sorted((ADDED + WHEEL).splitlines(keepends=True)))
    assert hash_with(tmp_path / "installed", installed) == of_wheel
    assert hash_with(tmp_path / "windows", WHEEL.replace("\n", "\r\n")) == of_wheel


def test_a_changed_file_changes_the_hash_of_its_package(tmp_path: Path) -> None:
    assert hash_with(tmp_path / "edited", WHEEL.replace("YWJj", "YWJk")) != hash_with(tmp_path / "wheel", WHEEL)


def test_only_processes_that_run_trials_hash_their_packages() -> None:
    assert "package_hashes" not in gather_provenance().platform
    hashes = gather_provenance(of_run=True).platform["package_hashes"]
    assert len(hashes["numpy"]) == 64
    assert hashes.keys() <= gather_provenance().packages.keys()
