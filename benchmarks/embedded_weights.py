"""Measures the success rate of the embedded PIRLNav weights under the full protocol.

    python benchmarks/embedded_weights.py --output judged                        the apartment: 15 positions x 6 goals
    python benchmarks/embedded_weights.py --output judged --flats 20 --starts 1-5    and flats never trained on

The baselines are `random`, `forward` and `oracle`. Each row comes from a `vsnbench run` into its own results directory
below the output, so an interrupted measurement resumes. Intervals are Wilson intervals over trials. The five seeds of
one policy share positions and goals and are not independent, so their pooled interval is slightly too narrow.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from vsnbench import open_results
from vsnbench.models.pirlnav.policy import GOALS
from vsnbench.simulator.generated_sites.generate import SEEDS, Split
from vsnbench.statistics.rates import Proportion, wilson

GREEDY = "greedy"
SAMPLED_SEEDS = range(5)


@dataclass(frozen=True, slots=True)
class Policy:
    """One row of the table: a model, its seed and its decision mode."""

    model: str
    seed: int = 0
    decision: str = ""

    @property
    def name(self) -> str:
        """Name of the results directory."""
        return "-".join(part for part in (self.model, self.decision, str(self.seed)) if part)


SAMPLED = [Policy("pirlnav", seed, "sampled") for seed in SAMPLED_SEEDS]
BASELINES = [Policy("random"), Policy("forward"), Policy("oracle")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="directory for the results directories")
    parser.add_argument("--weights", default="embedded", help="PIRLNav checkpoint")
    parser.add_argument("--flats", type=int, default=0, help="number of generated test flats to evaluate in addition")
    parser.add_argument("--starts", default="1-15", help="starting positions in each generated flat")
    parser.add_argument("--jobs", type=int, default=2, help="number of parallel runs")
    parser.add_argument("--skip-apartment", action="store_true")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    evaluation = Evaluation(given.output, given.weights)
    tables = []
    with ThreadPoolExecutor(given.jobs) as pool:
        if not given.skip_apartment:
            policies = [*SAMPLED, Policy("pirlnav", 0, GREEDY), *BASELINES]
            runs = list(pool.map(lambda policy: evaluation.run(policy, "apartment", "1-15"), policies))
            rows = {policy.name: [run] for policy, run in zip(policies, runs, strict=True)}
            rows["pirlnav, five seeds"] = runs[: len(SAMPLED)]
            tables.append(("The apartment", rows))
        if given.flats:
            sites = list(pool.map(evaluation.flat, SEEDS[Split.TEST][: given.flats]))
            policies = [SAMPLED[0], *BASELINES, Policy("pirlnav", 0, GREEDY)]
            pairs = [(policy, site) for policy in policies for site in sites]
            runs = list(pool.map(lambda pair: evaluation.run(pair[0], str(pair[1]), given.starts), pairs))
            rows = {
                policy.name: [run for (driver, _), run in zip(pairs, runs, strict=True) if driver == policy]
                for policy in policies
            }
            tables.append((f"{given.flats} generated flats, positions {given.starts}", rows))
    for title, rows in tables:
        print(f"\n{title}\n\n{markdown(rows)}")


class Evaluation:
    """Runs policies under the protocol and keeps their results directories."""

    def __init__(self, output: Path, weights: str) -> None:
        output = output.resolve()
        self._output, self._weights = output, str(Path(weights).resolve()) if Path(weights).is_file() else weights
        (output / "vsnbench.toml").write_text('[models]\ndevice = "cpu"\n')
        self._greedy = output / "greedy.yaml"
        self._greedy.write_text("decision: greedy\nthreads: 1\n")
        self._sampled = output / "sampled.yaml"
        self._sampled.write_text("decision: sampled\nthreads: 1\n")

    def flat(self, seed: int) -> Path:
        """Write the generated flat of a seed; return its file."""
        path = self._output / f"flat-{seed}.yaml"
        if not path.is_file():
            self._vsnbench("sites", "generate", "--seed", str(seed), "--output", str(path))
        return path

    def run(self, policy: Policy, site: str, starts: str) -> Path:
        """Run the remaining trials; return the results directory."""
        results = self._output / Path(site).stem / policy.name
        words = ["run", "--model", policy.model, "--goal", ",".join(GOALS), "--site", site, "--starts", starts]
        words += ["--seed", str(policy.seed), "--results", str(results)]
        if policy.model == "pirlnav":
            settings = self._greedy if policy.decision == GREEDY else self._sampled
            words += ["--weights", self._weights, "--model-config", str(settings)]
        self._vsnbench(*words)
        return results

    def _vsnbench(self, *words: str) -> None:
        command = [sys.executable, "-m", "vsnbench.cli.main", *words]
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=self._output)
        if done.returncode:
            sys.exit(f"vsnbench {' '.join(words)}\n{done.stderr}")


def markdown(rows: dict[str, Sequence[Path]]) -> str:
    """Return a Markdown table with one row per policy."""
    headings = ["policy", "success", "SR [95 %]", *GOALS, "STOP too far", "collisions", "step limits", "actions"]
    lines = [headings, ["---"] * len(headings)]
    for name, records in rows.items():
        counted = pd.concat([open_results(record).episodes() for record in records]).query("state == 'counted'")
        rate = Proportion(int(counted.success.sum()), len(counted))
        span, reasons = wilson(rate), counted.end_reason.value_counts()
        by_goal = [counted[counted.goal == goal].success for goal in GOALS]
        lines.append(
            [
                name,
                f"{rate.successes}/{rate.trials}",
                f"{rate.rate:.1%} [{span.low:.1%}, {span.high:.1%}]",
                *(f"{int(success.sum())}/{len(success)}" for success in by_goal),
                str(int(((counted.end_reason == "stop") & ~counted.success).sum())),
                *(str(reasons.get(reason, 0)) for reason in ("collision", "step_limit")),
                f"{counted.actions.mean():.1f}",
            ]
        )
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


if __name__ == "__main__":
    main()
