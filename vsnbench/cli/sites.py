"""`vsnbench sites`: list, show, check, draw, render, generate, edit and export sites."""

import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.site_scan import scan
from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.cli.support.output import Json, print_files, print_json, print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import SiteError, UsageError
from vsnbench.report.table import Column
from vsnbench.text.sanitize import counted

if TYPE_CHECKING:
    from vsnbench.sites.site import Site

app = typer.Typer(
    no_args_is_help=True,
    help="""List, show, check, draw and edit sites: surveyed places, one YAML file each.

    vsnbench sites list
    vsnbench sites check my-flat.yaml --robot lola2
    vsnbench sites draw apartment --output plan.svg
    vsnbench sites render apartment --output apartment.png
    vsnbench sites generate --seed 7 --output flat.yaml
    vsnbench sites export my-flat.yaml --map map.yaml
    vsnbench sites edit my-flat.yaml --underlay map.yaml
    vsnbench sites scan flat.glb my-flat.yaml
    """,
)

SiteArgument = Annotated[
    str, typer.Argument(help="Name of an embedded site, path of a site file, or flat:SEED for a generated one.")
]

_FLAT = "flat:"


def _site(name: str) -> "Site":
    """Return the site with that name, as `run --site` does; imports what a generated one needs only for it."""
    if name.startswith(_FLAT):
        from vsnbench.runner.setup.selection import named_site

        return named_site(name)
    from vsnbench.sites.site import load_site

    return load_site(name)


@app.command("list")
def list_sites(as_json: Json = False) -> None:
    """List the embedded sites."""
    from vsnbench.sites.site import embedded_sites, load_site

    sites = [(load_site(name), path) for name, path in embedded_sites().items()]
    if as_json:
        rows = [
            {
                "name": site.name,
                "title": site.title,
                "area_m2": round(site.area_m2, 2),
                "rooms": len(site.rooms),
                "objects": len(site.objects),
                "starts": len(site.starts),
                "path": str(path),
            }
            for site, path in sites
        ]
        print_json(rows)
        return
    numbers = (Column(heading) for heading in ("area", "rooms", "objects", "starts"))
    lines = []
    for site, _ in sites:
        counts = (len(site.rooms), len(site.objects), len(site.starts))
        lines.append((safe(site.name), safe(site.title), f"{site.area_m2:.1f} m²", *map(str, counts)))
    print_list((name_column("name"), prose_column("title"), *numbers), lines)


@app.command()
def show(site_name: SiteArgument, as_json: Json = False) -> None:
    """Show a site: its rooms, doors, goal instances and starting positions.

    vsnbench sites show apartment
    """
    from vsnbench.sites.categories import GOAL_CATEGORIES
    from vsnbench.sites.targets import targets_of
    from vsnbench.text.terminal import Console

    site = _site(site_name)
    if as_json:
        defined = [goal.content() | {"sha256": goal.sha256} for goal in site.goals]
        content = site.content() | {"goals": defined, "area_m2": round(site.area_m2, 2), "sha256": site.sha256}
        print_json(content)
        return
    console = Console()
    console.print(f"[bold]{safe(site.name)}[/bold]  {safe(site.title)}")
    console.print(f"{site.area_m2:.1f} m², ceiling {site.ceiling_height_m:g} m, content {site.sha256[:12]}")
    rooms = ", ".join(f"{room.name} {room.shape.area:.1f} m²" for room in site.rooms)
    console.print(f"rooms: {safe(rooms)}", highlight=False)
    doors = ", ".join(f"{door.name} {door.length_m:.2f} m{' (closed)' if door.closed else ''}" for door in site.doors)
    console.print(f"doors: {safe(doors or 'none')}\n", highlight=False)
    instances = {goal: ", ".join(safe(thing.id) for thing in site.instances(goal)) for goal in GOAL_CATEGORIES}
    goals = [(goal, names or "[yellow]none[/yellow]") for goal, names in instances.items()]
    print_list((Column("goal", number=False), prose_column("instances")), goals)
    typer.echo()
    if site.goals:
        rows = []
        for goal in site.goals:
            targets = ", ".join(target.id for target in targets_of(site, goal.id))
            rows.append((safe(goal.id), goal.kind.value, safe(goal.text or goal.category), safe(targets)))
        print_list(
            (
                Column("goal", number=False),
                Column("kind", number=False),
                prose_column("words"),
                prose_column("targets"),
            ),
            rows,
        )
        typer.echo()
    starts = []
    for start in site.starts:
        x_m, y_m = start.position
        row = (str(start.number), f"({x_m:.2f}, {y_m:.2f})", f"{start.heading_deg:g}°", safe(start.note))
        starts.append(row)
    numbers = (Column(heading) for heading in ("start", "at", "heading"))
    print_list((*numbers, prose_column("note")), starts)


@app.command()
def check(
    site_name: SiteArgument,
    robot: Annotated[str, typer.Option(help="Robot profile whose radius is used.")] = "turtlebot2",
    as_json: Json = False,
) -> None:
    """Check a site; exit code 1 if there are errors.

    vsnbench sites check my-flat.yaml
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.site_checks.check import check_site, check_site_file
    from vsnbench.site_checks.finding import Severity, SiteFinding

    profile = load_profile(robot)
    radius_m = profile.base.radius_m
    if not site_name.startswith(_FLAT):
        site, findings = check_site_file(site_name, radius_m)
    else:
        site = _site(site_name)
        findings = check_site(site, radius_m)
    name = site_name if site is None else site.name
    if site is not None and not any(finding.severity is Severity.ERROR for finding in findings):
        from vsnbench.simulator.scan.comparison import scan_findings
        from vsnbench.simulator.scene import build_scene

        try:
            build_scene(site)  # only the simulator knows the appearances
            findings += scan_findings(site)
        except SiteError as problem:
            findings.append(SiteFinding(Severity.ERROR, "unknown-look", f"site {site.name}:", str(problem)))
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    fields = {"site": name, "robot": profile.name, "findings": [finding.content() for finding in findings]}
    lines = [f"{finding.severity.value}: {finding.message}" for finding in findings]
    warnings = len(findings) - errors
    lines += [f"{name} for {profile.name}: {counted(errors, 'error')}, {counted(warnings, 'warning')}"]
    print_result(fields, "\n".join(lines), as_json=as_json)
    if errors:
        raise typer.Exit(1)


@app.command()
def draw(
    site_name: SiteArgument,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output", "-o", show_default="NAME-plan.svg and .png", help="Path of the plan: .svg, .png or .pdf."
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option("--goal", help="Category or goal of the site in colour, with the region in which STOP succeeds."),
    ] = None,
    starts: Annotated[bool, typer.Option(help="Draw the starting positions.")] = True,
    grid: Annotated[bool, typer.Option("--grid", help="Draw axes in metres and a grid.")] = False,
    as_json: Json = False,
) -> None:
    """Draw the floor plan; with --goal, also the region in which STOP succeeds.

    vsnbench sites draw apartment --output plan.pdf --goal chair
    """
    from vsnbench.protocol.judge import success_region
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.report.plan.floor_plan import PlanStyle, save_floor_plan
    from vsnbench.runner.setup.selection import resolve_goals

    site = _site(site_name)
    if goal is not None:
        (goal,) = resolve_goals([goal], site)
    reached = success_region(site, goal, ProtocolParameters()) if goal is not None else None
    paths = [Path(file) for file in output or [f"{site.name}-plan.svg", f"{site.name}-plan.png"]]
    for path in paths:
        if path.suffix not in (".svg", ".png", ".pdf"):
            raise UsageError(f"cannot draw {path}", advice="name a file that ends in .svg, .png or .pdf")
        try:
            save_floor_plan(site, path, PlanStyle(starts=starts, highlight=goal, success=reached, grid=grid))
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    print_files(paths, as_json=as_json)


@app.command()
def render(
    site_name: SiteArgument,
    output: Annotated[
        str,
        typer.Option("--output", "-o", show_default="NAME-render.png", help="Path of the image: .png or .jpg."),
    ] = "",
    as_json: Json = False,
) -> None:
    """Render every room and object as the simulated camera sees them.

    vsnbench sites render apartment --output apartment.png
    """
    from vsnbench.simulator.rendering.contact_sheet import contact_sheet, save_image

    site = _site(site_name)
    path = Path(output or f"{site.name}-render.png")
    if path.suffix not in (".png", ".jpg"):
        raise UsageError(f"cannot render to {path}", advice="name a file that ends in .png or .jpg")
    if not path.parent.is_dir():
        raise UsageError(f"cannot write {path}: directory {path.parent} does not exist")
    image = contact_sheet(site)
    try:
        save_image(image, path)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    print_files([path], as_json=as_json)


@app.command()
def generate(
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the flat.")],
    output: Annotated[
        str,
        typer.Option(
            "--output", "-o", show_default="flat-SEED.yaml", help="Path of the site file (.yaml); - for stdout."
        ),
    ] = "",
    as_json: Json = False,
) -> None:
    """Generate a furnished flat of 50 to 100 m² with all goal categories; `--site flat:SEED` is the same.

    vsnbench sites generate --seed 7
    vsnbench run --model oracle --goal chair --site flat-7.yaml
    """
    from vsnbench.interop.site_file import site_yaml, write_site
    from vsnbench.simulator.generated_sites.generate import generate_site

    path = Path(output or f"flat-{seed}.yaml")
    if output != "-" and path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot write a site to {path}", advice="name a file that ends in .yaml")
    site = generate_site(seed)
    if output != "-":
        write_site(site, path)
        print_files([path], as_json=as_json)
    elif as_json:
        print_json(site.content())
    else:
        typer.echo(site_yaml(site), nl=False)


@app.command()
def edit(
    site_file: Annotated[str, typer.Argument(help="Path of the site file; a new one is created.")],
    underlay: Annotated[
        str, typer.Option("--underlay", help="Background of the plan: map.yaml of a ROS map, or an image.")
    ] = "",
    scan_file: Annotated[
        Path | None,
        typer.Option("--scan", metavar="FILE", help="Scan to start a new site from, in metres; as `sites scan` does."),
    ] = None,
    robot: Annotated[str, typer.Option("--robot", help="Robot profile for the checks.")] = "turtlebot2",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0 for any free port.")] = 0,
) -> None:
    """Edit a site in the browser, with its checks. Comments in the file are kept. Ctrl-C stops the editor.

    vsnbench sites edit lab.yaml --underlay map.yaml
    vsnbench sites edit lab.yaml --scan flat.glb
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.sites.site import embedded_sites
    from vsnbench.web.site_editor.editor import MAX_BODY_BYTES, SiteEditor
    from vsnbench.web.site_editor.scan_import import import_scan
    from vsnbench.web.site_editor.underlay import Underlay
    from vsnbench.web_server.server import WebServer
    from vsnbench.web_server.session_key import SessionKey

    path = Path(site_file)
    if site_file in embedded_sites():
        raise UsageError(
            f"{site_file} is an embedded site", advice=f"copy it first: cp {embedded_sites()[site_file]} my-flat.yaml"
        )
    if path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot edit {site_file}", advice="name a file that ends in .yaml")
    background = Underlay.of_file(Path(underlay)) if underlay else None
    if scan_file is not None:
        if path.exists():
            raise UsageError(f"{path} exists", advice="give --scan only for a new site file", code="file-exists")
        import_scan(scan_file, path)
    editor = SiteEditor(path, load_profile(robot), background)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with WebServer(editor.app(), SessionKey.new(), port=port, max_body_bytes=MAX_BODY_BYTES) as server:
        typer.echo(f"editing {path} at {server.addresses[0]}")
        try:
            ended.wait()
        except KeyboardInterrupt:
            typer.echo("")


@app.command("export")
def export_site(
    site_name: SiteArgument,
    ros_map: Annotated[Path, typer.Option("--map", help="Path of the map.yaml; the PGM file is written next to it.")],
    resolution: Annotated[
        float, typer.Option("--resolution", min=0.005, max=1.0, help="Side of a map cell in metres.")
    ] = 0.05,
    furniture: Annotated[bool, typer.Option(help="Draw the objects.")] = True,
    as_json: Json = False,
) -> None:
    """Write a site as a map for map_server of ROS.

    vsnbench sites export apartment --map apartment-map.yaml
    """
    from vsnbench.interop.ros_map import write_ros_map
    from vsnbench.interop.site_map import map_of_site

    if ros_map.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot write a map to {ros_map}", advice="name a file that ends in .yaml")
    site = _site(site_name)
    print_files(write_ros_map(map_of_site(site, resolution, furniture=furniture), ros_map), as_json=as_json)


app.command()(scan)
