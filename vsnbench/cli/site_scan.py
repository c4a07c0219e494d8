"""`vsnbench sites scan`: make a site from the scan of a place."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.support.output import Json, print_result
from vsnbench.errors import UsageError
from vsnbench.text.sanitize import counted


def scan(
    scan_file: Annotated[Path, typer.Argument(metavar="FILE", help="Scan: .glb, .obj with textures, .ply or .spz.")],
    site_file: Annotated[Path, typer.Argument(metavar="SITE", help="Path of the new site file (.yaml).")],
    length: Annotated[
        str,
        typer.Option("--length", metavar="SCAN=METRES", help="A length in the scan, and the same measured in metres."),
    ] = "",
    unit: Annotated[str, typer.Option("--unit", help="Unit of the scan: m, cm, mm, in or ft.")] = "m",
    up: Annotated[
        str,
        typer.Option(
            "--up",
            show_default="y; z for a .ply of triangles, -y for one of splats",
            help="Axis of the scan that points up: x to z, -x to -z.",
        ),
    ] = "",
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", help="Mesh of the same scan, for walls and obstacles, if FILE has splats."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a site from a scan: level it, scale it, and propose walls, obstacles and a starting position.

    vsnbench sites scan flat.glb my-flat.yaml
    vsnbench sites scan flat.ply my-flat.yaml --length 2.44=2.51
    vsnbench sites scan flat.spz my-flat.yaml --mesh flat.glb
    """
    from vsnbench.simulator.scan.alignment import LENGTH_UNITS, UP_AXES
    from vsnbench.web.site_editor.scan_import import import_scan

    if site_file.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot write a site to {site_file}", advice="name a file that ends in .yaml")
    if site_file.exists():
        raise UsageError(f"{site_file} exists", advice="give the name of a new file", code="file-exists")
    if unit not in LENGTH_UNITS:
        raise UsageError(f"unit {unit!r} is not known", advice=f"give one of {', '.join(LENGTH_UNITS)}")
    if up and up not in UP_AXES:
        raise UsageError(f"axis {up!r} is not known", advice=f"give one of {', '.join(UP_AXES)}")
    scale = _metres_per_unit(length) if length else LENGTH_UNITS[unit]
    site, written = import_scan(scan_file, site_file, up, scale, mesh)
    paths = [site_file, written]
    width_m, height_m = (
        max(point[k] for point in site.rooms[0].polygon) - min(point[k] for point in site.rooms[0].polygon)
        for k in (0, 1)
    )
    walls, things = counted(len(site.walls), "wall"), counted(len(site.objects), "obstacle")
    lines = [
        *(f"wrote {path}" for path in paths),
        f"{width_m:.2f} x {height_m:.2f} m, ceiling {site.ceiling_height_m:.2f} m: {walls}, {things}",
        "measure one of these lengths; if it differs, import again with --length",
        f"next: vsnbench sites edit {site_file}",
    ]
    fields = {
        "site": site.name,
        "files": [str(path) for path in paths],
        "sha256": site.scan.sha256 if site.scan is not None else "",
        "width_m": round(width_m, 3),
        "height_m": round(height_m, 3),
        "ceiling_height_m": site.ceiling_height_m,
        "walls": len(site.walls),
        "doors": len(site.doors),
        "objects": len(site.objects),
    }
    print_result(fields, "\n".join(lines), as_json=as_json)


def _metres_per_unit(length: str) -> float:
    """Return the scale that a measured length gives."""
    parts = length.split("=")
    try:
        scanned, measured = (float(part) for part in parts)
    except ValueError:
        scanned, measured = 0.0, 0.0
    if not (0 < scanned < 1e6 and 0 < measured < 1e3):
        raise UsageError(
            f"{length!r} is not a pair of lengths",
            advice="give the length in the scan and in metres, such as --length 2.44=2.51",
        )
    return measured / scanned
