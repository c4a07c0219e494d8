"""A bundle is signed with an SSH key and checked against a file of signers."""

import subprocess
from pathlib import Path

import pytest

from tests.evidence.bundle.test_archive import contents, write
from vsnbench.errors import UsageError
from vsnbench.evidence.bundle.archive import MANIFEST, OpenBundle, open_bundle
from vsnbench.evidence.bundle.signatures import check_signatures, sign


@pytest.fixture
def key(tmp_path: Path) -> Path:
    return new_key(tmp_path, "ada")


def new_key(directory: Path, name: str) -> Path:
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(directory / name)], check=True)
    return directory / name


def signers(directory: Path, **keys: Path) -> Path:
    lines = [f"{name}@lab.example {key.with_suffix('.pub').read_text()}" for name, key in keys.items()]
    (directory / "signers").write_text("".join(lines))
    return directory / "signers"


def signed(directory: Path, key: Path, **edited: bytes) -> OpenBundle:
    """Return an open bundle with a signature of its manifest, which may be edited afterwards."""
    files = contents()
    signature = sign(files[MANIFEST], key)
    bundle = write(directory / "b.zip", {**files, **edited, "signatures/1.sig": signature})
    return open_bundle(bundle, directory / "into")


def test_the_signature_of_a_known_signer_is_valid(tmp_path, key):
    bundle = signed(tmp_path, key)
    assert bundle.problems == ()
    (check,) = check_signatures(bundle, signers(tmp_path, ada=key))
    assert check.is_valid
    assert check.signer == "ada@lab.example"
    assert check.key.startswith("ED25519 key SHA256:")


def test_the_signature_of_an_unknown_key_is_not_valid(tmp_path, key):
    (check,) = check_signatures(signed(tmp_path, key), signers(tmp_path, eve=new_key(tmp_path, "eve")))
    assert not check.is_valid
    assert check.signer == ""
    assert check.key.startswith("ED25519 key SHA256:")


def test_the_signature_of_another_manifest_is_not_valid(tmp_path, key):
    bundle = signed(tmp_path, key, **{MANIFEST: contents()[MANIFEST] + b"\n"})
    (check,) = check_signatures(bundle, signers(tmp_path, ada=key))
    assert (check.is_valid, check.key) == (False, "")


def test_a_signature_for_another_purpose_is_not_valid(tmp_path, key):
    files = contents()
    for_git = subprocess.run(
        ["ssh-keygen", "-Y", "sign", "-n", "git", "-f", str(key)],
        input=files[MANIFEST],
        capture_output=True,
        check=True,
    ).stdout
    bundle = open_bundle(write(tmp_path / "b.zip", {**files, "signatures/1.sig": for_git}), tmp_path / "into")
    (check,) = check_signatures(bundle, signers(tmp_path, ada=key))
    assert not check.is_valid


@pytest.mark.parametrize("content", [b"", b"no key"])
def test_a_file_that_is_no_key_is_refused(tmp_path, content):
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(UsageError) as refused:
        sign(b"manifest", tmp_path / "file")
    assert refused.value.code == "invalid-key"
