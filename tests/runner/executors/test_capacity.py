"""The number of workers: by cores, memory and trials."""

import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.errors import UsageError
from vsnbench.models.checkpoints.torch_runtime import GpuMemory
from vsnbench.models.contract import ModelCard
from vsnbench.runner.executors.capacity import (
    FEWEST_TRIALS,
    GIB,
    RUNNING_BYTES,
    Capacity,
    WorkerRequest,
    choose_count,
    local_request,
)
from vsnbench.runner.executors.messages import Prepared
from vsnbench.runner.setup.trial_setup import SetupDescription
from vsnbench.values.robot_identity import RobotIdentity

BOX = Capacity(cores=4, free_bytes=4 * GIB)


def prepared(
    bytes_each: int, device: str = "cpu", gpu: GpuMemory | None = None, sessions: int | None = None
) -> Prepared:
    card = ModelCard("big", runs_on={"device": device})
    robot = RobotIdentity(PROFILE, "simulated", simulated=True)
    described = SetupDescription(robot, frozenset(), {}, card, ("chair",), sessions=sessions)
    return Prepared(described, bytes_each - RUNNING_BYTES, gpu)


@pytest.mark.parametrize(
    ("workers", "trials", "expected"),
    [
        (None, 90, WorkerRequest(4, is_explicit=False)),
        (None, FEWEST_TRIALS - 1, WorkerRequest(1, is_explicit=False)),
        (7, 90, WorkerRequest(7, is_explicit=True)),
        (7, 3, WorkerRequest(3, is_explicit=True)),
    ],
)
def test_cores_and_trials_limit_the_workers(workers: int | None, trials: int, expected: WorkerRequest) -> None:
    assert local_request(workers, trials, BOX) == expected


def test_auto_fits_into_memory() -> None:
    assert choose_count(WorkerRequest(4, is_explicit=False), BOX, prepared(1 * GIB)) == 4
    assert choose_count(WorkerRequest(4, is_explicit=False), BOX, prepared(3 * GIB // 2)) == 2
    assert choose_count(WorkerRequest(4, is_explicit=False), BOX, prepared(9 * GIB)) == 1


def test_a_servers_sessions_limit_the_workers() -> None:
    served = prepared(GIB // 4, "cuda", sessions=2)
    assert choose_count(WorkerRequest(4, is_explicit=False), BOX, served) == 2
    assert choose_count(WorkerRequest(2, is_explicit=True), BOX, served) == 2
    with pytest.raises(UsageError, match="4 workers need as many sessions") as refused:
        choose_count(WorkerRequest(4, is_explicit=True), BOX, served)
    assert refused.value.code == "too-few-sessions"
    assert WorkerRequest(4, is_explicit=True, first_alone=True).limit == 4
    assert BOX.initial_count(WorkerRequest(4, is_explicit=True, first_alone=True), None) == 1


def test_too_many_workers_for_memory_are_refused() -> None:
    with pytest.raises(UsageError, match=r"1\.5 GiB, and 4\.0 GiB are free, enough for 2"):
        choose_count(WorkerRequest(3, is_explicit=True), BOX, prepared(3 * GIB // 2))


def test_a_model_on_a_gpu_of_unknown_memory_runs_once_by_default() -> None:
    assert choose_count(WorkerRequest(4, is_explicit=False), BOX, prepared(GIB, "mps")) == 1
    assert choose_count(WorkerRequest(16, is_explicit=False), BOX, prepared(GIB, "mps")) == 1, (
        "nor with more cores than memory holds"
    )
    assert choose_count(WorkerRequest(3, is_explicit=True), BOX, prepared(GIB, "mps")) == 3


@pytest.mark.parametrize(
    ("gpu_free", "memory_each", "started", "runs"),
    [
        (9 * GIB, GIB // 2, 1, 8),
        (5 * GIB, GIB // 2, 1, 6),
        (0, GIB // 2, 1, 1),
        (2 * GIB, GIB // 2, 3, 5),
        (9 * GIB, GIB, 1, 4),
    ],
)
def test_auto_fits_into_the_gpu_next_to_started_workers(
    gpu_free: int, memory_each: int, started: int, runs: int
) -> None:
    measured = prepared(memory_each, "cuda", GpuMemory(GIB, gpu_free, 16 * GIB))
    assert choose_count(WorkerRequest(8, is_explicit=False), BOX, measured, started) == runs


def test_too_many_workers_for_the_gpu_are_refused() -> None:
    measured = prepared(GIB, "cuda", GpuMemory(2 * GIB, 3 * GIB, 8 * GIB))
    with pytest.raises(UsageError, match=r"2\.0 GiB of the GPU, and 5\.0 GiB are free, enough for 2"):
        choose_count(WorkerRequest(4, is_explicit=True), BOX, measured)


@pytest.mark.parametrize(
    ("wanted", "device", "gpu", "started"),
    [
        (WorkerRequest(4, is_explicit=False), None, False, 4),
        (WorkerRequest(4, is_explicit=False), None, True, 1),
        (WorkerRequest(4, is_explicit=False), "cpu", True, 4),
        (WorkerRequest(4, is_explicit=True), "cuda", True, 1),
        (WorkerRequest(9, is_explicit=True), None, False, 1),
    ],
)
def test_one_worker_is_measured_first_if_memory_is_short_or_a_gpu_is_likely(
    wanted: WorkerRequest, device: str | None, gpu: bool, started: int
) -> None:
    assert Capacity(16, 12 * GIB, gpu).initial_count(wanted, device) == started


def test_the_choice_is_summarized_in_a_line() -> None:
    assert BOX.summary(2, prepared(GIB)) == "2 workers: 4 cores, 4.0 GiB free; one takes about 1.0 GiB"
    assert Capacity(1, GIB).summary(1, prepared(GIB)).startswith("1 worker: 1 core, ")
    on_gpu = prepared(GIB, "cuda", GpuMemory(3 * GIB // 2, 70 * GIB, 80 * GIB))
    assert BOX.summary(4, on_gpu).endswith("; one takes about 1.0 GiB and 1.5 of the GPU's 80.0 GiB")
    assert BOX.summary(1, prepared(GIB, "mps")).endswith("1.0 GiB; the model is on a GPU whose memory is not known")
