"""Location of data files: next to the package in a checkout, inside it in a wheel."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]
_IN_CHECKOUT = {"sites": "sites", "migrations": "db/migrations", "weights": "weights"}


def resource_directory(name: str) -> Path:
    """Return the directory of data files with a name (`sites`, `migrations` or `weights`)."""
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / _IN_CHECKOUT[name]
