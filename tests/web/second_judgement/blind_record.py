"""A record of 40 episodes of two models that a first person has judged, with telltale texts, and its rater's page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tests.results.records_of_a_lab import plan, run, stopped
from tests.web.browser import Browser
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.judging.second import SecondRating
from vsnbench.sites.site import parse_site
from vsnbench.values.fix import PoseSource
from vsnbench.web.second_judgement.app import SecondJudgementApp
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey

MODELS = ("okapi-net", "quokka-vlm")
JUDGE = "Ada Firstjudge"
FIRST_TEXT = "zorilla"
"""Part of the texts and notes of all first verdicts."""
FIRST_DISTANCES_M = (0.4137, 2.4291)
"""Distances of first verdicts of success and failure."""
TELLTALE = (*MODELS, JUDGE, FIRST_TEXT, "0.41", "2.43", "2.42", "firsthand-weights")
STARTS = 10
_SITE = """
name: cell
title: A cell
rooms: [{name: cell, polygon: [[0, 0], [4, 0], [4, 4], [0, 4]]}]
walls: [{start: [0, 0], end: [4, 0]}]
starts: [%s]
"""


def first_success(number: int) -> bool:
    """The first verdict of an episode."""
    return number % 3 != 0


def make_record(directory: Path) -> None:
    """Write 2 models x 10 starting positions x 2 goals; image metadata and directories contain the models' names."""
    directory.mkdir(exist_ok=True)
    starts = ", ".join(f"{{number: {n}, position: [{1 + n / 10}, 1], heading_deg: 0}}" for n in range(1, STARTS + 1))
    site = parse_site(_SITE % starts, "cell.yaml")
    trials = [Trial(goal, start) for goal in ("chair", "sofa") for start in range(1, STARTS + 1)]
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        for place, name in enumerate(MODELS):
            given = plan(seed=place)
            model = replace(given.model, name=name, weights_label="firsthand-weights")
            campaign = journal.find_or_create_campaign(replace(given, site=site, model=model, trials=trials))
            for trial in campaign.trials:
                claim = run(journal, trial, replace(stopped(success=True), proposed=True))
                success = first_success(claim.id)
                distance = GoalDistance(FIRST_DISTANCES_M[not success], PoseSource.TAPE, "chair_1")
                verdict = Verdict(EndReason.STOP, success, f"{FIRST_TEXT} says {success}", distance)
                journal.judge(claim.id, verdict, author=JUDGE, note=f"{FIRST_TEXT} {name}")
                _write_images(directory / claim.images_directory / "rgb", claim.id, f"{name} {FIRST_TEXT}")


def _write_images(folder: Path, episode: int, comment: str) -> None:
    folder.mkdir(parents=True)
    for number in (1, 2, 3):
        picture = np.full((48, 64, 3), (5 * episode, 60 * number, 90), np.uint8)
        made, jpeg = cv2.imencode(".jpg", picture)
        assert made
        content, text = jpeg.tobytes(), comment.encode()
        marker = b"\xff\xfe" + (len(text) + 2).to_bytes(2, "big") + text  # a JPEG comment
        (folder / f"{number:04d}.jpg").write_bytes(content[:2] + marker + content[2:])


@contextmanager
def served(directory: Path, rater: str = "Grace", sample: int | None = None, seed: int = 0) -> Iterator[str]:
    """Serve the rater's page. Yields its address."""
    results = ResultsDirectory.locate(directory, None)
    with Journal.open(results.database_url) as journal:
        app = SecondJudgementApp(SecondRating(journal, results, rater, sample, seed))
        with WebServer(app.routes(), SessionKey.new()) as server:
            yield server.addresses[0]


def entered(address: str) -> Browser:
    """Return a client that has opened the page."""
    client = Browser(address).enter()
    client.csrf_token = client.ask("GET", "/state").json["csrf_token"]
    return client
