"""Runs the tiny recipe in a process of its own: argv is the output directory and, optionally, the largest file."""

import logging
import resource
import signal
import sys
from pathlib import Path

import torch

from tests.training.recipes import TINY
from training.run import train
from training.whole_files import TrainingError

if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    torch.set_num_threads(1)
    if len(sys.argv) > 2:  # writes beyond this many bytes fail, as on a full disk
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        limit = int(sys.argv[2])
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        print(train(TINY, Path(sys.argv[1])))
    except TrainingError as error:
        sys.exit(str(error))
