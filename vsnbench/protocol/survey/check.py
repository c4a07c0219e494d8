"""Says everything that is wrong with a surveyed site at once, before a robot or a simulator finds out."""

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.survey.building import building_findings
from vsnbench.protocol.survey.finding import Severity, SiteFinding
from vsnbench.protocol.survey.starts import start_findings
from vsnbench.protocol.survey.things import object_findings


def layout_findings(site: Site) -> list[SiteFinding]:
    """Return what is wrong with a site whatever drives in it: its building and what stands there."""
    return [*building_findings(site), *object_findings(site)]


def check_site(site: Site, robot_radius_m: float, parameters: ProtocolParameters | None = None) -> list[SiteFinding]:
    """Return everything that is wrong with a site for a robot of that radius; errors first, empty when it is sound."""
    rules = ProtocolParameters() if parameters is None else parameters
    space = free_space(site, robot_radius_m)
    findings = [*layout_findings(site), *start_findings(site, space, rules)]
    return sorted(findings, key=lambda finding: finding.severity is not Severity.ERROR)
