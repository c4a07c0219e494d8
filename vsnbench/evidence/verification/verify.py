"""Verifies a bundle or a results directory: all checks in order.

Nothing is written there, nothing in it is executed, and no network is used.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from vsnbench import __version__
from vsnbench.errors import RecordError, VsnbenchError
from vsnbench.evidence.bundle.archive import FORMAT_FILE, OpenBundle, open_bundle
from vsnbench.evidence.bundle.derived_files import STUDY_FILE
from vsnbench.evidence.bundle.signatures import check_signatures
from vsnbench.evidence.verification.against import check_against
from vsnbench.evidence.verification.checks import Check, Progress, Verification, finding
from vsnbench.evidence.verification.derived import check_derived_files
from vsnbench.evidence.verification.files import check_files
from vsnbench.evidence.verification.judgements import check_judgements
from vsnbench.evidence.verification.record import VerifiedRecord, open_copy
from vsnbench.evidence.verification.replay import check_replay
from vsnbench.evidence.verification.studies import check_studies
from vsnbench.evidence.verification.values import check_values
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.files.directory import DATABASE_NAME
from vsnbench.study.lock import LockNote, read_note


@dataclass(frozen=True, slots=True)
class VerifyOptions:
    """What to verify beyond what is always checked."""

    replay: int | None = 0
    """Number of simulated episodes to drive again; None for all."""
    signers: Path | None = None
    """File of principals and public keys whose signatures are trusted."""
    against: Path | None = None
    """Bundle or results directory with the same trials, to compare step by step."""


def verify(path: Path, progress: Progress, options: VerifyOptions | None = None) -> Verification:
    """Verify a bundle, as a file or unpacked, or a results directory.

    Raises:
        RecordError: it, or the one to compare with, is neither, or cannot be opened at all.
        UsageError: the file of the signers does not exist.
    """
    options = options or VerifyOptions()
    if not path.exists():
        raise RecordError(f"{path} does not exist")
    with ScratchDirectory("verify") as scratch, ExitStack() as stack:
        if path.is_dir() and not (path / FORMAT_FILE).exists():
            record = stack.enter_context(open_copy(path, scratch.path))
            checks, people = _record_checks(record, None, options, progress)
            checks += _against(record, options.against, scratch.path / "against", progress)
            return Verification(str(path), __version__, record.versions, tuple(checks), people)
        progress("comparing hashes", 0, 1)
        bundle = open_bundle(path, scratch.path / "bundle")
        progress("comparing hashes", 1, 1)
        archive_checks = [_hash_check(bundle), *_signature_checks(bundle, options.signers)]
        opening = Check("record", "databases")
        with opening.failing(f"results/{DATABASE_NAME}"):
            record = stack.enter_context(open_copy(bundle.results, scratch.path))
        if opening.failed:
            return Verification(str(path), __version__, (), (*archive_checks, opening), {})
        note = _note(bundle, archive_checks[0])
        checks, people = _record_checks(record, note, options, progress)
        checks += _against(record, options.against, scratch.path / "against", progress)
        derived = check_derived_files(bundle.directory, scratch.path, scratch.path / "made", note, progress)
        return Verification(str(path), __version__, record.versions, (*archive_checks, *checks, derived), people)


def _record_checks(
    record: VerifiedRecord, note: LockNote | None, options: VerifyOptions, progress: Progress
) -> tuple[list[Check], dict[str, int]]:
    judgements, people = check_judgements(record, progress)
    checks = [
        check_values(record, progress),
        check_files(record, progress),
        judgements,
        check_studies(record, note, progress),
    ]
    if options.replay != 0:
        checks.append(check_replay(record, options.replay, progress))
    return checks, people


def _against(record: VerifiedRecord, path: Path | None, scratch: Path, progress: Progress) -> list[Check]:
    if path is None:
        return []
    if not path.exists():
        raise RecordError(f"{path} does not exist")
    scratch.mkdir()
    is_results = path.is_dir() and not (path / FORMAT_FILE).exists()
    results = path if is_results else open_bundle(path, scratch / "bundle").results
    with open_copy(results, scratch) as other:
        return [check_against(record, other, str(path), progress)]


def _hash_check(bundle: OpenBundle) -> Check:
    """Compare every file with the manifest."""
    files = Check("hashes", "files", checked=len(bundle.files))
    for problem in bundle.problems:
        files.findings.append(finding(problem.path or "the end of the archive", str(problem.mismatch)))
        files.failed += 1
    return files


def _signature_checks(bundle: OpenBundle, signers: Path | None) -> list[Check]:
    if not bundle.signatures and signers is None:
        return []
    check = Check("signatures", "signatures")
    if signers is None:
        check.skip("name the keys that you trust with --signers", len(bundle.signatures))
        return [check]
    for signature in check_signatures(bundle, signers):
        name = signature.file.name
        if signature.is_valid:
            check.add([])
            check.notes.append(f"signed by {signature.signer} with {signature.key}")
        else:
            check.fail(
                name, f"not by a signer of {signers}" if signature.key else "is not a signature of this manifest"
            )
    if not bundle.signatures:
        check.fail("signatures", "the bundle is not signed")
    return [check]


def _note(bundle: OpenBundle, hashes: Check) -> LockNote | None:
    try:
        return read_note(bundle.directory / STUDY_FILE)
    except VsnbenchError as error:
        hashes.findings.append(finding("study", str(error)))
        return None
