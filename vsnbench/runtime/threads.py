"""Limit of one thread for computations in simulation, so that results do not depend on processor or workers.

The last bits of PyTorch's sums depend on the number of threads; a simulated campaign must give the same result alone,
with other workers and on other machines. More workers use the other cores.
"""

import os
import sys

COMPUTE_THREADS = 1
"""Applies to simulated robots only; a real robot's model may use every core, since its trials are not reproducible."""
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Variables that OpenMP, OpenBLAS, MKL and OpenCV read on load; PyTorch and onnxruntime follow the first."""


def one_thread_environment() -> dict[str, str]:
    """Return additional environment variables for a process that simulates."""
    return dict.fromkeys(VARIABLES, str(COMPUTE_THREADS))


def compute_with_one_thread() -> None:
    """Limit the libraries of this process to one thread: loaded ones at once, others when they are loaded."""
    os.environ.update(one_thread_environment())
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(COMPUTE_THREADS)
    if (cv2 := sys.modules.get("cv2")) is not None:
        cv2.setNumThreads(COMPUTE_THREADS)
