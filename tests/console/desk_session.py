"""A desk with its page over a record of one episode that awaits a judgement; the next trial is a chair from mark 2."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests.console.browser import Browser
from tests.database.records_of_a_lab import begun, cell, plan, run, stopped
from vsnbench.console.operator_page import OperatorPage
from vsnbench.database.journal import Journal
from vsnbench.database_url import sqlite_url
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendance import Occasion
from vsnbench.runner.attendant import EndedEpisode, Upcoming
from vsnbench.runner.desk import Desk
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan
from vsnbench.runner.stopping import Stopping


@dataclass
class Session:
    """A desk with its page, over a record with one episode (1) that awaits a judgement."""

    desk: Desk
    journal: Journal
    address: str
    camera: list[npt.NDArray[np.uint8]]
    """What its camera sees now: nothing, or one picture."""
    halts: list[str] = field(default_factory=list)

    def browser(self, name: str = "") -> Browser:
        entered = Browser(self.address).enter()
        entered.proof = entered.ask("GET", "/state").json["proof"]
        if name:
            said = entered.post("/sign-in", name=name)
            entered.cookie = said.headers["set-cookie"].partition(";")[0]
        return entered


@contextmanager
def desk_session(directory: Path) -> Iterator[Session]:
    """Serve the page of a session over a new record."""
    results = ResultsDirectory.locate(directory / "results", None)
    results.prepare()
    with Journal.open(sqlite_url(results.path / "vsnbench.db")) as journal:
        campaign = journal.find_or_create_campaign(plan())
        run(journal, campaign.trials[0], replace(stopped(success=True), proposed=True))
        claim = begun(journal, campaign.trials[1])
        site, stop, halts, desk = cell(), Stopping(), [], Desk()
        camera: list[npt.NDArray[np.uint8]] = []
        occasion = Occasion(
            label="puck in cell",
            trials=4,
            done=1,
            successes=0,
            parameters=ProtocolParameters(),
            needs_a_person=True,
            halt=lambda: halts.append("halt"),
            stop=stop,
            site=site,
            robot_radius_m=0.177,
            journal=journal,
            results=results,
            campaigns=(campaign.id,),
            operator="lab",
            glimpse=lambda: camera[0] if camera else None,
        )
        batteries = [Battery(0.84), Battery(0.71)]
        desk.board.read_battery = lambda: batteries.pop(0) if len(batteries) > 1 else batteries[0]
        desk.attends(occasion.halt, lambda request: halts.append(request.words))
        parameters = ProtocolParameters()
        desk.board.trial_begins(
            Upcoming(claim.id, claim.trial.id, "arm A", EpisodePlan(site, "chair", site.starts[1], 7, parameters))
        )
        with OperatorPage(port=0).serve(desk, occasion) as words:
            yield Session(desk, journal, words.split()[-1], camera, halts)


def ended_of(session: Session) -> EndedEpisode:
    """Episode 1 as it has just ended, with the proposal of the record."""
    upcoming = session.desk.board.upcoming
    assert upcoming is not None
    proposed = Verdict(EndReason.STEP_LIMIT, False, "failed")
    return EndedEpisode(1, upcoming.plan, EpisodeOutcome(proposed, 4, None, 1.0, proposed=True))
