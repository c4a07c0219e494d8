"""Identity of a third-party model: hashes of the files that it receives and of its source.

Built-in models state their identity on their cards, and the record has the version of vsnbench. For other classes, this
module hashes the files among their options, and every module of their package that is loaded once they are created.
"""

import hashlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.contract import Policy
from vsnbench.models.names import is_third_party
from vsnbench.plugins import file_of_module, package_version, source_sha256
from vsnbench.runtime.git import checkout_of

_MAX_FILES = 10_000


def files_handed_over(name: str, policy: Policy, options: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of every file or directory among the options of a third-party policy, by option.

    Weights whose hash is on the card are left out. The card of a policy in another process lists its files.

    Raises:
        ModelError: a file cannot be read.
    """
    hashes = dict(policy.card.files)
    if not is_third_party(name):
        return hashes
    for option, value in sorted(options.items()):
        if isinstance(value, Path) and value.exists():
            try:
                sha256 = _directory_sha256(value) if value.is_dir() else file_sha256(value)
            except OSError as error:
                raise ModelError(f"cannot read {value}, an option of the model: {error.strerror}") from error
            if sha256 != policy.card.weights_sha256:
                hashes[option] = sha256
    return hashes


def code_of(policy: Policy) -> dict[str, str]:
    """Return the identity of a third-party policy's source; empty for built-in models.

    For a policy in another process it is the identity that its server sends.

    Returns:
        `class`; `sha256` of its source; if known, `version` of its installed package and the git `commit` of its source
        (with `+changes` if it was modified).
    """
    kind = type(policy)
    if kind.__module__.partition(".")[0] == "vsnbench":
        return dict(policy.card.code)
    found = {"class": f"{kind.__module__}:{kind.__qualname__}", "sha256": source_sha256(kind)}
    if version := package_version(kind.__module__.partition(".")[0]):
        found["version"] = version
    if file := file_of_module(sys.modules.get(kind.__module__)):
        checkout = checkout_of(file)
        if checkout.commit:
            found["commit"] = checkout.commit + ("+changes" if checkout.dirty else "")
    return found


def _directory_sha256(directory: Path) -> str:
    digest = hashlib.sha256()
    files = sorted(path for path in directory.rglob("*") if path.is_file())
    if len(files) > _MAX_FILES:
        raise ModelError(f"{directory}, an option of the model, contains {len(files)} files", advice="name one of them")
    for path in files:
        digest.update(f"{path.relative_to(directory)}\0{file_sha256(path)}\n".encode())
    return digest.hexdigest()
