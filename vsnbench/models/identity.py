"""What tells a model of one's own from another of the same name: the files handed to it, and its code.

The models that vsnbench brings along say all of it themselves, on their cards; and which vsnbench ran is kept with
every process. A third party's class need not: so the files that it is handed are hashed here, and the source that it
was made from, which is every module of its own package (or beside its own file) that is loaded once it has been made.
"""

import hashlib
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from vsnbench.errors import ModelError
from vsnbench.git_checkout import checkout_of
from vsnbench.models.contract import Policy
from vsnbench.models.registry import is_third_party
from vsnbench.models.weights import file_sha256
from vsnbench.plugins import file_of_module, source_sha256

_MOST_FILES = 10_000


def files_handed_over(name: str, policy: Policy, options: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of every file or directory among the options of a third party's policy, by option.

    Weights whose hash is on the card already are not repeated. What a policy was handed elsewhere its card says.

    Args:
        name: how the model was named; in a process of its own it is third party's too.
        policy: what was made.
        options: what it was handed.

    Raises:
        ModelError: one of them cannot be read.
    """
    hashes = dict(policy.card.files)
    if not is_third_party(name):
        return hashes
    for option, value in sorted(options.items()):
        if isinstance(value, Path) and value.exists():
            try:
                sha256 = _directory_sha256(value) if value.is_dir() else file_sha256(value)
            except OSError as error:
                raise ModelError(f"cannot read {value}, which is handed to the model: {error.strerror}") from error
            if sha256 != policy.card.weights_sha256:
                hashes[option] = sha256
    return hashes


def code_of(policy: Policy) -> dict[str, str]:
    """Return what a third party's policy was made from; nothing for vsnbench's own.

    Of a policy in another process it is what its server says: the same for the same source.

    Returns:
        `class`; `sha256` of its source; `version` of its installed package, and the git `commit` of its source
        (`+changes` where it differs from that), as far as there are such.
    """
    made = type(policy)
    if made.__module__.partition(".")[0] == "vsnbench":
        return dict(policy.card.code)
    found = {"class": f"{made.__module__}:{made.__qualname__}", "sha256": source_sha256(made)}
    if version := _package_version(made.__module__.partition(".")[0]):
        found["version"] = version
    if file := file_of_module(sys.modules.get(made.__module__)):
        checkout = checkout_of(file)
        if checkout.commit:
            found["commit"] = checkout.commit + ("+changes" if checkout.dirty else "")
    return found


def _package_version(top: str) -> str:
    for distribution in metadata.packages_distributions().get(top, ()):
        return metadata.version(distribution)
    return ""


def _directory_sha256(directory: Path) -> str:
    digest = hashlib.sha256()
    files = sorted(path for path in directory.rglob("*") if path.is_file())
    if len(files) > _MOST_FILES:
        raise ModelError(
            f"{directory}, which is handed to the model, holds {len(files)} files", advice="name one of them"
        )
    for path in files:
        digest.update(f"{path.relative_to(directory)}\0{file_sha256(path)}\n".encode())
    return digest.hexdigest()
