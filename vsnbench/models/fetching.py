"""Downloads weights: resumes where it stopped, keeps only what has the right hash, appears whole or not at all."""

import http.client
import re
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.weights import file_sha256

Progress = Callable[[int, int | None], None]
"""Called with the bytes that are here, and the whole size where it is known."""

_CHUNK_BYTES = 1 << 20
_TIMEOUT_S = 30.0
_CONTENT_RANGE = re.compile(r"bytes (\d+)-\d+/(\d+|\*)")


def fetch(url: str, destination: Path, sha256: str, progress: Progress = lambda _here, _whole: None) -> bool:
    """Download a file.

    What has arrived is kept in `<name>.<hash>.part` beside the destination and continued by the next call.

    Args:
        url: http or https.
        destination: where the file shall lie.
        sha256: the hash it must have.
        progress: told how far it is.

    Returns:
        Whether anything had to be downloaded; False when the file was already there.

    Raises:
        UsageError: the URL or the hash is none, or another file lies at the destination.
        ModelError: the download failed or has another hash; the message says what to do.
    """
    sha256 = sha256.lower().removeprefix("sha256:")
    if not re.fullmatch(r"[0-9a-f]{64}", sha256):
        raise UsageError(f"--sha256 {sha256[:80]!r} is no SHA-256: it has 64 hexadecimal digits")
    if not url.startswith(("http://", "https://")):
        raise UsageError(f"{url!r} is no http or https address")
    if destination.exists():
        if file_sha256(destination) == sha256:
            return False
        raise UsageError(f"another file lies at {destination} (its SHA-256 differs)", advice="move it away first")
    part = destination.with_name(f"{destination.name}.{sha256[:12]}.part")
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        _download(url, part, progress)
        found = file_sha256(part)
        if found != sha256:
            part.unlink()
            raise ModelError(f"{url}: SHA-256 is {found}, not {sha256}; thrown away", advice="is it the right link?")
        part.replace(destination)
    except OSError as error:
        raise ModelError(f"cannot write {destination}: {error.strerror or error}") from error
    return True


def _download(url: str, part: Path, progress: Progress) -> None:
    """Bring `part` to the whole length of what lies at `url`."""
    here = part.stat().st_size if part.exists() else 0
    request = urllib.request.Request(url, headers={"Range": f"bytes={here}-"} if here else {})  # noqa: S310 - checked
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as answer:  # noqa: S310 - scheme checked by fetch
            here = _resumed_at(answer, here)
            length = answer.headers.get("Content-Length")
            whole = here + int(length) if length is not None and length.isdigit() else None
            with part.open("r+b" if here else "wb") as file:
                file.seek(here)
                file.truncate()
                progress(here, whole)
                while chunk := answer.read(_CHUNK_BYTES):
                    file.write(chunk)
                    here += len(chunk)
                    progress(here, whole)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return  # everything is here already; its hash decides
        raise ModelError(
            f"{url}: the server answered {error.code} {error.reason}",
            advice="open the address in a browser, and name the file's own",
        ) from error
    except (urllib.error.URLError, TimeoutError, ConnectionError, http.client.HTTPException) as error:
        reason = getattr(error, "reason", None) or error
        raise ModelError(f"{url}: the download stopped ({reason})", advice=_go_on(part)) from error
    if whole is not None and here < whole:
        raise ModelError(f"{url}: the download stopped at {here} of {whole} bytes", advice=_go_on(part))


def _resumed_at(answer: http.client.HTTPResponse, wanted: int) -> int:
    """Return from which byte the answer goes on: 0 where the server sends everything again."""
    match = _CONTENT_RANGE.match(answer.headers.get("Content-Range") or "")
    return wanted if answer.status == http.HTTPStatus.PARTIAL_CONTENT and match and int(match[1]) == wanted else 0


def _go_on(part: Path) -> str:
    kept = part.stat().st_size if part.exists() else 0
    return f"the same command goes on from byte {kept}" if kept else "try again"
