"""Compare today's outputs and simulated trials with the frozen ones: python -m tests.golden [outputs|trials]."""

import argparse
import difflib
import json
import lzma
import sys
import tempfile
from pathlib import Path

from tests.golden import outputs, trials

HERE = Path(__file__).parent
KINDS = {"outputs": outputs.collect, "trials": trials.collect}


def frozen(kind: str) -> dict[str, str]:
    """Return the frozen texts of a kind by name."""
    texts: dict[str, str] = json.loads(lzma.decompress((HERE / f"{kind}.json.xz").read_bytes()))
    return texts


def differences(before: dict[str, str], now: dict[str, str], lines: int = 20) -> list[str]:
    """Return what differs by name: the first lines of a unified difference each."""
    found = []
    for name in sorted(before.keys() | now.keys()):
        old, new = (_ordered(texts.get(name, "")).splitlines() for texts in (before, now))
        if old != new:
            changed = list(difflib.unified_diff(old, new, "frozen", "now", lineterm="", n=0))
            found.append(
                "\n".join([name, *changed[:lines], *([f"... {len(changed) - lines} more"][: len(changed) > lines])])
            )
    return found


def _ordered(text: str) -> str:
    """Return a command's output with the keys of its JSON in alphabetical order."""
    code, _, output = text.partition("\n") if text.startswith("exit code") else ("", "", text)
    try:
        return f"{code}\n{json.dumps(json.loads(output), indent=1, sort_keys=True)}"
    except json.JSONDecodeError:
        return text


def main() -> int:
    """Return how many kinds differ."""
    arguments = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    arguments.add_argument("kinds", nargs="*", choices=[[], *KINDS], help="outputs, trials; without a name both")
    arguments.add_argument("--freeze", action="store_true", help="keep what is printed today as the frozen one")
    arguments.add_argument("--lines", type=int, default=20, help="lines of difference of each output")
    given = arguments.parse_args()
    differing = 0
    for kind in given.kinds or KINDS:
        with tempfile.TemporaryDirectory() as directory:
            now = KINDS[kind](Path(directory))
        if given.freeze:
            content = json.dumps(now, indent=0, ensure_ascii=False).encode()
            (HERE / f"{kind}.json.xz").write_bytes(lzma.compress(content, preset=9))
            continue
        found = differences(frozen(kind), now, given.lines)
        print("\n\n".join(found) if found else f"{kind}: {len(now)} are as they were")
        differing += bool(found)
    return differing


if __name__ == "__main__":
    sys.exit(main())
