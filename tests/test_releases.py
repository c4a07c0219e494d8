"""Records, studies, bundles and wire clients of every released version keep working."""

import contextlib
import json
import tarfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack
import pytest
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection

from scripts.make_release_data import POLICY
from tests.cli.test_record_verbs import vsnbench
from tests.models.remote.servers import look, scripted_server, stub_server
from vsnbench import __version__, open_results
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import pack, unpack
from vsnbench.models.synthetic import synthetic_task
from vsnbench.values.goal import Goal
from vsnbench.values.movement import Action

ARCHIVES = sorted((Path(__file__).parent / "data" / "releases").glob("*.tar.xz"))


@dataclass(frozen=True)
class Release:
    """The unpacked data of a released version."""

    directory: Path

    def json(self, *words: str) -> Any:
        """Run a command of today's version and return its JSON."""
        with contextlib.chdir(self.directory):
            done = vsnbench(self.directory / "results", *words, "--json", "--quiet")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def text(self, name: str) -> Any:
        return json.loads((self.directory / name).read_text(encoding="utf-8"))

    @property
    def messages(self) -> list[tuple[str, bytes]]:
        return [tuple(pair) for pair in msgpack.unpackb((self.directory / "exchange.msgpack").read_bytes())]


@pytest.fixture(scope="module", params=ARCHIVES, ids=lambda path: path.name.removesuffix(".tar.xz"))
def release(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Release]:
    directory = tmp_path_factory.mktemp("release")
    with tarfile.open(request.param) as archive:
        archive.extractall(directory, filter="data")
    return Release(directory)


def counts(report: Any) -> list[tuple[str, int, int, int]]:
    """Return name, successes, episodes and void episodes of every condition."""
    return [
        (model["name"], *(model["total"][key] for key in ("successes", "episodes", "void")))
        for model in report["models"]
    ]


def test_this_version_has_data_once_it_is_released() -> None:
    changelog = (Path(__file__).parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "## Unreleased" in changelog or any(path.name == f"{__version__}.tar.xz" for path in ARCHIVES)
    assert all(path.stat().st_size < 2**20 for path in ARCHIVES)


def test_a_record_is_upgraded_and_reports_the_same(release: Release) -> None:
    upgraded = release.json("db", "upgrade")
    assert upgraded["schema"] >= upgraded["schema_before"]
    assert counts(release.json("report")) == counts(release.text("report.json"))
    episodes = open_results(release.directory / "results").episodes()
    assert len(episodes) == sum(episodes + void for _, _, episodes, void in counts(release.text("report.json")))


def test_a_record_and_a_bundle_are_verified(release: Release) -> None:
    for subject in ("results", "bundle.zip"):
        found = release.json("verify", subject)
        assert found["holds"]
        assert sum(check["checked"] for check in found["checks"]) > 20


def test_a_bundle_is_merged_into_a_new_record(release: Release) -> None:
    with zipfile.ZipFile(release.directory / "bundle.zip") as bundle:
        bundle.extractall(release.directory / "unpacked")
    merged = release.json("db", "merge", "unpacked/results", "--results", "merged")
    assert merged["new_campaigns"] == 2
    assert merged["new_episodes"] == len(release.json("episodes", "list", "--results", "merged")) == 4


def test_a_study_reports_the_same_and_its_log_holds(release: Release) -> None:
    before, now = release.text("study-report.json"), release.json("study", "report")
    assert now["trials"] == before["trials"]
    for key in ("cells", "successes", "trials", "difference", "conclusion"):
        assert [answer[key] for answer in now["primary"]["answers"]] == [
            answer[key] for answer in before["primary"]["answers"]
        ]
    status = release.json("study", "status")
    assert (status["changed"], status["differences"]) == (None, [])


def test_a_server_with_the_released_file_runs_with_todays_client(release: Release, tmp_path: Path) -> None:
    with stub_server(POLICY, tmp_path, stub=release.directory / "vsnbench_policy.py") as (url, _):
        policy = RemotePolicy(url)
        policy.begin(synthetic_task(Goal("chair"), 0))
        actions = [policy.act(look()).action for _ in range(3)]
    assert actions == [Action.TURN_LEFT, Action.TURN_LEFT, Action.STOP]


def test_todays_server_answers_the_recorded_client_as_before(release: Release, tmp_path: Path) -> None:
    with stub_server(POLICY, tmp_path) as (url, _), connect(url, compression=None) as connection:
        for sender, content in release.messages:
            if sender == "client":
                connection.send(content)
                continue
            recorded, answer = msgpack.unpackb(content), unpack(connection.recv())
            for key in ("type", "wire", "seq", "action", "movement"):
                assert answer.get(key) == recorded.get(key)
            assert recorded.keys() <= answer.keys()


def test_todays_client_understands_the_recorded_server(release: Release) -> None:
    answers = [unpack(content) for sender, content in release.messages if sender == "server"]
    greeting, ready, *decisions = answers
    decided = iter(decisions)

    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        recorded = ready if message["type"] == "reset" else next(decided)
        connection.send(pack({**recorded, "seq": message["seq"]}))

    with scripted_server(answer, greeting) as url:
        policy = RemotePolicy(url)
        policy.begin(synthetic_task(Goal("chair"), 0))
        actions = [policy.act(look()).action for _ in decisions]
    assert [action and action.name for action in actions] == [decision["action"] for decision in decisions]
