"""Home directories in paths."""

from pathlib import Path

from vsnbench.errors import UsageError


def expanded(path: str | Path) -> Path:
    """Return a path with `~` and `~user` replaced by a home directory.

    Raises:
        UsageError: the user does not exist, or has no home directory.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        user = Path(path).parts[0]
        raise UsageError(
            f"{path}: {user} has no home directory",
            advice=f"write ./{user} for a directory with this name",
            code="no-home-directory",
        ) from error
