"""Bundles of unknown origin are unpacked safely, and every difference from the manifest is found."""

import hashlib
import io
import os
import random
import re
import stat
import struct
import subprocess
import zipfile
from pathlib import Path

import pytest

from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.archive import (
    FORMAT_FILE,
    MANIFEST,
    BundleProblem,
    Mismatch,
    format_line,
    manifest_lines,
    open_bundle,
)
from vsnbench.evidence.bundle.stored_zip import StoredZipWriter

FILES = {
    "results/vsnbench.db": bytes(range(256)) * 40,
    "results/episodes/000001/rgb/0001.jpg": b"\xff\xd8 picture \xff\xd9",
    "results/empty.txt": b"",
    "report/report.json": b"{}\n",
}


def contents(**more: bytes) -> dict[str, bytes]:
    """Return the files of a small bundle, in order."""
    files = {FORMAT_FILE: format_line(), **FILES}
    hashes = [(name, hashlib.sha256(content).hexdigest()) for name, content in files.items()]
    return {**files, MANIFEST: manifest_lines(hashes).encode(), **more}


def write(path: Path, files: dict[str, bytes]) -> Path:
    with path.open("wb") as file:
        writer = StoredZipWriter(file)
        for name, content in files.items():
            writer.add(name, io.BytesIO(content), len(content))
        writer.close()
    return path


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write(tmp_path / "b.zip", contents())


def refusal(path: Path, into: Path) -> str:
    with pytest.raises(RecordError) as refused:
        open_bundle(path, into)
    assert "\n" not in str(refused.value)
    return refused.value.code


def is_found(path: Path, into: Path) -> bool:
    """Return whether the bundle is refused or has a problem."""
    try:
        return bool(open_bundle(path, into).problems)
    except RecordError:
        return True


def test_an_intact_bundle_has_no_problems(bundle, tmp_path):
    opened = open_bundle(bundle, tmp_path / "into")
    assert opened.problems == ()
    assert opened.results == tmp_path / "into/results"
    assert {name: (tmp_path / "into" / name).read_bytes() for name in FILES} == FILES
    assert set(opened.files) == {FORMAT_FILE, *FILES}
    assert opened.signatures == ()


def test_other_programs_read_it(bundle, tmp_path):
    with zipfile.ZipFile(bundle) as archive:
        assert archive.testzip() is None
        assert {name: archive.read(name) for name in FILES} == FILES
        archive.extractall(tmp_path / "unpacked")
    checked = subprocess.run(
        ["sha256sum", "--check", "--strict", "--quiet", MANIFEST], cwd=tmp_path / "unpacked", capture_output=True
    )
    assert checked.returncode == 0, checked.stderr
    assert open_bundle(tmp_path / "unpacked", tmp_path / "unused").problems == ()
    assert not (tmp_path / "unused").exists()


def test_an_archive_with_the_fields_of_zip64_has_no_problems(monkeypatch, tmp_path):
    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 2000)
    monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 3)
    assert open_bundle(write(tmp_path / "b.zip", contents()), tmp_path / "into").problems == ()


def test_files_that_share_their_bytes_are_refused(tmp_path):
    """The directory of such an archive names one place several times, so that it would expand."""
    content = bytearray(write(tmp_path / "b.zip", contents()).read_bytes())
    size = len(FILES["results/vsnbench.db"])
    for entry in places(content, b"PK\x01\x02"):
        struct.pack_into("<2L", content, entry + 20, size, size)
        struct.pack_into("<L", content, entry + 42, content.index(b"PK\x03\x04", 4))
    (tmp_path / "b.zip").write_bytes(content)
    assert refusal(tmp_path / "b.zip", tmp_path / "into") == "truncated-bundle"


def places(content: bytes, signature: bytes) -> list[int]:
    return [match.start() for match in re.finditer(re.escape(signature), content)]


@pytest.mark.parametrize("seed", range(4))
def test_every_flipped_bit_is_found(bundle, tmp_path, seed):
    intact, random_ = bundle.read_bytes(), random.Random(seed)
    for number in range(100):
        place, bit = random_.randrange(len(intact)), 1 << random_.randrange(8)
        flipped = bytearray(intact)
        flipped[place] ^= bit
        bundle.write_bytes(flipped)
        assert is_found(bundle, tmp_path / f"into{number}"), f"byte {place}, bit {bit}"


def test_a_changed_file_is_named(tmp_path):
    files = contents()
    files["report/report.json"] = b"[]\n"
    opened = open_bundle(write(tmp_path / "b.zip", files), tmp_path / "into")
    assert opened.problems == (BundleProblem("report/report.json", Mismatch.CHANGED),)


def test_missing_and_additional_files_are_named(tmp_path):
    files = contents(**{"results/more.txt": b"x"})
    del files["results/empty.txt"]
    opened = open_bundle(write(tmp_path / "b.zip", files), tmp_path / "into")
    assert opened.problems == (
        BundleProblem("results/empty.txt", Mismatch.MISSING),
        BundleProblem("results/more.txt", Mismatch.ADDITIONAL),
    )


def test_signatures_are_listed_and_not_in_the_manifest(tmp_path):
    opened = open_bundle(write(tmp_path / "b.zip", contents(**{"signatures/1.sig": b"s"})), tmp_path / "into")
    assert opened.problems == ()
    assert [path.name for path in opened.signatures] == ["1.sig"]


def test_an_edited_manifest_is_found(tmp_path):
    files = contents()
    files[MANIFEST] += b"# a comment\n"
    opened = open_bundle(write(tmp_path / "b.zip", files), tmp_path / "into")
    assert opened.problems == (BundleProblem(MANIFEST, Mismatch.CHANGED),)


@pytest.mark.parametrize(
    "name",
    [
        "../outside",
        "results/../../outside",
        "/outside",
        "C:\\outside",
        "results\\outside",
        "results//outside",
        "./outside",
        ".hidden",
        "results/.arriving",
        "with blank",
        "new\nline",
        "umläut",
        "",
        "a" * 300,
        "results/vsnbench.db/below",
        "results/VSNBENCH.db",
        "results/vsnbench.db",
        "report",
    ],
)
def test_names_that_could_do_harm_are_refused(tmp_path, name):
    path = tmp_path / "b.zip"
    with path.open("wb") as file:
        writer = StoredZipWriter(file)
        for known, content in [*contents().items(), (name, b"evil")]:
            writer.add(known, io.BytesIO(content), len(content))
        writer.close()
    assert refusal(path, tmp_path / "deep/into") == "unsafe-bundle"
    assert not list(tmp_path.rglob("*outside*"))


def with_zipfile(path: Path, change) -> Path:
    """Write a bundle with Python's zipfile, which can do what the writer cannot."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in contents().items():
            archive.writestr(name, content)
        change(archive)
    return path


def test_a_compression_bomb_is_refused(tmp_path):
    bomb = with_zipfile(
        tmp_path / "b.zip", lambda archive: archive.writestr("bomb", bytes(10**7), zipfile.ZIP_DEFLATED)
    )
    assert refusal(bomb, tmp_path / "into") == "unsafe-bundle"
    assert not (tmp_path / "into/bomb").exists()


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFIFO])
def test_links_and_devices_become_regular_files_and_are_reported(tmp_path, kind):
    special = zipfile.ZipInfo("results/special")
    special.create_system, special.external_attr = 3, (kind | 0o777) << 16
    path = with_zipfile(tmp_path / "b.zip", lambda archive: archive.writestr(special, "/etc/passwd"))
    opened = open_bundle(path, tmp_path / "into")
    assert stat.S_ISREG((tmp_path / "into/results/special").lstat().st_mode)
    assert BundleProblem("results/special", Mismatch.ADDITIONAL) in opened.problems
    assert BundleProblem("", Mismatch.ARCHIVE) in opened.problems


def test_an_encrypted_file_is_refused(tmp_path):
    path = tmp_path / "b.zip"
    content = bytearray(write(path, contents()).read_bytes())
    content[places(content, b"PK\x01\x02")[1] + 8] |= 1
    path.write_bytes(content)
    assert refusal(path, tmp_path / "into") == "unsafe-bundle"


def test_a_file_that_claims_to_be_larger_than_the_archive_is_refused(tmp_path):
    path = tmp_path / "b.zip"
    content = bytearray(write(path, contents()).read_bytes())
    struct.pack_into("<2L", content, places(content, b"PK\x01\x02")[1] + 20, 2**31, 2**31)
    path.write_bytes(content)
    assert refusal(path, tmp_path / "into") == "truncated-bundle"


@pytest.mark.parametrize("field", [4, 6, 8, 10, 14, 18, 22])
def test_a_header_that_differs_from_the_directory_is_found(tmp_path, field):
    path = tmp_path / "b.zip"
    content = bytearray(write(path, contents()).read_bytes())
    content[places(content, b"PK\x03\x04")[1] + field] ^= 1
    path.write_bytes(content)
    opened = open_bundle(path, tmp_path / "into")
    assert opened.problems == (BundleProblem("results/vsnbench.db", Mismatch.ARCHIVE),)


def test_a_truncated_bundle_is_refused_at_every_length(bundle, tmp_path):
    intact = bundle.read_bytes()
    for number, length in enumerate(range(0, len(intact), 97)):
        bundle.write_bytes(intact[:length])
        assert refusal(bundle, tmp_path / f"into{number}") in {"truncated-bundle", "not-a-bundle"}


def test_a_newer_format_is_refused(tmp_path):
    files = contents(**{FORMAT_FILE: b"vsnbench bundle format 2\n"})
    assert refusal(write(tmp_path / "b.zip", files), tmp_path / "into") == "newer-bundle"


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06" + bytes(18), b"\x89PNG", os.urandom(4000)])
def test_another_file_is_not_a_bundle(tmp_path, content):
    (tmp_path / "b.zip").write_bytes(content)
    assert refusal(tmp_path / "b.zip", tmp_path / "into") == "not-a-bundle"


def test_a_directory_with_links_is_refused(bundle, tmp_path):
    open_bundle(bundle, tmp_path / "into")
    (tmp_path / "into/results/link").symlink_to("/etc")
    assert refusal(tmp_path / "into", tmp_path / "unused") == "unsafe-bundle"


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert refusal(tmp_path / "pipe", tmp_path / "into") == "record"


def test_a_directory_with_files_is_not_filled(bundle, tmp_path):
    (tmp_path / "into").mkdir()
    (tmp_path / "into/mine").touch()
    assert refusal(bundle, tmp_path / "into") == "record"
    assert [path.name for path in (tmp_path / "into").iterdir()] == ["mine"]
