"""`vsnbench models fetch` by name, from a local server."""

import functools
import hashlib
import json
import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from tests.cli.console import Typed
from vsnbench.models.checkpoints import torch_runtime
from vsnbench.models.checkpoints.published import PUBLISHED, PublishedFile

CONTENT = b"weights" * 1000
CHECKPOINT = Path(__file__).parents[2] / "data" / "pirlnav" / "ckpt.pth"


@pytest.fixture(autouse=True)
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path / "weights"))
    return tmp_path / "weights"


@pytest.fixture
def url(tmp_path: Path) -> Iterator[str]:
    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    (tmp_path / "served").mkdir()
    (tmp_path / "served" / "file.pth").write_bytes(CONTENT)
    with ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Handler, directory=str(tmp_path / "served"))
    ) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/file.pth"
        server.shutdown()
        thread.join()


def test_a_published_file_is_downloaded_by_name_from_its_address(
    typed: Typed, monkeypatch: pytest.MonkeyPatch, weights: Path, url: str
) -> None:
    digest = hashlib.sha256(CONTENT).hexdigest()
    monkeypatch.setitem(PUBLISHED, "mask-rcnn", PublishedFile("vlv", "file.pth", url, "BSD", digest[:8]))
    answer = typed("models", "fetch", "mask-rcnn", "--json")
    assert json.loads(answer.out) == {
        "files": [str(weights / "file.pth")],
        "fetched": True,
        "sha256": digest,
        "licence": "BSD",
    }
    assert (weights / "file.pth").read_bytes() == CONTENT


def test_a_file_from_a_mirror_must_have_the_published_hash(typed: Typed, weights: Path, url: str) -> None:
    answer = typed("models", "fetch", "mask-rcnn", url)
    assert answer.code == 1
    assert "not bf2d0c1e" in answer.err
    assert list(weights.iterdir()) == []


def serve_instead(directory: Path, url: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Serve the file of a directory at the published address of a name."""
    monkeypatch.setitem(PUBLISHED, name, replace(PUBLISHED[name], url=url))
    shutil.copyfile(CHECKPOINT, directory / "served" / "file.pth")


def test_weights_without_a_published_hash_are_checked_by_their_content(
    typed: Typed, tmp_path: Path, weights: Path, url: str
) -> None:
    shutil.copyfile(CHECKPOINT, tmp_path / "served" / "file.pth")
    for fetched in (True, False):
        answer = typed("models", "fetch", "pirlnav", url, "--json")
        assert answer.code == 0
        assert json.loads(answer.out)["fetched"] is fetched
        assert "checked by its content only" in answer.err
    assert (weights / "pirlnav.ckpt").read_bytes() == CHECKPOINT.read_bytes()


@pytest.mark.parametrize("name", ["pirlnav-rl", "pirlnav-il"])
def test_another_network_at_the_published_address_is_refused_and_deleted(
    typed: Typed, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, weights: Path, url: str
) -> None:
    serve_instead(tmp_path, url, name, monkeypatch)
    answer = typed("models", "fetch", name)
    assert answer.code == 1
    assert "a PIRLNav network of another size than the published one: 582,927 parameters; file deleted" in answer.err
    assert list(weights.iterdir()) == []
    shutil.copyfile(CHECKPOINT, weights / "pirlnav.ckpt")
    answer = typed("models", "fetch", name)
    assert answer.code == 2
    assert "(a PIRLNav network of another size than the published one" in answer.err
    assert "move it first" in answer.err


def test_a_web_page_in_place_of_weights_is_refused_and_deleted(
    typed: Typed, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, weights: Path, url: str
) -> None:
    serve_instead(tmp_path, url, "vlv-value", monkeypatch)
    (tmp_path / "served" / "file.pth").write_text("<html>log in</html>")
    answer = typed("models", "fetch", "vlv-value")
    assert answer.code == 1
    assert f"{url}: a web page, not weights" in answer.err
    assert list(weights.iterdir()) == []


def test_without_pytorch_weights_that_it_must_check_are_not_downloaded(
    typed: Typed, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, weights: Path, url: str
) -> None:
    serve_instead(tmp_path, url, "vlv-value", monkeypatch)
    monkeypatch.setattr(torch_runtime, "torch_is_installed", lambda: False)
    answer = typed("models", "fetch", "vlv-value")
    assert answer.code == 1
    assert "needs PyTorch, which is not installed" in answer.err
    assert not weights.exists()


def test_a_dead_link_names_the_page_of_the_authors_and_where_to_put_the_file(
    typed: Typed, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, weights: Path, url: str
) -> None:
    serve_instead(tmp_path, f"{url}.gone", "pirlnav-rl", monkeypatch)
    answer = typed("models", "fetch", "pirlnav-rl")
    assert answer.code == 1
    assert "404" in answer.err
    assert "https://github.com/Ram81/pirlnav#reproducing-results" in answer.err
    assert str(weights / "pirlnav.ckpt") in answer.err
    assert "vsnbench models check pirlnav" in answer.err
