"""How many workers a machine holds: cores, memory, and too few trials to be worth it."""

import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.database.campaign_plan import ModelIdentity
from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.runner.bench import BenchDescription
from vsnbench.runner.pool.capacity import FEWEST_TRIALS, GIB, RUNNING_BYTES, Capacity, Wish, chosen, wish_for
from vsnbench.runner.pool.messages import Prepared

BOX = Capacity(cores=4, free_bytes=4 * GIB)


def prepared(bytes_each: int, device: str = "cpu") -> Prepared:
    card = ModelCard("big", runs_on={"device": device})
    robot = RobotIdentity(PROFILE, "simulated", simulated=True)
    described = BenchDescription(robot, frozenset(), {}, card, ModelIdentity("big"), ("chair",))
    return Prepared(described, bytes_each - RUNNING_BYTES)


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


def test_a_model_on_a_gpu_is_not_copied_unless_asked_for() -> None:
    assert chosen(Wish(4, asked_for=False), BOX, prepared(GIB, "cuda")) == 1
    assert chosen(Wish(16, asked_for=False), BOX, prepared(GIB, "cuda:0")) == 1, "nor with more cores than memory holds"
    assert chosen(Wish(3, asked_for=True), BOX, prepared(GIB, "cuda")) == 3


@pytest.mark.parametrize(
    ("wish", "device", "gpu", "started"),
    [
        (Wish(4, asked_for=False), None, False, 4),
        (Wish(4, asked_for=False), None, True, 1),
        (Wish(4, asked_for=False), "cpu", True, 4),
        (Wish(4, asked_for=True), "cuda", True, 4),
        (Wish(9, asked_for=True), None, False, 1),
    ],
)
def test_one_is_looked_at_first_where_memory_is_short_or_a_gpu_may_be_used(
    wish: Wish, device: str | None, gpu: bool, started: int
) -> None:
    assert Capacity(16, 12 * GIB, gpu).at_first(wish, device) == started


def test_what_was_chosen_is_said_in_a_line() -> None:
    assert BOX.words(2, GIB) == "2 workers: 4 cores, 4.0 GiB free; one takes about 1.0 GiB"
    assert Capacity(1, GIB).words(1, GIB).startswith("1 worker: 1 core, ")
