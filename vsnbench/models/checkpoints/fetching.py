"""Downloads weights with resumption. The file appears only when it is complete and has the right hash or content."""

import hashlib
import http.client
import re
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.checkpoints.weights import file_sha256

Progress = Callable[[int, int | None], None]
"""Called with the number of bytes received, and the total size if it is known."""

_CHUNK_BYTES = 1 << 20
_TIMEOUT_S = 30.0
_CONTENT_RANGE = re.compile(r"bytes (\d+)-\d+/(\d+|\*)")


def fetch(
    url: str,
    destination: Path,
    sha256: str,
    progress: Progress = lambda _received, _total: None,
    *,
    known_digits: int = 64,
    check_content: Callable[[Path], object] | None = None,
) -> bool:
    """Download a file.

    A partial download stays in `<name>.<hash>.part` next to the destination, and the next call continues it.

    Args:
        url: address of the file.
        destination: path of the file.
        sha256: its hash; empty if it is not known, which `check_content` then makes up for.
        progress: called as bytes arrive.
        known_digits: digits of the hash; fewer than 64 if only its beginning is published.
        check_content: reads a file without a known hash, and raises `ModelError` if it is not the right one.

    Returns:
        False if the file was already there.

    Raises:
        UsageError: the URL or the hash is invalid, or another file is at the destination.
        ModelError: the download failed, or has another hash or content.
    """
    sha256 = sha256.lower().removeprefix("sha256:")
    by_content = check_content if not sha256 else None
    if by_content is None and not re.fullmatch(rf"[0-9a-f]{{{known_digits}}}", sha256):
        raise UsageError(
            f"--sha256 {sha256[:80]!r} is not a SHA-256, which has 64 hexadecimal digits", code="invalid-sha256"
        )
    if not url.startswith(("http://", "https://")):
        raise UsageError(f"{url!r} is not an http or https address", code="invalid-url")
    if destination.exists():
        if by_content is None:
            difference = "" if file_sha256(destination).startswith(sha256) else "its SHA-256 differs"
        else:
            difference = _wrong_content(destination, by_content)
        if not difference:
            return False
        raise UsageError(f"another file is at {destination} ({difference})", advice="move it first", code="file-exists")
    tag = sha256 or hashlib.sha256(url.encode()).hexdigest()
    part = destination.with_name(f"{destination.name}.{tag[:12]}.part")
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        _download(url, part, progress)
        if by_content is not None:
            _check_or_delete(part, url, by_content)
        elif not (found := file_sha256(part)).startswith(sha256):
            part.unlink()
            raise ModelError(
                f"{url}: SHA-256 is {found}, not {sha256}; file deleted", advice="check the link", code="wrong-sha256"
            )
        part.replace(destination)
    except OSError as error:
        raise ModelError(f"cannot write {destination}: {error.strerror or error}") from error
    return True


def _check_or_delete(part: Path, url: str, check_content: Callable[[Path], object]) -> None:
    """Check a download by its content, and delete it if it is another file."""
    if reason := _wrong_content(part, check_content):
        part.unlink()
        raise ModelError(f"{url}: {reason}; file deleted", advice="check the link", code="wrong-content")


def _wrong_content(file: Path, check_content: Callable[[Path], object]) -> str:
    """Return why a file has another content; empty if it has not."""
    try:
        check_content(file)
    except ModelError as error:
        return str(error).removeprefix(f"{file}: ")
    return ""


def _download(url: str, part: Path, progress: Progress) -> None:
    """Download the rest of a file."""
    received = part.stat().st_size if part.exists() else 0
    request = urllib.request.Request(url, headers={"Range": f"bytes={received}-"} if received else {})  # noqa: S310 - checked
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as answer:  # noqa: S310 - scheme checked by fetch
            received = _resumed_at(answer, received)
            length = answer.headers.get("Content-Length")
            total = received + int(length) if length is not None and length.isdecimal() and len(length) < 19 else None
            with part.open("r+b" if received else "wb") as file:
                file.seek(received)
                file.truncate()
                progress(received, total)
                while chunk := answer.read(_CHUNK_BYTES):
                    file.write(chunk)
                    received += len(chunk)
                    progress(received, total)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return  # the file is complete; its hash is checked
        raise ModelError(
            f"{url}: the server answered {error.code} {error.reason}",
            advice="open the address in a browser, and use the direct link of the file",
            code="download-failed",
        ) from error
    except (urllib.error.URLError, TimeoutError, ConnectionError, http.client.HTTPException) as error:
        reason = getattr(error, "reason", None) or error
        raise ModelError(
            f"{url}: the download stopped ({reason})", advice=_resume_advice(part), code="download-stopped"
        ) from error
    if total is not None and received < total:
        raise ModelError(
            f"{url}: the download stopped at {received} of {total} bytes",
            advice=_resume_advice(part),
            code="download-stopped",
        )


def _resumed_at(answer: http.client.HTTPResponse, requested: int) -> int:
    """Return the first byte of the answer: 0 if the server sends the whole file."""
    match = _CONTENT_RANGE.match(answer.headers.get("Content-Range") or "")
    return requested if answer.status == http.HTTPStatus.PARTIAL_CONTENT and match and int(match[1]) == requested else 0


def _resume_advice(part: Path) -> str:
    size = part.stat().st_size if part.exists() else 0
    return f"the same command continues from byte {size}" if size else "try again"
