"""Makes docs/api.md from the docstrings of what plug-ins and notebooks build on."""

import ast
import inspect
from importlib.util import find_spec
from pathlib import Path

PREAMBLE = """# The Python interface

What models, robots and notebooks of your own build on, from the docstrings. [models.md](models.md) and
[robots.md](robots.md) tell how; this page is made by `make docs`.
"""
PARTS = {
    "For a model": [
        "vsnbench.models.contract",
        "vsnbench.protocol.observation",
        "vsnbench.protocol.decision",
        "vsnbench.protocol.actions",
        "vsnbench.models.remote.vsnbench_policy",
    ],
    "For a robot": [
        "vsnbench.robots.contract",
        "vsnbench.protocol.robot_identity",
        "vsnbench.protocol.motion_result",
        "vsnbench.protocol.fix",
    ],
    "Frames, cameras and the rules": [
        "vsnbench.protocol.pose",
        "vsnbench.protocol.camera",
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
        "vsnbench.statistics.power",
        "vsnbench.statistics.power_independent",
        "vsnbench.statistics.bootstrap",
        "vsnbench.statistics.multiple",
        "vsnbench.statistics.agreement",
        "vsnbench.statistics.equivalence",
        "vsnbench.statistics.posterior",
        "vsnbench.statistics.prediction_powered",
    ],
}


def api_page() -> str:
    """Return docs/api.md."""
    parts = [PREAMBLE]
    for title, modules in PARTS.items():
        parts.append(f"## {title}\n")
        parts += [_module(name) for name in modules]
    return "\n".join(parts).rstrip() + "\n"


def _module(name: str) -> str:
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(name)
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    lines = [f"### `{name}`\n", _first_line(tree), ""]
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            lines += _class(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            lines += [f"#### `{_signature(node)}`\n", *_text(node), ""]
    return "\n".join(lines)


def _class(node: ast.ClassDef) -> list[str]:
    bases = ", ".join(ast.unparse(base) for base in node.bases)
    lines = [f"#### class `{node.name}{f'({bases})' if bases else ''}`\n", *_text(node), ""]
    for field, meaning in _fields(node):
        lines.append(f"- `{field}`{f': {meaning}' if meaning else ''}")
    for method in node.body:
        if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
            is_property = any(isinstance(one, ast.Name) and one.id == "property" for one in method.decorator_list)
            shown = f"{method.name}: {_returned(method)}" if is_property else _signature(method)
            lines.append(f"- `{shown}`: {_first_line(method)}")
    return [*lines, ""]


def _fields(node: ast.ClassDef) -> list[tuple[str, str]]:
    """Return the annotated names and enum members of a class, each with the string that follows it."""
    found = []
    for statement, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            shown, name = f"{statement.target.id}: {ast.unparse(statement.annotation)}", statement.target.id
        elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            shown = name = statement.targets[0].id
        else:
            continue
        if name.startswith("_") or name == "model_config":
            continue
        constant = after.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else None
        meaning = (
            inspect.cleandoc(constant.value) if constant and isinstance(constant.value, str) else _described(statement)
        )
        found.append((shown, " ".join(meaning.split())))
    return found


def _described(statement: ast.AnnAssign | ast.Assign) -> str:
    """Return the description of a pydantic field."""
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
