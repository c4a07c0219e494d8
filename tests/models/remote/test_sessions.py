"""A server with several clients: each connection is a separate, independent episode."""

import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import torch

from tests.models.remote.servers import PATIENCE_S, ROOT, free_port, look, stub_server
from tests.processes import wait_until
from vsnbench.errors import ModelError, ModelLostError
from vsnbench.models.pirlnav.policy import PIRLNav
from vsnbench.models.remote.checking import check_server
from vsnbench.models.remote.peer import ModelBusyError
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.serving import ServedBatchPolicy, ServedPolicy, served
from vsnbench.models.remote.vsnbench_policy import serve
from vsnbench.models.synthetic import synthetic_task
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

COUNTS = """
import random
import time

class Model:
    card = {"name": "counts", "sensors": ["rgb"], "deterministic": True}

    def reset(self, goal, seed):
        random.seed(seed)
        self.seed, self.turns = seed, 0

    def act(self, observation):
        if self.seed == 99:
            time.sleep(2)
        self.turns += 1
        return {"action": "TURN_LEFT", "diagnostics": {"scalars": {"turns": self.turns, "drawn": random.random()}}}
"""
BATCHES = """
import time

class State:
    def __init__(self, seed):
        self.seed, self.turns = seed, 0

class Model:
    card = {"name": "batches", "sensors": ["rgb"]}

    def new_state(self, goal, seed):
        return State(seed)

    def act_batch(self, observations, states):
        time.sleep(0.05)
        answers = []
        for state in states:
            state.turns += 1
            scalars = {"turns": state.turns, "seed": state.seed}
            answers.append({"action": "TURN_LEFT", "diagnostics": {"scalars": scalars}})
        if any(state.seed == 13 for state in states):
            return answers[:-1]
        return [ValueError("seven") if state.seed == 7 else answer for state, answer in zip(states, answers)]
"""


def scalars(policy: RemotePolicy) -> dict[str, float]:
    return dict(policy.act(look()).diagnostics.scalars)


def drawn(seed: int, count: int) -> list[float]:
    generator = random.Random(seed)
    return [generator.random() for _ in range(count)]


def test_each_session_has_its_own_episode_and_random_numbers(tmp_path: Path) -> None:
    with stub_server(COUNTS, tmp_path, "served_model:Model", "--sessions", "3") as (url, _):
        clients = [RemotePolicy(url) for _ in range(3)]
        assert clients[0].sessions == 3
        for seed, client in enumerate(clients):
            client.reset("chair", seed)
        answers = [[scalars(client) for client in clients] for _ in range(4)]
        for seed, _ in enumerate(clients):
            assert [turn[seed]["turns"] for turn in answers] == [1, 2, 3, 4]
            assert [turn[seed]["drawn"] for turn in answers] == drawn(seed, 4)


def test_a_client_beyond_the_sessions_is_refused_in_one_line_until_another_leaves(tmp_path: Path) -> None:
    with stub_server(COUNTS, tmp_path, "served_model:Model", "--sessions", "2") as (url, _):
        first, _second = RemotePolicy(url), RemotePolicy(url)
        with pytest.raises(ModelBusyError, match="all 2 sessions of the model are in use"):
            RemotePolicy(url)
        first.close()
        assert RemotePolicy(url).card.name == "counts"


def test_a_client_that_waits_too_long_is_dropped_and_the_next_one_is_served(tmp_path: Path) -> None:
    with stub_server(COUNTS, tmp_path, "served_model:Model", "--sessions", "3") as (url, _):
        slow, hasty, patient = RemotePolicy(url), RemotePolicy(url, act_timeout=0.3), RemotePolicy(url)
        hasty.reset("chair", 1)
        hasty.act(look())  # a connection's first action has the time of `reset`
        slow.reset("chair", 99)
        patient.reset("chair", 2)
        with ThreadPoolExecutor() as pool:
            waiting = pool.submit(slow.act, look())
            time.sleep(0.2)
            with pytest.raises(ModelLostError):
                hasty.act(look())
            answer = patient.act(look()).diagnostics
            assert waiting.result().action.value == "TURN_LEFT"
        assert answer.scalars["turns"] == 1
        assert answer.details["wire"]["queued_s"] > 1.0
        hasty.reset("chair", 1)
        assert scalars(hasty)["turns"] == 1


def test_a_killed_client_frees_its_session(tmp_path: Path) -> None:
    program = (
        "import sys, time\nfrom vsnbench.models.remote.policy import RemotePolicy\n"
        "RemotePolicy(sys.argv[1])\nprint('connected', flush=True)\ntime.sleep(600)\n"
    )
    with stub_server(COUNTS, tmp_path, "served_model:Model", "--sessions", "2") as (url, _):
        kept = RemotePolicy(url)
        kept.reset("chair", 0)
        client = subprocess.Popen([sys.executable, "-c", program, url], cwd=ROOT, stdout=subprocess.PIPE)
        assert client.stdout is not None
        assert client.stdout.readline() == b"connected\n"
        client.send_signal(signal.SIGKILL)
        client.wait(PATIENCE_S)
        assert RemotePolicy(url).card.name == "counts"
        assert scalars(kept)["turns"] == 1


def test_a_stopped_client_that_reads_nothing_hurts_no_other(tmp_path: Path) -> None:
    with stub_server(COUNTS, tmp_path, "served_model:Model", "--sessions", "2") as (url, _):
        silent, other = RemotePolicy(url), RemotePolicy(url)
        silent.reset("chair", 0)
        silent.connection._socket.send([b"half of a message that never ends"], text=None)
        other.reset("chair", 1)
        assert [scalars(other)["turns"] for _ in range(3)] == [1, 2, 3]


def together(clients: list[RemotePolicy]) -> list[dict[str, object]]:
    """Have all clients act at the same time, and return the details of the transfers."""
    with ThreadPoolExecutor(len(clients)) as pool:
        return [dict(decision.diagnostics.details["wire"]) for decision in pool.map(lambda c: c.act(look()), clients)]


def test_observations_that_wait_together_are_answered_together(tmp_path: Path) -> None:
    with stub_server(BATCHES, tmp_path, "served_model:Model", "--sessions", "4", "--batch", "3") as (url, _):
        clients = [RemotePolicy(url) for _ in range(4)]
        assert not clients[0].card.deterministic
        assert clients[0].card.runs_on["batch"] == "3"
        for seed, client in enumerate(clients):
            client.reset("chair", seed)
        sizes = [{transfer["batch"] for transfer in together(clients)} for _ in range(6)]
        assert max(set.union(*sizes)) in (2, 3)
        assert [scalars(client) for client in clients] == [{"turns": 7, "seed": seed} for seed in range(4)]


def test_without_batch_a_shared_model_answers_each_observation_alone(tmp_path: Path) -> None:
    with stub_server(BATCHES, tmp_path, "served_model:Model", "--sessions", "3") as (url, _):
        clients = [RemotePolicy(url) for _ in range(3)]
        assert clients[0].card.deterministic
        for seed, client in enumerate(clients):
            client.reset("chair", seed)
        assert {transfer["batch"] for _ in range(3) for transfer in together(clients)} == {1}


def test_a_batch_answer_of_the_wrong_length_is_the_models_error_in_one_line(tmp_path: Path) -> None:
    with stub_server(BATCHES, tmp_path, "served_model:Model", "--sessions", "2", "--batch", "2") as (url, _):
        policy = RemotePolicy(url)
        policy.reset("chair", 13)
        with pytest.raises(ModelError, match="act_batch returned 0 answers to 1 observations"):
            policy.act(look())
        policy.reset("chair", 1)
        assert scalars(policy) == {"turns": 1, "seed": 1}


def test_an_error_among_the_answers_of_a_batch_fails_its_episode_only(tmp_path: Path) -> None:
    with stub_server(BATCHES, tmp_path, "served_model:Model", "--sessions", "2", "--batch", "2") as (url, _):
        clients = [RemotePolicy(url) for _ in range(2)]
        clients[0].reset("chair", 7)
        clients[1].reset("chair", 1)
        with ThreadPoolExecutor(2) as pool:
            failing, fine = (pool.submit(client.act, look()) for client in clients)
            assert fine.result().action.value == "TURN_LEFT"
            with pytest.raises(ModelError, match="seven"):
                failing.result()


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"sessions": 2}, "2 sessions need a class"),
        ({"sessions": 2, "batch": 2}, "batch 2 needs a policy with act_batch"),
        ({"sessions": 0}, "sessions must be 1 to 256"),
    ],
)
def test_a_policy_that_cannot_serve_so_many_sessions_is_refused(arguments: dict[str, int], problem: str) -> None:
    class Turner:
        card: ClassVar = {"name": "turner"}

        def reset(self, goal: str, seed: int) -> None: ...

        def act(self, observation: object) -> str:
            return "TURN_LEFT"

    with pytest.raises(ValueError, match=problem):
        serve(Turner(), port=0, **arguments)


def test_a_batch_policy_without_new_state_is_refused() -> None:
    class Stateless:
        card: ClassVar = {"name": "stateless"}

        def act_batch(self, observations: object, states: object) -> list[str]:
            return []

    with pytest.raises(ValueError, match="needs new_state"):
        serve(Stateless(), port=0)


@contextmanager
def pirlnav_server(policy: PIRLNav, sessions: int, batch: int) -> Iterator[str]:
    port = free_port()
    listens = threading.Event()
    arguments = {"port": port, "sessions": sessions, "batch": batch, "ready": lambda _: listens.set()}
    wrapped = served(policy, "pirlnav", {}, sessions)
    threading.Thread(target=serve, args=(wrapped,), kwargs=arguments, daemon=True).start()
    wait_until(listens.is_set, "the server listens")
    yield f"ws://127.0.0.1:{port}"


def frames(seed: int, count: int) -> list[Observation]:
    rng = np.random.default_rng(seed)
    camera = look(320, 240).camera
    shots = rng.integers(0, 256, (count, 240, 320, 3), np.uint8)
    return [
        Observation(shot, None, Pose(0.1 * step, 0.0, 0.2 * step), float(step), camera)
        for step, shot in enumerate(shots)
    ]


@pytest.fixture
def one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.mark.usefixtures("one_thread")
@pytest.mark.parametrize("batch", [1, 3])
def test_sessions_of_pirlnav_answer_as_it_answers_alone(batch: int) -> None:
    policy = PIRLNav("embedded", None, "cpu", runtime="torch")
    alone = []
    for seed in range(3):
        policy.reset("chair", seed)
        alone.append([policy.act(frame).diagnostics.details["logits"] for frame in frames(seed, 4)])
    with pirlnav_server(policy, 3, batch) as url, ThreadPoolExecutor(3) as pool:

        def episode(seed: int) -> list[list[float]]:
            client = RemotePolicy(url)
            client.begin(synthetic_task("chair", seed))
            return [client.act(frame).diagnostics.details["logits"] for frame in frames(seed, 4)]

        answered = list(pool.map(episode, range(3)))
    if batch == 1:
        assert answered == alone
    else:
        np.testing.assert_allclose(answered, alone, atol=1e-4)


@pytest.mark.usefixtures("one_thread")
def test_a_policy_is_shared_only_if_it_has_several_sessions_and_keeps_states() -> None:
    policy = PIRLNav("embedded", None, "cpu", runtime="torch")
    assert type(served(policy, "pirlnav", {}, 1)) is ServedPolicy
    assert type(served(policy, "pirlnav", {}, 2)) is ServedBatchPolicy


MIXES = """
class Model:
    card = {"name": "mixes"}
    turns = 0

    def new_state(self, goal, seed):
        Model.turns = 0

    def act_batch(self, observations, states):
        Model.turns += 1
        return ["TURN_LEFT" if Model.turns % 2 else "TURN_RIGHT" for _ in states]
"""


def test_models_check_finds_sessions_that_mix(tmp_path: Path) -> None:
    with stub_server(MIXES, tmp_path, "served_model:Model", "--sessions", "2") as (url, _):
        findings = {finding.what: finding for finding in check_server(url)}
    assert not findings["sessions are independent"].passed
    (tmp_path / "good").mkdir()
    tilts = COUNTS.replace('"counts", ', '"counts", "action_map": {"LOOK_UP": "TURN_LEFT"}, ')
    tilts = tilts.replace('"action": "TURN_LEFT"', '"action": "LOOK_UP"')
    with stub_server(tilts, tmp_path / "good", "served_model:Model", "--sessions", "2") as (url, _):
        assert [finding.what for finding in check_server(url) if not finding.passed] == []
