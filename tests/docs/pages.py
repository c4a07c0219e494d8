"""Shell blocks and commands of the pages of docs/."""

import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from vsnbench.cli.main import VERBS, build_app
from vsnbench.cli.support.words import mark_missing_values

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ("api.md", "cli.md", "headings.md", "schema.md")
"""Pages that `make docs` generates."""
PAGES = [page for page in sorted((ROOT / "docs").glob("*.md")) if page.name not in GENERATED]
_BLOCK = re.compile(r"^(?:<!-- needs: (?P<needs>.+?) -->\n)?```bash\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
_OTHER = re.compile(r"^(?:<!-- (?:output of|file): .+? -->\n)?```(?!bash)\w*\n.*?^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)")
_LOOKS_TYPED = rf"^ {{0,8}}(?:\$ )?((?:vsnbench (?:{'|'.join(VERBS)}|--\w)|python \S+\.py|pip install)\b.*)$"
_PLACEHOLDER = re.compile(r"…|\.\.\.|[\[\]{}|<>]|\bN\b|\bDIR\b|\bFILE\b")


@dataclass(frozen=True)
class Block:
    """A shell block of a page."""

    needs: str
    """What the block needs that a test does not have; empty if it runs."""
    commands: tuple[str, ...]


def blocks(page: str) -> list[Block]:
    """Return the shell blocks of a page."""
    return [Block(match["needs"] or "", tuple(_commands(match["body"]))) for match in _BLOCK.finditer(page)]


def commands_outside_blocks(page: str) -> list[str]:
    """Return lines that look like commands but are not in a shell block."""
    return re.findall(_LOOKS_TYPED, _SPAN.sub("", _prose(page)), re.MULTILINE)


def spans(page: str) -> list[str]:
    """Return the complete commands in a page's inline code."""
    codes = [" ".join(code.split()) for code in _SPAN.findall(_prose(page))]
    return [code for code in codes if code.startswith("vsnbench ") and not _PLACEHOLDER.search(code)]


def scripts(page: str) -> list[str]:
    """Return the files of this repository that a page names in prose and shell blocks."""
    named = re.findall(r"\b(?:benchmarks|scripts|tests|examples)/[\w/]+\.\w+", _OTHER.sub("", page))
    return sorted(set(named))


def _prose(page: str) -> str:
    return _OTHER.sub("", _BLOCK.sub("", page))


def _commands(body: str) -> Iterator[str]:
    """Yield the commands of a block; a loop is a single command."""
    lines: list[str] = []
    for line in body.splitlines():
        lines.append(line)
        opened = sum(bool(re.match(r"\s*(for|while) ", each)) for each in lines)
        if opened == sum(each.strip() == "done" for each in lines) and not line.endswith("\\"):
            if any(each.strip() and not each.startswith("#") for each in lines):
                yield "\n".join(lines)
            lines = []
    assert not lines, f"incomplete command at the end of a block: {lines}"


def plain(command: str) -> str:
    """Return a one-line command without its comment."""
    return re.split(r"\s#", command)[0].strip()


def understand(words: list[str], *, strict: bool = True) -> None:
    """Parse the arguments of `vsnbench` without running it; unknown ones raise."""
    verb = next((word for word in words if not word.startswith("-")), None)
    if verb is None:
        root = typer.main.get_command(build_app(None))
        known = {name for parameter in root.params for name in parameter.opts}
        assert set(words) <= known | {"--help", "--show-completion", "--install-completion"}
        return
    assert verb in VERBS, f"unknown command {verb}"
    if "--help" in words:
        return
    command: Any = typer.main.get_command(build_app(verb))
    try:
        context = command.make_context("vsnbench", mark_missing_values(words))
        while hasattr(command, "resolve_command"):
            _, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
            context = command.make_context(command.name, list(rest), parent=context)
    except Exception as problem:
        if strict or type(problem).__name__ != "MissingParameter":  # prose may name a command without its arguments
            raise


def check_names(command: str) -> None:
    """Check that commands, options, scripts, targets and extras exist, without running the command."""
    if command.startswith("for "):
        return
    for part in re.split(r"\s&&\s", plain(command)):
        words = shlex.split(part.split(" > ")[0])
        match words:
            case ["vsnbench", *rest]:
                understand(rest)
            case ["python", "-m", module, *rest]:
                _script(ROOT / module / "__main__.py", rest)
            case ["python", script, *rest]:
                _script(ROOT / script, rest)
            case ["make", target]:
                assert re.search(rf"^{re.escape(target)}:", (ROOT / "Makefile").read_text(), re.MULTILINE), target
            case [script] if script.startswith("scripts/"):
                assert (ROOT / script).is_file(), script
        _extras(part)


def _script(path: Path, words: list[str]) -> None:
    assert path.is_file(), path
    text = "".join(each.read_text(encoding="utf-8") for each in path.parent.glob("*.py"))
    assert [word for word in words if word.startswith("--") and f'"{word}"' not in text] == [], path


def _extras(words: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for named in re.findall(r"vsnbench[^'\s]*\[([\w,]+)\]", words):
        assert set(named.split(",")) <= set(project["optional-dependencies"]), words
    for version in re.findall(r"vsnbench-([\d.]+)-py3", words):
        assert version == project["version"], words
