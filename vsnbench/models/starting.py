"""Writes the package of a new model, or the file of a stack, from templates."""

import keyword
import re
from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.files.home import expanded
from vsnbench.models.stack.file import ANNOTATED_EXAMPLE, NAME_PATTERN

_TEMPLATES = Path(__file__).with_name("starter")
_FILES = {
    "policy.py.j2": "{package}/policy.py",
    "test_policy.py.j2": "tests/test_policy.py",
    "settings.yaml.j2": "settings.yaml",
    "pyproject.toml.j2": "pyproject.toml",
    "README.md.j2": "README.md",
}


def write_model_package(directory: Path) -> tuple[str, list[Path]]:
    """Write a policy, its settings, its tests and a README into a new or empty directory.

    The model is named after the directory: `my-model/` contains `my_model.policy:MyModel`.

    Returns:
        `package.module:Class` for the command line, and the files.

    Raises:
        UsageError: the directory's name is not suitable, the directory is not empty, or it cannot be written.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    name = expanded(directory).resolve().name
    parts = [part for part in re.split(r"[^A-Za-z0-9]+", name) if part]
    package = "_".join(parts).lower()
    if not package.isidentifier() or keyword.iskeyword(package) or not package.isascii():
        raise UsageError(
            f"{directory}: {name!r} cannot be the name of a Python package",
            advice="start with a letter: vsnbench models new mymodel",
            code="invalid-model-name",
        )
    target = expanded(directory)
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise UsageError(f"{target} exists and is not empty", advice="name a new directory", code="not-empty")
        class_name = "".join(part[0].upper() + part[1:] for part in parts)
        # The output is Python, YAML and TOML, not HTML.
        environment = Environment(  # noqa: S701
            loader=FileSystemLoader(_TEMPLATES), undefined=StrictUndefined, keep_trailing_newline=True
        )
        variables = {"name": name.lower(), "package": package, "class_name": class_name}
        files = []
        for template, path in _FILES.items():
            file = target / path.format(package=package)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(environment.get_template(template).render(variables), encoding="utf-8")
            files.append(file)
        (target / package / "__init__.py").touch()
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    return f"{package}.policy:{class_name}", files


def write_stack_file(path: Path) -> Path:
    """Write the commented file of a stack, which is named after it: `theirs` becomes `theirs.yaml`.

    Raises:
        UsageError: the name is not suitable, or the file exists or cannot be written.
    """
    target = expanded(path.with_name(f"{path.name.removesuffix('.yaml')}.yaml"))
    if not re.match(NAME_PATTERN, target.stem):
        raise UsageError(
            f"{path}: {target.stem!r} cannot be the name of a stack",
            advice="use letters, digits, points, hyphens and underscores: vsnbench models new --stack theirs",
            code="invalid-model-name",
        )
    text = ANNOTATED_EXAMPLE.read_text(encoding="utf-8").replace("THIS-FILE.yaml", target.name)
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text.replace("name: my-stack ", f"name: {target.stem} "))
    except FileExistsError as error:
        raise UsageError(f"{target} exists", advice="name a new file", code="not-empty") from error
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    return target
