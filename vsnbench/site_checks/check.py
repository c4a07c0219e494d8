"""Checks of a surveyed site."""

from pathlib import Path

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.settings.validation import SettingsFault
from vsnbench.site_checks.finding import Entry, Severity, SiteFinding
from vsnbench.site_checks.headings import heading_findings
from vsnbench.site_checks.objects import object_findings
from vsnbench.site_checks.rooms import room_findings
from vsnbench.site_checks.starts import start_findings
from vsnbench.site_checks.walls import wall_findings
from vsnbench.sites.site import Site, load_site, site_file_faults


def layout_findings(site: Site) -> list[SiteFinding]:
    """Return the findings that do not depend on the robot: building and objects."""
    return [*heading_findings(site), *room_findings(site), *wall_findings(site), *object_findings(site)]


def check_site(site: Site, robot_radius_m: float) -> list[SiteFinding]:
    """Return all findings about a site for a robot with the given radius, errors first."""
    space = free_space(site, robot_radius_m)
    findings = [*layout_findings(site), *start_findings(site, space, ProtocolParameters())]
    return sorted(findings, key=lambda finding: finding.severity is not Severity.ERROR)


def check_site_file(name_or_path: str | Path, robot_radius_m: float) -> tuple[Site | None, list[SiteFinding]]:
    """Return a site and its findings; the site is None if its file breaks the format.

    Raises:
        UsageError: the site does not exist.
        SiteError: the file cannot be read.
    """
    faults = site_file_faults(name_or_path)
    if faults:
        return None, [format_finding(fault) for fault in faults]
    site = load_site(name_or_path)
    return site, check_site(site, robot_radius_m)


def format_finding(fault: SettingsFault) -> SiteFinding:
    """Return an error of the file's format as a finding."""
    list_name, number = (*fault.path, None, None)[:2]
    entries: tuple[Entry, ...] = ()
    if isinstance(list_name, str) and isinstance(number, int):
        entries = ((list_name, number),)
    return SiteFinding(
        Severity.ERROR, "format", f"{fault.where}:", fault.statement, fault.advice, entries=entries, line=fault.line
    )
