"""Finds the policy that a file or a module defines, for commands that take either."""

import importlib
import inspect
import sys
from pathlib import Path
from types import ModuleType

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.contract import Policy
from vsnbench.models.contract_check import line_and_place
from vsnbench.models.names import is_address, is_stack, known_models, require_no_person
from vsnbench.models.process_exit import process_exit_refused, take_refused_exit
from vsnbench.models.registry import invalid_card
from vsnbench.plugins import LISTED, file_of_module, own_classes
from vsnbench.text.suggestions import closest


def policy_name(given: str) -> tuple[str, Path | None]:
    """Return the name of the policy that a file, a module or a class stands for, and the directory to import it from.

    The directory is added to the search path of this process. It is the one above the outermost package of a file, the
    working directory for a module, and None for a model that is found from everywhere.

    Args:
        given: name of a known model, `package.module`, `package.module:Class`, `FILE.py` or `FILE.py:Class`.

    Raises:
        UsageError: the model runs elsewhere, the file or module does not exist, or it has no policy, or several and
            none of them is named.
        ModelError: its import failed.
    """
    require_no_person(given, "try")
    if is_address(given) or is_stack(given):
        raise UsageError(
            f"try: {given} runs elsewhere, and this command loads a policy into its own process",
            advice=f"vsnbench run --model {given} --goal chair --starts 1-2",
            code="unknown-model",
        )
    if given in known_models():
        return given, None
    where, _, wanted = given.partition(":")
    if _is_path(where):
        module_name, root = _module_of(Path(where))
    else:
        module_name, root = where, Path.cwd()
    if str(root) not in sys.path:  # a file before all others; a module may be installed, which comes first
        sys.path.insert(0 if _is_path(where) else len(sys.path), str(root))
    module = _imported(module_name, where)
    found = file_of_module(module)
    if _is_path(where) and (found is None or not found.samefile(where)):
        raise UsageError(
            f"{where}: Python imports another module {module_name}, {found or 'which has no file'}",
            advice="rename the file",
            code="import-failed",
        )
    if wanted:
        return f"{module_name}:{wanted}", root
    return f"{module_name}:{_only_policy(module, where)}", root


def _is_path(where: str) -> bool:
    return where.endswith(".py") or "/" in where or Path(where).is_dir()


def _module_of(path: Path) -> tuple[str, Path]:
    """Return the module's name of a file, and the directory above its outermost package.

    Raises:
        UsageError: it is not a Python file.
    """
    if path.is_dir():
        files = sorted(str(file) for file in path.glob("*.py") if file.name != "__init__.py")[:LISTED]
        advice = f"name the file that has the policy: {' or '.join(files)}" if files else "name a Python file"
        raise UsageError(f"{path} is a directory", advice=advice, code="unknown-model")
    if not path.is_file():
        near = closest(path.name, [file.name for file in path.parent.glob("*.py")])
        advice = f"did you mean {path.with_name(near)}?" if near else "give the path of a Python file with a policy"
        raise UsageError(f"no file {path}", advice=advice, code="unknown-model")
    root, names = path.resolve().parent, [path.stem]
    if path.suffix != ".py" or not path.stem.isidentifier():
        raise UsageError(
            f"{path} cannot be imported",
            advice="a module's file ends with .py, and its name has letters, digits and underscores only",
            code="import-failed",
        )
    while (root / "__init__.py").is_file() and root.name.isidentifier():
        root, names = root.parent, [root.name, *names]
    return ".".join(names), root


def _imported(name: str, given: str) -> ModuleType:
    """Import a module; running its code may raise anything, or try to end the process.

    Raises:
        UsageError: the module does not exist.
        ModelError: the import failed.
    """
    try:
        with process_exit_refused():
            module = importlib.import_module(name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and f"{name}.".startswith(f"{missing}."):
            near = closest(given, known_models())
            raise UsageError(
                f"no file, module or model {given}",
                advice=f"did you mean {near}?" if near else f"it is neither installed nor in {Path.cwd()}",
                code="unknown-model",
            ) from error
        if fault := invalid_card(given, given, error):
            raise fault from error
        reason = take_refused_exit() or line_and_place(error)
        if isinstance(error, SystemExit):
            reason = f"it ends the process when it is imported: {reason}"
        raise ModelError(f"{given}: cannot import it: {reason}", code="import-failed") from error
    if refused_exit := take_refused_exit():
        raise ModelError(f"{given}: cannot import it: {refused_exit}", code="import-failed")
    return module


def _only_policy(module: ModuleType, given: str) -> str:
    """Return the name of the only policy that a module defines.

    Raises:
        UsageError: there is none, or there are several.
    """
    own = own_classes(module)
    policies = [
        name
        for name, kind in own.items()
        if issubclass(kind, Policy) and not inspect.isabstract(kind) and not name.startswith("_")
    ]
    if len(policies) == 1:
        return policies[0]
    if policies:
        names = [f"{given}:{name}" for name in policies[:LISTED]]
        raise UsageError(
            f"{given} has {len(policies)} policies", advice=f"choose one: {' or '.join(names)}", code="several-policies"
        )
    alike = next((name for name, kind in own.items() if callable(getattr(kind, "act", None))), None)
    raise UsageError(
        f"{given} has no policy",
        advice=f"derive {alike} from vsnbench.Policy, with `card`, `reset` and `act`"
        if alike
        else "define a class that derives from vsnbench.Policy, with `card`, `reset` and `act` (docs/models.md)",
        code="no-policy",
    )
