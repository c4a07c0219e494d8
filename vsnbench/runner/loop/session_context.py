"""What all trials of a session share, whichever executor runs them."""

from dataclasses import dataclass

from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.operator.contract import Operator
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import Site


@dataclass(frozen=True, slots=True)
class SessionContext:
    """Resources shared by all trials of a session."""

    journal: Journal
    operator: Operator
    stop_requests: StopRequests
    site: Site
    parameters: ProtocolParameters
    recording: RecordingOptions
    disturbances: Disturbances = NONE
    """Of what the policy sees."""
