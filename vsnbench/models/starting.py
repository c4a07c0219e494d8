"""Writes a package to begin a model of one's own with."""

import keyword
import re
from pathlib import Path

from vsnbench.errors import UsageError

_TEMPLATES = Path(__file__).with_name("starter")
_WHERE = {
    "policy.py.j2": "{package}/policy.py",
    "test_policy.py.j2": "tests/test_policy.py",
    "settings.yaml.j2": "settings.yaml",
    "pyproject.toml.j2": "pyproject.toml",
    "README.md.j2": "README.md",
}


def write_model_package(directory: Path) -> tuple[str, list[Path]]:
    """Write a policy, its settings, its tests and a README into a new or empty directory.

    The directory's name becomes the model's: `my-model/` holds `my_model.policy:MyModel`.

    Returns:
        The model as the command line names it, `package.module:Class`, and the files.

    Raises:
        UsageError: the name makes no package, something lies there already, or it cannot be written.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    name = directory.expanduser().resolve().name
    words = [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]
    package = "_".join(words).lower()
    if not package.isidentifier() or keyword.iskeyword(package) or not package.isascii():
        raise UsageError(
            f"{directory}: {name!r} makes no name of a Python package",
            advice="begin with a letter: vsnbench models new mymodel",
        )
    target = directory.expanduser()
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise UsageError(f"{target} is there already, and not empty", advice="name a new directory")
        class_name = "".join(word[0].upper() + word[1:] for word in words)
        # What is made is Python, YAML and TOML, and no web page.
        environment = Environment(  # noqa: S701
            loader=FileSystemLoader(_TEMPLATES), undefined=StrictUndefined, keep_trailing_newline=True
        )
        facts = {"name": name.lower(), "package": package, "class_name": class_name}
        files = []
        for template, where in _WHERE.items():
            file = target / where.format(package=package)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(environment.get_template(template).render(facts), encoding="utf-8")
            files.append(file)
        (target / package / "__init__.py").touch()
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    return f"{package}.policy:{class_name}", files
