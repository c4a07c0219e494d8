"""How many workers a machine holds: cores, memory, and too few trials to be worth it."""

import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.database.campaign_plan import ModelIdentity
from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.models.torch_runtime import GpuMemory
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.runner.bench import BenchDescription
from vsnbench.runner.pool.capacity import FEWEST_TRIALS, GIB, RUNNING_BYTES, Capacity, Wish, chosen, wish_for
from vsnbench.runner.pool.messages import Prepared

BOX = Capacity(cores=4, free_bytes=4 * GIB)


def prepared(bytes_each: int, device: str = "cpu", gpu: GpuMemory | None = None) -> Prepared:
    card = ModelCard("big", runs_on={"device": device})
    robot = RobotIdentity(PROFILE, "simulated", simulated=True)
    described = BenchDescription(robot, frozenset(), {}, card, ModelIdentity("big"), ("chair",))
    return Prepared(described, bytes_each - RUNNING_BYTES, gpu)


@pytest.mark.parametrize(
    ("workers", "trials", "expected"),
    [
        (None, 90, Wish(4, asked_for=False)),
        (None, FEWEST_TRIALS - 1, Wish(1, asked_for=False)),
        (7, 90, Wish(7, asked_for=True)),
        (7, 3, Wish(3, asked_for=True)),
    ],
)
def test_cores_and_trials_say_how_many_are_wanted(workers: int | None, trials: int, expected: Wish) -> None:
    assert wish_for(workers, trials, BOX) == expected


def test_auto_takes_what_memory_holds() -> None:
    assert chosen(Wish(4, asked_for=False), BOX, prepared(1 * GIB)) == 4
    assert chosen(Wish(4, asked_for=False), BOX, prepared(3 * GIB // 2)) == 2
    assert chosen(Wish(4, asked_for=False), BOX, prepared(9 * GIB)) == 1


def test_more_than_memory_holds_is_refused_with_the_figures() -> None:
    with pytest.raises(UsageError, match=r"^3 workers: one takes about 1\.5 GiB and 4\.0 GiB are free, which holds 2"):
        chosen(Wish(3, asked_for=True), BOX, prepared(3 * GIB // 2))


def test_a_model_on_a_gpu_that_does_not_tell_is_not_copied_unless_asked_for() -> None:
    assert chosen(Wish(4, asked_for=False), BOX, prepared(GIB, "mps")) == 1
    assert chosen(Wish(16, asked_for=False), BOX, prepared(GIB, "mps")) == 1, "nor with more cores than memory holds"
    assert chosen(Wish(3, asked_for=True), BOX, prepared(GIB, "mps")) == 3


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
def test_auto_takes_as_many_as_a_gpu_holds_beside_those_that_are_on_it(
    gpu_free: int, memory_each: int, started: int, runs: int
) -> None:
    measured = prepared(memory_each, "cuda", GpuMemory(GIB, gpu_free, 16 * GIB))
    assert chosen(Wish(8, asked_for=False), BOX, measured, started) == runs


def test_more_than_the_gpu_holds_is_refused_with_its_figures() -> None:
    measured = prepared(GIB, "cuda", GpuMemory(2 * GIB, 3 * GIB, 8 * GIB))
    with pytest.raises(
        UsageError, match=r"^4 workers: .* 2\.0 GiB of the GPU and 5\.0 GiB are free, which holds 2; give"
    ):
        chosen(Wish(4, asked_for=True), BOX, measured)


@pytest.mark.parametrize(
    ("wish", "device", "gpu", "started"),
    [
        (Wish(4, asked_for=False), None, False, 4),
        (Wish(4, asked_for=False), None, True, 1),
        (Wish(4, asked_for=False), "cpu", True, 4),
        (Wish(4, asked_for=True), "cuda", True, 1),
        (Wish(9, asked_for=True), None, False, 1),
    ],
)
def test_one_is_looked_at_first_where_memory_is_short_or_a_gpu_may_be_used(
    wish: Wish, device: str | None, gpu: bool, started: int
) -> None:
    assert Capacity(16, 12 * GIB, gpu).at_first(wish, device) == started


def test_what_was_chosen_is_said_in_a_line() -> None:
    assert BOX.words(2, prepared(GIB)) == "2 workers: 4 cores, 4.0 GiB free; one takes about 1.0 GiB"
    assert Capacity(1, GIB).words(1, prepared(GIB)).startswith("1 worker: 1 core, ")
    on_gpu = prepared(GIB, "cuda", GpuMemory(3 * GIB // 2, 70 * GIB, 80 * GIB))
    assert BOX.words(4, on_gpu).endswith("; one takes about 1.0 GiB and 1.5 of the GPU's 80.0 GiB")
    assert BOX.words(1, prepared(GIB, "mps")).endswith("1.0 GiB; the model is on a GPU, whose memory is not known")
