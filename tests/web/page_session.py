"""A session with the operator's page. Episode 1 awaits a judgement, and the next trial is a chair from mark 2."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests.results.records_of_a_lab import begun, cell, plan, run, stopped
from tests.runner.stand_ins import ScriptedPolicy, StandInRobot
from tests.web.browser import Browser
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor
from vsnbench.runner.loop.contract import Session, TrialExecutor
from vsnbench.runner.operator.contract import EndedEpisode, TrialCounts, Upcoming
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.values.battery import Battery
from vsnbench.web.operator.page import OperatorPage


@dataclass
class PageSession:
    """The parts of a session that a test uses."""

    prompts: OperatorPrompts
    journal: Journal
    address: str
    robots: TrialExecutor
    camera: list[npt.NDArray[np.uint8]]
    """The live camera image, or nothing."""
    stops: list[str] = field(default_factory=list)
    """Stop requests and halts, in order."""

    def browser(self, name: str = "") -> Browser:
        """Return a browser that has opened the page, and has signed in if a name is given."""
        entered = Browser(self.address).enter()
        entered.csrf_token = entered.ask("GET", "/state").json["csrf_token"]
        if name:
            answer = entered.post("/sign-in", name=name)
            entered.cookie = answer.headers["set-cookie"].partition(";")[0]
        return entered


@contextmanager
def page_session(directory: Path) -> Iterator[PageSession]:
    """Serve the page of a session with a new results directory."""
    results = ResultsDirectory.locate(directory / "results", None)
    results.prepare()
    with Journal.open(sqlite_url(results.path / "vsnbench.db")) as journal:
        campaign = journal.find_or_create_campaign(plan())
        run(journal, campaign.trials[0], replace(stopped(success=True), proposed=True))
        claim = begun(journal, campaign.trials[1])
        site, stops = cell(), []
        camera: list[npt.NDArray[np.uint8]] = []
        robots = InProcessExecutor(StandInRobot(), lambda _trial: DrivingModel(ScriptedPolicy([]), "arm A"))
        robots.preview = lambda: camera[0] if camera else None
        session = Session(
            label="puck in cell",
            trials=TrialCounts(4, 1),
            parameters=ProtocolParameters(),
            robots=robots,
            site=site,
            journal=journal,
            recording=RecordingOptions(results, operator_name="lab"),
            campaign_ids=(campaign.id,),
        )
        batteries = [Battery(0.84), Battery(0.71)]
        prompts = OperatorPrompts(None, lambda: stops.append("halt"), lambda request: stops.append(request.description))
        prompts.state.read_battery = lambda: batteries.pop(0) if len(batteries) > 1 else batteries[0]
        parameters = ProtocolParameters()
        prompts.state.trial_begins(
            Upcoming(claim.id, claim.trial.id, "arm A", EpisodePlan(site, "chair", site.starts[1], 7, parameters))
        )
        with OperatorPage(port=0).serve(prompts, session) as text:
            yield PageSession(prompts, journal, text.split()[-1], robots, camera, stops)


def ended_episode(session: PageSession) -> EndedEpisode:
    """Return episode 1 as it ends, with the verdict that is proposed in the database."""
    upcoming = session.prompts.state.upcoming
    assert upcoming is not None
    proposed = Verdict(EndReason.STEP_LIMIT, False, "failed")
    return EndedEpisode(1, upcoming.plan, EpisodeEnd(proposed, 4, None, 1.0, proposed=True))
