"""`python -m training`: run a recipe or resume it."""

import argparse
import logging
import sys
from pathlib import Path

import torch

from training.recipe import load_recipe
from training.run import train
from vsnbench.errors import VsnbenchError


def main() -> int:
    """Run the recipe of the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m training",
        description="Train the small PIRLNav network. The same command goes on with a run that was stopped.",
    )
    parser.add_argument("--recipe", default="full", help="full, pilot, or the path of a recipe file")
    parser.add_argument("--output", type=Path, default=Path("training-runs/full"), help="the run's directory")
    parser.add_argument("--workers", type=int, default=2, help="processes that make demonstrations")
    parser.add_argument("--threads", type=int, default=2, help="threads of the training itself")
    given = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S", stream=sys.stderr)
    torch.set_num_threads(given.threads)
    try:
        path = train(load_recipe(given.recipe), given.output, given.workers)
    except VsnbenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
