"""`vsnbench view`: the file, the web viewer, and errors."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import numpy.typing as npt
import psutil
import pytest
from playwright.sync_api import Page

from tests.cli.chromium import chromium
from tests.cli.console import Answer, vsnbench
from tests.processes import has_ended, wait_until
from tests.viewer.synthetic_episode import record
from vsnbench.results.files.directory import ResultsDirectory

WIDTH, HEIGHT = 1600, 1000
DRAWN_WITHIN_S = 180.0
PLAN = (slice(60, 620), slice(480, 1130))
"""Rows and columns of the floor plan."""
GREEN_PIXELS = 500
"""Minimum number of green pixels there when the goals are drawn."""


@pytest.fixture
def results(tmp_path: Path) -> Path:
    return tmp_path / "results"


def directory(path: Path) -> ResultsDirectory:
    return ResultsDirectory.locate(path, environment={})


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "vsnbench.cli.main", "view", *arguments]


@pytest.fixture
def view(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], results: Path) -> Callable[..., Answer]:
    """Types `vsnbench view` where there is no display."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    record(directory(results), 2)
    return lambda *words: vsnbench(monkeypatch, capsys, "view", *words, "--results", str(results))


def test_path_prints_the_file_and_builds_it_first(view: Callable[..., Answer], results: Path) -> None:
    done = view("1", "--path")
    assert done.code == 0, done.err
    file = Path(done.out.strip())
    assert file == results / "episodes" / "000001" / "episode.rrd"
    assert file.read_bytes()[:4] == b"RRF2"


def test_without_a_display_and_on_a_port_in_use_nothing_is_shown(view: Callable[..., Answer]) -> None:
    hidden = view("1")
    assert (hidden.code, hidden.out) == (1, "")
    assert "there is no display" in hidden.err
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused = view("1", "--web", "--port", str(port))
    assert refused.code == 2
    assert f"127.0.0.1:{port}" in refused.err


def listeners_of(root: int) -> set[str]:
    """Return the addresses on which a process and its children listen."""
    family = [psutil.Process(root), *psutil.Process(root).children(recursive=True)]
    return {
        connection.laddr.ip
        for process in family
        for connection in process.net_connections("inet")
        if connection.status == psutil.CONN_LISTEN
    }


def test_the_viewer_ends_when_the_command_is_killed(results: Path) -> None:
    number = record(directory(results), 2)
    server = subprocess.Popen(
        command(str(number), "--web", "--port", "0", "--results", str(results)), stdout=subprocess.PIPE, text=True
    )
    assert server.stdout is not None
    with server.stdout:
        assert server.stdout.readline().startswith("http://127.0.0.1:")
    viewers = psutil.Process(server.pid).children(recursive=True)
    assert [viewer.name() for viewer in viewers] == ["rerun"]
    server.kill()
    server.wait()
    wait_until(lambda: all(map(has_ended, viewers)), "the viewer ends with the command")


def variety(picture: npt.NDArray[np.uint8]) -> int:
    """Return the number of colours (4 bits per channel) in at least a thousandth of the pixels."""
    coarse = (picture // 16).reshape(-1, 3).astype(np.int64) @ np.array([256, 16, 1])
    return int((np.bincount(coarse) > coarse.size / 1000).sum())


def greenish(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return the pixels of a BGR image with the colour of goal instances."""
    blue, green, red = (picture[..., channel].astype(int) for channel in range(3))
    return (green > red + 50) & (green > blue + 40) & (green > 120)


@pytest.mark.browser
def test_the_web_viewer_shows_every_panel_and_contacts_no_other_host(results: Path, tmp_path: Path) -> None:
    number = record(directory(results), 8)
    server = subprocess.Popen(
        command(str(number), "--web", "--port", "0", "--results", str(results)), stdout=subprocess.PIPE, text=True
    )
    try:
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        assert listeners_of(server.pid) == {"127.0.0.1"}, "on the loopback interface only"
        requested: set[str | None] = set()
        answered: set[str | None] = set()
        with chromium(webgl=True) as browser:
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.on("request", lambda request: requested.add(urlsplit(request.url).hostname))
            page.on("response", lambda response: answered.add(urlsplit(response.url).hostname))
            page.goto(f"{address}&renderer=webgl", timeout=DRAWN_WITHIN_S * 1000)
            picture = shown_panels(page)
        (tmp_path / "view.png").write_bytes(cv2.imencode(".png", picture)[1].tobytes())
        assert answered - {None} == {"127.0.0.1"}
        assert "tel.rerun.io" not in requested, "no usage statistics"
        # The plan is not mirrored: the armchair is lower left of the dining chairs.
        rows, columns = np.nonzero(greenish(picture[PLAN]))
        armchair = columns < np.quantile(columns, 0.02) + 20
        assert rows[armchair].mean() > rows[(columns > columns[armchair].max()) & (columns < 400)].mean()
    finally:
        server.send_signal(signal.SIGINT)
        assert server.wait(15) == 0, "Ctrl-C ends it without an error"


def shown_panels(page: Page) -> npt.NDArray[np.uint8]:
    """Return a screenshot in BGR as soon as every panel is drawn."""
    panels = {
        "rgb": (slice(230, 590), slice(5, 460)),
        "depth": (slice(645, 960), slice(5, 460)),
        "floor plan": (slice(70, 630), slice(480, 1125)),
        "actions": (slice(690, 765), slice(480, 1125)),
        "verdict": (slice(60, 400), slice(1135, 1590)),
        "decision": (slice(430, 650), slice(1135, 1590)),
    }
    needed = {"rgb": 12, "depth": 12, "floor plan": 8, "actions": 4, "verdict": 3, "decision": 3}
    deadline = time.monotonic() + DRAWN_WITHIN_S
    while True:
        shot = cv2.imdecode(np.frombuffer(page.screenshot(timeout=DRAWN_WITHIN_S * 1000), np.uint8), cv2.IMREAD_COLOR)
        assert shot is not None
        picture = np.asarray(shot, np.uint8)
        found = {name: variety(picture[where]) for name, where in panels.items()}
        green = int(np.count_nonzero(greenish(picture[PLAN])))
        if all(found[name] >= count for name, count in needed.items()) and green > GREEN_PIXELS:
            return picture
        assert time.monotonic() < deadline, f"panels stay blank: {found}, {green} green pixels"
        page.wait_for_timeout(3000)  # every screenshot costs a software renderer a whole frame
