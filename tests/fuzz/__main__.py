"""Runs a long fuzz: `python -m tests.fuzz --seed 2 --count 1000 [--target site]`."""

import argparse
import sys

from tests.fuzz.harness import run
from tests.fuzz.targets import TARGETS


def main() -> None:
    """Run every target; exit code 1 when anything passed a boundary."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--count", type=int, default=1000, help="inputs per target")
    parser.add_argument("--target", action="append", choices=list(TARGETS), help="only these")
    chosen = parser.parse_args()
    print(f"{'target':18} {'inputs':>7} {'findings':>9} {'worst s':>8} {'worst MiB':>10}  ends")
    findings = inputs = 0
    for name in chosen.target or TARGETS:
        outcome = run(name, chosen.seed, chosen.count)
        ends = ", ".join(f"{count} {end}" for end, count in outcome.ends.most_common())
        print(
            f"{name:18} {outcome.inputs:7} {len(outcome.findings):9} {outcome.worst_s:8.2f} "
            f"{outcome.worst_mib:10.0f}  {ends}",
            flush=True,
        )
        for finding in outcome.findings:
            print(f"{name}: {finding}", file=sys.stderr, flush=True)
        findings += len(outcome.findings)
        inputs += outcome.inputs
    print(f"{inputs} inputs, {findings} past a boundary, too slow or too large")
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
