"""The pages of docs/ as a reader types them: their shell blocks, command by command, and what each block needs."""

import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from vsnbench.cli.main import VERBS, build_app

ROOT = Path(__file__).resolve().parents[2]
MADE = ("api.md", "cli.md", "schema.md")
"""Pages that `make docs` writes from the program itself."""
PAGES = [page for page in sorted((ROOT / "docs").glob("*.md")) if page.name not in MADE]
_BLOCK = re.compile(r"^(?:<!-- needs: (?P<needs>.+?) -->\n)?```bash\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
_OTHER = re.compile(r"^(?:<!-- (?:output of|file): .+? -->\n)?```(?!bash)\w*\n.*?^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)")
_LOOKS_TYPED = rf"^ {{0,8}}(?:\$ )?((?:vsnbench (?:{'|'.join(VERBS)}|--\w)|python \S+\.py|pip install)\b.*)$"
_PLACEHOLDER = re.compile(r"…|\.\.\.|[\[\]{}|<>]|\bN\b|\bDIR\b|\bFILE\b")


@dataclass(frozen=True)
class Block:
    """A shell block of a page."""

    needs: str
    """What it takes that no test has; empty where it runs as it is."""
    commands: tuple[str, ...]


def blocks(page: str) -> list[Block]:
    """Return the shell blocks of a page's text, in their order."""
    return [Block(each["needs"] or "", tuple(_commands(each["body"]))) for each in _BLOCK.finditer(page)]


def typed_elsewhere(page: str) -> list[str]:
    """Return the lines outside of shell blocks that look as if they were to be typed; nobody would run those."""
    return re.findall(_LOOKS_TYPED, _SPAN.sub("", _prose(page)), re.MULTILINE)


def spans(page: str) -> list[str]:
    """Return the commands that a page names within its sentences, but for those that leave something open."""
    named = [" ".join(words.split()) for words in _SPAN.findall(_prose(page))]
    return [words for words in named if words.startswith("vsnbench ") and not _PLACEHOLDER.search(words)]


def scripts(page: str) -> list[str]:
    """Return the files of this repository's that a page names within its sentences and shell blocks."""
    named = re.findall(r"\b(?:benchmarks|scripts|tests|examples)/[\w/]+\.\w+", _OTHER.sub("", page))
    return sorted(set(named))


def _prose(page: str) -> str:
    return _OTHER.sub("", _BLOCK.sub("", page))


def _commands(body: str) -> Iterator[str]:
    """Yield the commands of a block; a loop is one."""
    held: list[str] = []
    for line in body.splitlines():
        held.append(line)
        opened = sum(bool(re.match(r"\s*(for|while) ", one)) for one in held)
        if opened == sum(one.strip() == "done" for one in held) and not line.endswith("\\"):
            if any(one.strip() and not one.startswith("#") for one in held):
                yield "\n".join(held)
            held = []
    assert not held, f"a block breaks off within {held}"


def plain(command: str) -> str:
    """Return a command of one line without its comment."""
    return re.split(r"\s#", command)[0].strip()


def understand(words: list[str], *, strict: bool = True) -> None:
    """Parse words after `vsnbench` without running them; one that is not known ends the test."""
    verb = next((word for word in words if not word.startswith("-")), None)
    if verb is None:
        root = typer.main.get_command(build_app(None))
        known = {name for parameter in root.params for name in parameter.opts}
        assert set(words) <= known | {"--help", "--show-completion", "--install-completion"}
        return
    assert verb in VERBS, f"there is no verb {verb}"
    if "--help" in words:
        return
    command: Any = typer.main.get_command(build_app(verb))
    try:
        context = command.make_context("vsnbench", list(words))
        while hasattr(command, "resolve_command"):
            _, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
            context = command.make_context(command.name, list(rest), parent=context)
    except Exception as problem:
        if strict or type(problem).__name__ != "MissingParameter":  # a sentence may name the verb alone
            raise


def look_at(command: str) -> None:
    """See that what a command that cannot be run here names is there: verbs, options, scripts, targets, extras."""
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
