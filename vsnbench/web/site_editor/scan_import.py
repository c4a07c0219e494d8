"""Imports a scan: writes the aligned scan, a proposed site, and a top-down picture as the editor's background."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import cv2

from vsnbench.errors import SiteError
from vsnbench.files.atomic import write_atomic
from vsnbench.interop.site_file import site_yaml
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.scan.alignment import align_scan
from vsnbench.simulator.scan.proposal import PLAN_M, propose_site, top_down
from vsnbench.simulator.scan.reading import read_scan, usual_up
from vsnbench.sites.scan import SCAN_SUFFIX, SiteScan
from vsnbench.sites.site import Site
from vsnbench.web.site_editor.underlay import Underlay, UnderlayPlace

_UNKNOWN = "0" * 64


def import_scan(
    source: Path, site_file: Path, up: str = "", metres_per_unit: float = 1.0, surface: Path | None = None
) -> tuple[Site, Path]:
    """Make a site from the file of a scanning app; nothing is written if the scan cannot be used.

    Args:
        source: the scan: .glb, .obj, .ply or .spz.
        site_file: path of the site's file; the scan and the picture are written next to it.
        up: axis of the file that points up; empty for the usual one of such files.
        metres_per_unit: scale of the file.
        surface: mesh of the same scan in the same frame, for walls and obstacles; splats alone have rough surfaces.

    Returns:
        The site, and the path of its scan.

    Raises:
        SiteError: the scan cannot be read, has no floor or walls, or a file cannot be written.
    """
    scan = read_scan(source, metres_per_unit)
    up = up or usual_up(source, scan)
    if surface is not None:
        if scan.splats is None:
            raise SiteError(
                f"{source} has its own triangles", advice="give a mesh only with splats", code="invalid-scan"
            )
        scan = replace(read_scan(surface, metres_per_unit), splats=scan.splats)
    mesh, _ = align_scan(scan, up, metres_per_unit)
    scan_file = site_file.with_suffix(SCAN_SUFFIX)
    name = re.sub(r"[^a-z0-9_-]+", "-", site_file.stem.lower()).strip("-_") or "scan"
    site = propose_site(mesh, name, SiteScan(file=scan_file.name, sha256=_UNKNOWN))
    with source.open("rb") as file:
        original = hashlib.file_digest(file, "sha256").hexdigest()
    site = site.model_copy(update={"scan": SiteScan(file=scan_file.name, sha256=mesh.write(scan_file))})
    _underlay(mesh, source.name).save(site_file)
    made_by = f"`vsnbench sites scan` from a file with the SHA-256 {original}"
    write_atomic(site_file, site_yaml(site, made_by).encode(), SiteError)
    return site, scan_file


def _underlay(mesh: ScanMesh, name: str) -> Underlay:
    """Return the scan from above, at its place on the plan."""
    rgb, (x_m, y_m) = top_down(mesh)
    _, png = cv2.imencode(".png", rgb[..., ::-1])
    height, width = rgb.shape[:2]
    place = UnderlayPlace(
        name=name[:200],
        x_m=x_m,
        y_m=y_m,
        heading_rad=0.0,
        width_m=width * PLAN_M,
        height_m=height * PLAN_M,
        to_scale=True,
    )
    return Underlay(bytes(png), place)
