"""Generates docs/api.md from docstrings: the public interface, then its modules."""

import ast
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from vsnbench import _NAMES as PUBLIC_NAMES
from vsnbench.report.analysis.episodes_frame import COLUMNS
from vsnbench.report.frames import CAMPAIGN_COLUMNS

PREAMBLE = """# The Python interface

The interface for your own models, robots and notebooks, made from the docstrings by `make docs`. [models.md](models.md)
and [robots.md](robots.md) are the guides.

```python
from vsnbench import Action, Decision, ModelCard, Policy  # a model
from vsnbench import Fix, MotionResult, Observation, Robot  # a robot
from vsnbench import open_results  # a notebook
```

## Names of `vsnbench`

The sections below describe them in the modules that define them. Import them from `vsnbench`: the modules can move.

| name | |
| --- | --- |
"""
PARTS = {
    "For a model": [
        "vsnbench.models.contract",
        "vsnbench.values.model.card",
        "vsnbench.values.observation",
        "vsnbench.values.decision",
        "vsnbench.values.movement",
        "vsnbench.models.remote.vsnbench_policy",
    ],
    "For a robot": [
        "vsnbench.robots.contract",
        "vsnbench.values.robot_identity",
        "vsnbench.values.motion_result",
        "vsnbench.values.fix",
    ],
    "Frames, cameras and the rules": [
        "vsnbench.values.pose",
        "vsnbench.values.camera",
        "vsnbench.protocol.parameters",
        "vsnbench.protocol.judge",
        "vsnbench.protocol.metrics",
    ],
    "For a notebook": ["vsnbench.report.frames"],
    "Statistics": [
        "vsnbench.statistics.rates",
        "vsnbench.statistics.clustered",
        "vsnbench.statistics.paired",
        "vsnbench.statistics.permutation",
        "vsnbench.statistics.sequential.group_sequential",
        "vsnbench.statistics.power",
        "vsnbench.statistics.power_independent",
        "vsnbench.statistics.bootstrap",
        "vsnbench.statistics.multiple",
        "vsnbench.statistics.agreement",
        "vsnbench.statistics.prediction_powered",
    ],
}


def api_page() -> str:
    """Return docs/api.md."""
    rows = sorted(
        f"| `{name}` | {_summary(module, name)} |" for module, names in PUBLIC_NAMES.items() for name in names
    )
    parts = [PREAMBLE + "\n".join(rows) + "\n"]
    for title, modules in PARTS.items():
        parts.append(f"## {title}\n")
        parts += [_module(name) for name in modules]
        if "vsnbench.report.frames" in modules:
            parts += [_columns("episodes", COLUMNS), _columns("campaigns", CAMPAIGN_COLUMNS)]
    return "\n".join(parts).rstrip() + "\n"


def _columns(method: str, columns: Mapping[str, str]) -> str:
    rows = "\n".join(f"| `{name}` | {meaning} |" for name, meaning in columns.items())
    return f"#### Columns of `Results.{method}()`\n\n| column | |\n| --- | --- |\n{rows}\n"


def _tree(module: str) -> ast.Module:
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    return ast.parse(Path(spec.origin).read_text(encoding="utf-8"))


def _summary(module: str, name: str) -> str:
    """Return the first line of the docstring of a class or function, or the string that follows another name."""
    body = _tree(module).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            return _first_line(node)
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return _string_of(after)
    raise LookupError(f"{module} has no {name}")


def _module(name: str) -> str:
    tree = _tree(name)
    lines = [f"### `{name}`\n", _first_line(tree), ""]
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            lines += _class(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not _is_deprecated(node):
            lines += [f"#### `{_signature(node)}`\n", *_text(node), ""]
    return "\n".join(lines)


def _is_deprecated(node: ast.FunctionDef) -> bool:
    return "Deprecated." in (ast.get_docstring(node) or "")


def _class(node: ast.ClassDef) -> list[str]:
    bases = ", ".join(ast.unparse(base) for base in node.bases)
    lines = [f"#### class `{node.name}{f'({bases})' if bases else ''}`\n", *_text(node), ""]
    for field, meaning in _fields(node):
        lines.append(f"- `{field}`{f': {meaning}' if meaning else ''}")
    for method in node.body:
        if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
            decorators = {item.id for item in method.decorator_list if isinstance(item, ast.Name)}
            text = f"{method.name}: {_returned(method)}" if "property" in decorators else _signature(method)
            required = " (abstract)" if "abstractmethod" in decorators else ""
            lines.append(f"- `{text}`{required}: {_first_line(method)}")
    return [*lines, ""]


def _fields(node: ast.ClassDef) -> list[tuple[str, str]]:
    """Return the annotated names and enum members of a class, each with the string that follows it."""
    found = []
    is_enum = any("Enum" in ast.unparse(base) for base in node.bases)
    for statement, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            name = statement.target.id
            text = f"{name}: {ast.unparse(_Plain().visit(statement.annotation))}"
        elif is_enum and isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            text = name = statement.targets[0].id
        else:
            continue
        if name.startswith("_") or name == "model_config" or text == f"{name}: ClassVar":
            continue
        meaning = " ".join(filter(None, (_described(statement), _string_of(after))))
        found.append((text, meaning))
    return found


def _string_of(node: ast.stmt | None) -> str:
    """Return the string that a statement consists of, in one line; empty for another statement."""
    value = node.value.value if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) else None
    return " ".join(value.split()) if isinstance(value, str) else ""


class _Plain(ast.NodeTransformer):
    """Replaces `Annotated[X, ...]` by X."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        if isinstance(node.value, ast.Name) and node.value.id == "Annotated" and isinstance(node.slice, ast.Tuple):
            return self.visit(node.slice.elts[0])
        return self.generic_visit(node)


def _described(statement: ast.AnnAssign | ast.Assign) -> str:
    """Return the description of a pydantic field, or the meaning of a movement's parameter."""
    if isinstance(statement, ast.AnnAssign):
        for part in ast.walk(statement.annotation):
            if isinstance(part, ast.Call) and ast.unparse(part.func) == "Parameter":
                meaning = str(ast.literal_eval(part.args[0]))
                return f"{meaning[0].upper()}{meaning[1:]}."
    if isinstance(statement.value, ast.Call):
        for keyword in statement.value.keywords:
            if keyword.arg == "description" and isinstance(keyword.value, ast.Constant):
                return str(keyword.value.value)
    return ""


def _signature(node: ast.FunctionDef) -> str:
    arguments = ast.unparse(node.args)
    for receiver in ("self, ", "cls, ", "self", "cls"):
        if arguments.startswith(receiver):
            arguments = arguments.removeprefix(receiver)
            break
    return f"{node.name}({arguments}) -> {_returned(node)}"


def _returned(node: ast.FunctionDef) -> str:
    return ast.unparse(node.returns) if node.returns else "None"


def _text(node: ast.ClassDef | ast.FunctionDef) -> list[str]:
    """Return a docstring, its sections as lists."""
    lines = []
    for line in (ast.get_docstring(node) or "").splitlines():
        if line.strip() in ("Args:", "Raises:", "Returns:"):
            lines.append(f"*{line.strip()}*\n")
        elif line.startswith("    ") and not line.startswith("     "):
            lines.append(f"- {line.strip()}")
        else:
            lines.append(line if not line.startswith("     ") else f"  {line.strip()}")
    return lines


def _first_line(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> str:
    return " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
