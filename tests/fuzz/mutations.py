"""Makes invalid inputs from valid ones: bytes, YAML text and trees of plain values."""

import copy
import random
from collections.abc import Callable, Sequence
from typing import Any

from ruamel.yaml.error import YAMLError

from vsnbench.settings.yaml_text import dump_yaml, load_yaml

NUMBERS: Sequence[Any] = (
    *(0, -1, 1, 2, 3, 7, 255, 10**6, 2**31, 2**63, 2**64, -(2**63) - 1, 10**40, 10**400, -(10**400)),
    *(0.5, -0.0, 1e-320, 1e16, 1e308, -1e308, float("nan"), float("inf"), float("-inf")),
)
WORDS: Sequence[str] = (
    *(
        "",
        " ",
        "\0",
        "\n",
        "\ud7ff",
        "\ufeff",
        "\u202e",
        "é",
        "[red]",
        "../../x",
        "/etc/passwd",
        "a" * 5000,
        "%s%n",
        "'",
        '"',
    ),
    *("stop", "chair", "MOVE_FORWARD", "success", "true", "null", "nan", "1e999", "2026-13-45", "0x", "NaN", "-"),
    *(
        "2026-01-01 00:00:00.000000",
        "0001-01-01T00:00:00+23:59",
        "9999-12-31 23:59:59.999999",
        "{}",
        "[",
        '{"a":' * 200,
    ),
)
YAML_TOKENS: Sequence[str] = (
    *(
        "<<: *a\n",
        "&a ",
        "*a",
        "!!python/object/apply:os.system [x]",
        "? ",
        "- ",
        ": ",
        "{",
        "}",
        "[",
        "]",
        "|\n",
        ">\n",
        "%",
    ),
    *(
        "!!binary aGk=",
        "!!set {a}",
        "!!timestamp 2026-99-99",
        "2026-99-99",
        "1_000",
        "0o777",
        "0b1",
        "1:30:30",
        ".inf",
        "-.INF",
    ),
    *(".nan", "~", "null", "\t", "\0", "\x85", "\u2028", "---\n", "...\n", "#", "@", "`", '"\\ud800"', "'", '"', "\\"),
    *(
        "=",
        "!",
        "!!",
        "!<tag:yaml.org,2002:int> x",
        "1" * 5000,
        "0x" + "f" * 5000,
        "1e" + "9" * 400,
        "[" * 1200,
        "{a: " * 400,
    ),
    *(
        "y: ",
        "on",
        "no",
        "!!float 1_",
        "!!int _",
        "!!omap [1]",
        "!!pairs x",
        "!!bool maybe",
        "&a *a",
        "<<: 3\n",
        "<<: [1]\n",
    ),
)


def bytes_of(rng: random.Random, content: bytes) -> bytes:
    """Return bytes with some of them changed, cut, duplicated or moved."""
    made = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(made) + 1)
        match rng.randrange(8):
            case 0 | 1 | 2 if made:
                made[at % len(made)] ^= 1 << rng.randrange(8)
            case 3 if made:
                made[at % len(made)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF))
            case 4:
                del made[at : at + rng.choice((1, 2, 8, 100))]
            case 5:
                made[at:at] = rng.randbytes(rng.choice((1, 4, 64)))
            case 6:
                source = rng.randrange(len(made) + 1)
                made[at:at] = made[source : source + rng.choice((1, 4, 64))]
            case _ if rng.random() < 0.3:
                del made[at:]
    return bytes(made)


def value(rng: random.Random, depth: int = 0) -> Any:
    """Return any plain value."""
    match rng.randrange(9 if depth < 3 else 6):
        case 0 | 1:
            return rng.choice(NUMBERS)
        case 2 | 3:
            return rng.choice(WORDS)
        case 4:
            return rng.choice((None, True, False, [], {}))
        case 5:
            return rng.uniform(-10, 10)
        case 6:
            return [value(rng, depth + 1) for _ in range(rng.randrange(4))]
        case 7:
            return {rng.choice(WORDS[:12]): value(rng, depth + 1) for _ in range(rng.randrange(3))}
        case _:
            return nested(rng.choice((3, 60, 200)))


def nested(levels: int) -> Any:
    """Return deeply nested lists."""
    made: Any = 1
    for _ in range(levels):
        made = [made]
    return made


def tree(rng: random.Random, content: Any) -> Any:
    """Return a copy of a tree of plain values with a few of its nodes changed."""
    made = copy.deepcopy(content)
    for _ in range(rng.choice((1, 1, 2, 3))):
        places = list(_places(made))
        if not places:
            return value(rng)
        holder, key = rng.choice(places)
        match rng.randrange(6):
            case 0 | 1 | 2:
                holder[key] = value(rng)
            case 3:
                del holder[key]
            case 4 if isinstance(holder, dict):
                holder[rng.choice(WORDS)] = holder[key]
            case 5 if isinstance(holder, list):
                holder[:] = holder * rng.choice((2, 2, 30))
            case _:
                number = holder[key]
                if isinstance(number, int | float) and not isinstance(number, bool):
                    holder[key] = number * rng.choice((-1, 0, 1e-9, 1e9))
    return made


def _places(node: Any) -> list[tuple[Any, Any]]:
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    return [(node, key) for key in keys] + [place for key in keys for place in _places(node[key])]


def yaml_text(rng: random.Random, content: bytes) -> bytes:
    """Return YAML that resembles a settings file."""
    choice = rng.random()
    if choice < 0.45:
        try:
            return dump_yaml(tree(rng, load_yaml(content.decode()))).encode("utf-8", "replace")
        except (YAMLError, UnicodeDecodeError, RecursionError):
            return bytes_of(rng, content)
    if choice < 0.6:
        return bytes_of(rng, content)
    if choice < 0.64:
        return rng.choice(BOMBS)(rng.choice((3, 8, 26))).encode()
    text = content.decode()
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(text) + 1)
        token = rng.choice(YAML_TOKENS)
        text = text[:at] + token + text[at + rng.choice((0, 0, 1, len(token), 30)) :]
    return text.encode("utf-8", "replace")


def _aliases(levels: int) -> str:
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, levels)]
    return "\n".join(lines) + "\n"


def _merges(levels: int) -> str:
    lines = ["a0: &a0 {k: v}"]
    lines += [f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}], k{n}: 1}}" for n in range(1, levels)]
    return "\n".join(lines) + "\n"


def _nested_merges(levels: int) -> str:
    return "a: &a {k: v}\nname: " + "{<<: " * levels * 10 + "*a" + "}" * levels * 10 + "\n"


def _self_merge(_levels: int) -> str:
    return "name: &a\n  <<: *a\n  <<: [*a, *a]\nrooms: &b [*b, *b]\n"


BOMBS: Sequence[Callable[[int], str]] = (_aliases, _merges, _nested_merges, _self_merge)
