"""Runs the tiny recipe in a process of its own, where it can be killed or its writes made to fail."""

import argparse
import logging
import resource
import signal
import sys
from pathlib import Path

import torch

from tests.training.recipes import TINY
from training.atomic_files import TrainingError
from training.run import train

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("output", type=Path)
    parser.add_argument("--largest", type=int, help="writes beyond this many bytes fail, as on a full disk")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    torch.set_num_threads(1)
    if given.largest is not None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (given.largest, given.largest))
    try:
        print(train(TINY, given.output, given.workers))
    except TrainingError as error:
        sys.exit(str(error))
