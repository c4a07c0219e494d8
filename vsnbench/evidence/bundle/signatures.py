"""Signatures of a bundle's manifest with the SSH keys that its authors already have."""

import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vsnbench.errors import RecordError, UsageError
from vsnbench.evidence.bundle.archive import OpenBundle
from vsnbench.text.sanitize import sanitize

NAMESPACE = "vsnbench"
"""Purpose in the signature: a signature for another purpose, such as of a commit, is not valid here."""
_GOOD_KEY = re.compile(r"Good \"vsnbench\" signature .*with (\S+ key \S+)")


@dataclass(frozen=True, slots=True)
class SignatureCheck:
    """Result of the check of a signature."""

    file: Path
    signer: str
    """Principal of the signers file whose key signed the manifest; empty if the key is not in the file."""
    key: str
    """Type and fingerprint of the key; empty if the signature is not one of this manifest."""

    @property
    def is_valid(self) -> bool:
        """Whether a known signer signed this manifest."""
        return bool(self.signer and self.key)


def sign(manifest: bytes, key: Path) -> bytes:
    """Return a signature of a manifest; `ssh-keygen` asks for a passphrase on the terminal.

    Raises:
        UsageError: the key cannot be used.
    """
    done = _ssh_keygen(["-Y", "sign", "-n", NAMESPACE, "-f", str(key)], manifest)
    if done.returncode or not done.stdout:
        raise UsageError(f"cannot sign with {key}: {_line(done.stderr)}", advice="name an SSH key", code="invalid-key")
    return done.stdout


def check_signatures(bundle: OpenBundle, signers: Path) -> tuple[SignatureCheck, ...]:
    """Check the signatures of a bundle's manifest; the files themselves are compared by `open_bundle`.

    Args:
        bundle: the bundle.
        signers: file of principals and public keys, as in ALLOWED SIGNERS of `man ssh-keygen`.

    Raises:
        UsageError: the file of the signers, or `ssh-keygen`, is missing.
        RecordError: the manifest cannot be read.
    """
    if not signers.is_file():
        raise UsageError(f"no file of signers at {signers}", advice="each of its lines is: NAME ssh-ed25519 AAAA…")
    try:
        manifest = bundle.manifest.read_bytes()
    except OSError as error:
        raise RecordError(f"cannot read {bundle.manifest}: {error.strerror}") from error
    return tuple(_check(file, manifest, signers) for file in bundle.signatures)


def _check(file: Path, manifest: bytes, signers: Path) -> SignatureCheck:
    signature = ["-n", NAMESPACE, "-s", str(file)]
    good = _ssh_keygen(["-Y", "check-novalidate", *signature], manifest)
    key = _GOOD_KEY.search((good.stdout + good.stderr).decode("utf-8", "replace")) if good.returncode == 0 else None
    if key is None:
        return SignatureCheck(file, "", "")
    found = _ssh_keygen(["-Y", "find-principals", "-s", str(file), "-f", str(signers)], b"")
    for signer in found.stdout.decode("utf-8", "replace").splitlines() if found.returncode == 0 else ():
        verify = ["-Y", "verify", *signature, "-f", str(signers), "-I", signer]
        if _ssh_keygen(verify, manifest).returncode == 0:
            return SignatureCheck(file, sanitize(signer), key[1])
    return SignatureCheck(file, "", key[1])


def _ssh_keygen(arguments: Sequence[str], given: bytes) -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(["ssh-keygen", *arguments], input=given, capture_output=True, check=False)
    except FileNotFoundError as error:
        raise UsageError(
            "signatures require the program ssh-keygen", advice="install openssh-client", code="missing-program"
        ) from error


def _line(stderr: bytes) -> str:
    return sanitize(" ".join(stderr.decode("utf-8", "replace").split()))[:200]
