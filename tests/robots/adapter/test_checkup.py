"""`vsnbench doctor` finds the adapters that break their promises."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.robots.adapter.adapters import HEIGHT, WIDTH, PlaneBase, served, socket_adapter, write_profile
from vsnbench.robots.checkup.adapters import socket as adapter
from vsnbench.robots.checkup.check_up import check_up
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.profiles import load_profile
from vsnbench.values.pose import Pose

LOST_CLIENT = adapter.AdapterCheckup._lost_client
CHECKS = [
    *("adapter", "second client", "odometry", "images"),
    *("Left 30°", "progress", "stop", "deadline", "lost client"),
]


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a busy machine time, and leave the check that has to wait to two tests."""
    monkeypatch.setattr(adapter, "_IDLE_S", 0.05)
    monkeypatch.setattr(adapter, "PROGRESS_S", 30.0)
    monkeypatch.setattr(adapter, "_REACTION_S", 10.0)
    missed = CheckResult("lost client", Health.OK, "")
    monkeypatch.setattr(adapter.AdapterCheckup, "_lost_client", lambda *_: missed)


@pytest.fixture
def _lost_client(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter.AdapterCheckup, "_lost_client", LOST_CLIENT)
    monkeypatch.setattr(adapter, "GONE_S", 1.0)
    monkeypatch.setattr(adapter, "_REACTION_S", 0.5)
    monkeypatch.setattr(PlaneBase, "gone_s", 1.0)


@pytest.fixture
def base() -> PlaneBase:
    return PlaneBase()


def checked(base: PlaneBase, directory: Path) -> dict[str, CheckResult]:
    with served(base) as address:
        results = check_up(load_profile(write_profile(directory, address)), move=True)
        return {result.what: result for result in results}


def faults(results: dict[str, CheckResult]) -> set[str]:
    return {what for what, result in results.items() if result.health is not Health.OK}


@pytest.mark.usefixtures("_lost_client")
def test_an_adapter_that_keeps_its_promises_passes(base: PlaneBase, tmp_path: Path) -> None:
    results = checked(base, tmp_path)
    assert list(results) == CHECKS
    assert not faults(results), results
    assert results["adapter"].seen == "plane, protocol 1; executes move, trajectory, velocity, waypoint"
    assert results["images"].seen.startswith("64x48, depth 100% valid")


def test_an_adapter_that_does_not_run_is_the_only_result(tmp_path: Path) -> None:
    (result,) = check_up(load_profile(write_profile(tmp_path, "ws://127.0.0.1:1")), move=True)
    assert (result.what, result.health) == ("adapter", Health.FAILED)
    assert result.advice == "start it, and check interface.address in the profile"


def _done_at_once(*_: Any) -> Iterator[None]:
    yield
    return {"completed": True}


def test_an_adapter_that_says_done_at_once_is_dishonest(
    base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(base, "execute", _done_at_once)
    results = checked(base, tmp_path)
    assert results["Left 30°"].health is Health.FAILED
    assert results["Left 30°"].seen == "answered True; the odometry turned +0.0°"
    assert "stop" not in results


@pytest.mark.usefixtures("_lost_client")
def test_an_adapter_that_does_not_listen_fails_stop_and_lost_client(
    base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    handle = socket_adapter.handle
    monkeypatch.setattr(socket_adapter, "handle", lambda connection, base: handle(_Deaf(connection), base))
    results = checked(base, tmp_path)
    assert faults(results) == {"stop", "lost client"}
    assert results["stop"].seen.startswith("answered completed")


class _Deaf:
    """A connection whose adapter takes `stop` and silence for another `go`."""

    def __init__(self, connection: Any) -> None:
        self.send, self._recv, self._seq = connection.send, connection.recv, 0

    def recv(self, timeout: float | None = None) -> bytes:
        try:
            data = self._recv(timeout=0.01 if timeout and self._seq else None)
        except TimeoutError:
            return socket_adapter.packb({"type": "go", "seq": self._seq})
        message = socket_adapter.unpackb(data)
        self._seq = message.get("seq", self._seq)
        return socket_adapter.packb({"type": "go", "seq": self._seq}) if message["type"] == "stop" else data


def test_an_adapter_without_deadlines_fails(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    execute = base.execute
    monkeypatch.setattr(base, "execute", lambda movement, _: execute(movement, 60.0))
    results = checked(base, tmp_path)
    assert faults(results) == {"deadline"}
    assert "`refusal: deadline`" in results["deadline"].advice


def test_an_adapter_for_several_clients_fails(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = SimpleNamespace(acquire=lambda **_: True, release=lambda: None)
    monkeypatch.setattr(socket_adapter, "in_use", free)
    assert faults(checked(base, tmp_path)) == {"second client"}


def test_a_robot_that_moves_by_itself_has_a_second_driver(
    base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = base.state

    def drifting(**keywords: Any) -> dict[str, Any]:
        base.at = base.at.compose(Pose(0.05, 0.0))
        return state(**keywords)

    monkeypatch.setattr(base, "state", drifting)
    with served(base) as address:
        results = check_up(load_profile(write_profile(tmp_path, address)), move=False)
        found = {result.what: result for result in results}
    assert found["second driver"].health is Health.FAILED
    assert "moved 10.0 cm" in found["second driver"].seen


def test_depth_that_is_mostly_invalid_is_a_warning(
    base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, empty = base.state, bytes(2 * HEIGHT * WIDTH)

    def blind(*, with_depth: bool = False) -> dict[str, Any]:
        seen = state(with_depth=with_depth)
        return seen | {"depth": seen["depth"] | {"data": empty}} if with_depth else seen

    monkeypatch.setattr(base, "state", blind)
    with served(base) as address:
        results = check_up(load_profile(write_profile(tmp_path, address)), move=False)
        (images,) = (result for result in results if result.what == "images")
    assert (images.health, "depth 0% valid" in images.seen) == (Health.WARNING, True)


def test_a_rival_that_the_adapter_names_is_named(base: PlaneBase, tmp_path: Path) -> None:
    base.reported = {"rival": "teleop"}
    found = checked(base, tmp_path)
    assert found["second driver"].seen == "teleop drives the robot"
