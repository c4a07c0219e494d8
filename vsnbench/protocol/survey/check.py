"""Says everything that is wrong with a surveyed site at once, before a robot or a simulator finds out."""

from pathlib import Path

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.settings_file import SettingsFault
from vsnbench.protocol.site import Site, load_site, site_file_faults
from vsnbench.protocol.survey.building import building_findings
from vsnbench.protocol.survey.facing import facing_findings
from vsnbench.protocol.survey.finding import Entry, Severity, SiteFinding
from vsnbench.protocol.survey.rooms import room_findings
from vsnbench.protocol.survey.starts import start_findings
from vsnbench.protocol.survey.things import object_findings


def layout_findings(site: Site) -> list[SiteFinding]:
    """Return what is wrong with a site whatever drives in it: its building and what stands there."""
    return [*facing_findings(site), *room_findings(site), *building_findings(site), *object_findings(site)]


def check_site(site: Site, robot_radius_m: float, parameters: ProtocolParameters | None = None) -> list[SiteFinding]:
    """Return everything that is wrong with a site for a robot of that radius; errors first, empty when it is sound."""
    rules = ProtocolParameters() if parameters is None else parameters
    space = free_space(site, robot_radius_m)
    findings = [*layout_findings(site), *start_findings(site, space, rules)]
    return sorted(findings, key=lambda finding: finding.severity is not Severity.ERROR)


def check_site_file(name_or_path: str | Path, robot_radius_m: float) -> tuple[Site | None, list[SiteFinding]]:
    """Return a site, None where its file breaks the format, and everything that is wrong with it.

    Raises:
        UsageError: there is no such site.
        SiteError: the file cannot be read.
    """
    faults = site_file_faults(name_or_path)
    if faults:
        return None, [format_finding(fault) for fault in faults]
    site = load_site(name_or_path)
    return site, check_site(site, robot_radius_m)


def format_finding(fault: SettingsFault) -> SiteFinding:
    """Return a break of the file's format as a finding."""
    list_name, number = (*fault.path, None, None)[:2]
    entries: tuple[Entry, ...] = ()
    if isinstance(list_name, str) and isinstance(number, int):
        entries = ((list_name, number),)
    return SiteFinding(
        Severity.ERROR, "format", f"{fault.where}:", fault.statement, fault.mend, entries=entries, line=fault.line
    )
