"""`vsnbench sites export` and `sites import`: sites as ROS maps, GeoJSON and SVG, and drawings as sites."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.output import Json, print_files


def export_site(
    site_name: Annotated[str, typer.Argument(help="An embedded site's name, or the path of a site file.")],
    ros_map: Annotated[
        Path | None, typer.Option("--map", help="Write a ROS map here: a map.yaml, its PGM beside it.")
    ] = None,
    geojson: Annotated[Path | None, typer.Option("--geojson", help="Write GeoJSON here, in metres.")] = None,
    svg: Annotated[Path | None, typer.Option("--svg", help="Write an SVG drawing here, one unit a metre.")] = None,
    resolution: Annotated[float, typer.Option(min=0.005, max=1.0, help="Side of a cell of the map, metres.")] = 0.05,
    furniture: Annotated[bool, typer.Option(help="Draw what stands there on the map too.")] = True,
    as_json: Json = False,
) -> None:
    """Write a site as a map that ROS's map_server reads, or for other programs; `sites import` reads the last two back.

    vsnbench sites export apartment --map apartment-map.yaml

    vsnbench sites export apartment --geojson flat.geojson --svg flat.svg
    """
    from vsnbench.errors import UsageError
    from vsnbench.exchange.ros_map import write_ros_map
    from vsnbench.exchange.site_geojson import site_geojson
    from vsnbench.exchange.site_map import map_of_site
    from vsnbench.exchange.site_svg import site_svg
    from vsnbench.protocol.site import load_site
    from vsnbench.whole_files import write_whole

    kinds = ((ros_map, "map", (".yaml", ".yml")), (geojson, "site", (".geojson", ".json")), (svg, "drawing", (".svg",)))
    for path, what, endings in kinds:
        if path is not None and path.suffix not in endings:
            raise UsageError(f"cannot write a {what} to {path}", advice=f"name a file that ends in {endings[0]}")
    if ros_map is geojson is svg is None:
        raise UsageError("nothing to write", advice="name a file with --map, --geojson or --svg")
    site = load_site(site_name)
    written: list[Path] = []
    if ros_map is not None:
        written += write_ros_map(map_of_site(site, resolution, furniture=furniture), ros_map)
    for path, text in ((geojson, site_geojson), (svg, site_svg)):
        if path is not None:
            write_whole(path, text(site).encode(), UsageError)
            written.append(path)
    print_files(written, as_json=as_json)


def import_site(
    drawing: Annotated[Path, typer.Argument(help="A .geojson or .svg file.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Where to: a .yaml file that is not there yet.")
    ] = None,
    metres_per_unit: Annotated[
        float | None,
        typer.Option(
            "--metres-per-unit", min=1e-6, max=1000.0, help="How many metres one unit of the drawing is; said by ours."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a site file of a GeoJSON file or an SVG drawing, the two that `sites export` writes.

    A drawing without rooms, walls or starts becomes a draft, for `sites edit`.

    vsnbench sites import lab.geojson --output lab.yaml

    vsnbench sites import drawing.svg --metres-per-unit 0.01 --output lab.yaml
    """
    from vsnbench.errors import SiteError, UsageError
    from vsnbench.exchange.site_drawing import read_drawing
    from vsnbench.exchange.site_file import draft_yaml
    from vsnbench.protocol.settings_file import MOST_CHARACTERS
    from vsnbench.whole_files import write_whole

    path = output or drawing.with_suffix(".yaml")
    if path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot write a site to {path}", advice="name a file that ends in .yaml")
    if path.exists():
        raise UsageError(f"{path} is there already", advice="name another file with --output")
    read = read_drawing(drawing, path.stem, metres_per_unit)
    text = draft_yaml(read.content, "sites import")
    if len(text) > MOST_CHARACTERS:
        raise SiteError(f"{drawing} makes a site file of more than {MOST_CHARACTERS:,} characters")
    write_whole(path, text.encode(), SiteError)
    print_files([path], as_json=as_json, lacks=list(read.lacks), left_out=read.left_out)
    if read.left_out:
        shapes = "a shape is" if read.left_out == 1 else f"{read.left_out} shapes are"
        typer.echo(f"left out: {shapes} in no group for rooms, walls and so on", err=True)
    if read.lacks:
        typer.echo(f"a draft, without {', '.join(read.lacks)}: vsnbench sites edit {path}", err=True)
