"""Where the files that travel with the package lie: beside it in a checkout, inside it in a wheel."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_IN_CHECKOUT = {"sites": "sites", "migrations": "db/migrations", "weights": "weights"}


def resource_directory(name: str) -> Path:
    """Return the directory of packaged files called `name` (`sites`, `migrations` or `weights`)."""
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / _IN_CHECKOUT[name]
