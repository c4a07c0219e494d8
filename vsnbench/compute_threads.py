"""How many threads compute in a process that simulates: one, so that its bits depend on no processor and no worker.

PyTorch sums in another order with another number of threads, and its last bits differ then; a simulated campaign has
to come out the same alone, beside other workers and on other machines. The cores are used by more workers instead.
"""

import os
import sys

COMPUTE_THREADS = 1
"""A simulated robot's only; a real one's model may use every core, since nobody can run its trial again."""
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Read by OpenMP, OpenBLAS, MKL and OpenCV when they are loaded; PyTorch and onnxruntime here follow the first."""


def one_thread_environment() -> dict[str, str]:
    """Return what the environment of a process that simulates needs beside its own."""
    return dict.fromkeys(VARIABLES, str(COMPUTE_THREADS))


def compute_with_one_thread() -> None:
    """Hold the libraries of this process to one thread: what is loaded already at once, all others when they are."""
    os.environ.update(one_thread_environment())
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(COMPUTE_THREADS)
    if (cv2 := sys.modules.get("cv2")) is not None:
        cv2.setNumThreads(COMPUTE_THREADS)
