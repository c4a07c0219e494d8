"""`vsnbench sites`: list, show, check, draw and picture surveyed places, and generate made-up ones."""

from typing import Annotated

import typer

from vsnbench.cli import site_exchange, site_scan
from vsnbench.cli.output import Json, print_files, print_json

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="""List, show, check, draw, picture and generate sites: surveyed places, one YAML file each.

    vsnbench sites list
    vsnbench sites check my-flat.yaml --robot lola2
    vsnbench sites draw apartment --output plan.svg
    vsnbench sites look apartment --output look.png
    vsnbench sites generate --seed 7 --output flat.yaml
    vsnbench sites export my-flat.yaml --geojson flat.geojson
    vsnbench sites import flat.geojson --output copy.yaml
    vsnbench sites scan --robot turtlebot2 --output map.yaml
    vsnbench sites edit my-flat.yaml --underlay map.yaml
    """,
)

SiteArgument = Annotated[str, typer.Argument(help="An embedded site's name, or the path of a site file.")]


@app.command("list")
def list_sites(as_json: Json = False) -> None:
    """List the sites that ship with vsnbench."""
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, name_column, print_list, prose_column
    from vsnbench.protocol.site import embedded_sites, load_site

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
    numbers = (ListColumn(heading, right=True) for heading in ("area", "rooms", "objects", "starts"))
    lines = []
    for site, _ in sites:
        counts = (len(site.rooms), len(site.objects), len(site.starts))
        lines.append((safe(site.name), safe(site.title), f"{site.area_m2:.1f} m²", *map(str, counts)))
    print_list((name_column("name"), prose_column("title"), *numbers), lines)


@app.command()
def show(site_name: SiteArgument, as_json: Json = False) -> None:
    """Show a site: its rooms, what stands where, and where episodes start.

    vsnbench sites show apartment
    """
    from rich.console import Console

    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, print_list, prose_column
    from vsnbench.protocol.categories import GOAL_CATEGORIES
    from vsnbench.protocol.site import load_site

    site = load_site(site_name)
    if as_json:
        content = site.content() | {"area_m2": round(site.area_m2, 2), "sha256": site.sha256}
        print_json(content)
        return
    console = Console()
    console.print(f"[bold]{site.name}[/bold]  {site.title}")
    console.print(f"{site.area_m2:.1f} m², ceiling {site.ceiling_height_m:g} m, content {site.sha256[:12]}")
    rooms = ", ".join(f"{room.name} {room.shape.area:.1f} m²" for room in site.rooms)
    console.print(f"rooms: {rooms}", highlight=False)
    doors = ", ".join(
        f"{door.name} {door.clear_width_m:.2f} m{' (closed)' if door.closed else ''}" for door in site.doors
    )
    console.print(f"doors: {doors or 'none'}\n", highlight=False)
    instances = {goal: ", ".join(safe(thing.id) for thing in site.instances(goal)) for goal in GOAL_CATEGORIES}
    goals = [(goal, names or "[yellow]none[/yellow]") for goal, names in instances.items()]
    print_list((ListColumn("goal"), prose_column("instances")), goals)
    typer.echo()
    starts = []
    for start in site.starts:
        x_m, y_m = start.position
        row = (str(start.number), f"({x_m:.2f}, {y_m:.2f})", f"{start.heading_deg:g}°", safe(start.note))
        starts.append(row)
    numbers = (ListColumn(heading, right=True) for heading in ("start", "at", "heading"))
    print_list((*numbers, prose_column("note")), starts)


@app.command()
def check(
    site_name: SiteArgument,
    robot: Annotated[str, typer.Option(help="Whose radius: a robot profile's name.")] = "turtlebot2",
    as_json: Json = False,
) -> None:
    """Say everything that is wrong with a site, and how to mend it; exit code 1 when trials there are worth nothing.

    vsnbench sites check my-flat.yaml
    """
    from vsnbench.errors import SiteError
    from vsnbench.protocol.survey.check import check_site_file
    from vsnbench.protocol.survey.finding import Severity, SiteFinding
    from vsnbench.robots.profiles import load_profile

    profile = load_profile(robot)
    site, findings = check_site_file(site_name, profile.base.radius_m)
    name = site_name if site is None else site.name
    if site is not None and not any(finding.severity is Severity.ERROR for finding in findings):
        from vsnbench.simulator.scene import build_scene

        try:
            build_scene(site)  # only the simulator knows the looks
        except SiteError as problem:
            findings.append(SiteFinding(Severity.ERROR, "unknown-look", f"site {site.name}:", str(problem)))
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    if as_json:
        rows = [finding.content() for finding in findings]
        print_json({"site": name, "robot": profile.name, "findings": rows})
    else:
        for finding in findings:
            typer.echo(f"{finding.severity.value}: {finding.message}")
        warnings = len(findings) - errors
        counted = (
            f"{_count(errors, 'error')}, {_count(warnings, 'warning')}" if findings else "nothing to complain about"
        )
        typer.echo(f"{name} for {profile.name}: {counted}")
    if errors:
        raise typer.Exit(1)


@app.command()
def draw(
    site_name: SiteArgument,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", "-o", help="Where to: .svg, .png or .pdf; NAME-plan.svg and .png when absent."),
    ] = None,
    goal: Annotated[
        str | None, typer.Option(help="Show this goal in colour, the others in grey, and from where STOP succeeds.")
    ] = None,
    starts: Annotated[bool, typer.Option(help="Show the starting positions.")] = True,
    grid: Annotated[bool, typer.Option("--grid", help="Show axes in metres and a grid.")] = False,
    as_json: Json = False,
) -> None:
    """Draw the floor plan as for a paper; with a goal, also from where STOP succeeds at it.

    vsnbench sites draw apartment --output plan.pdf --goal chair
    """
    from pathlib import Path

    from vsnbench.errors import UsageError
    from vsnbench.protocol.judge import success_region
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.site import load_site
    from vsnbench.report.plan.floor_plan import PlanStyle, save_floor_plan

    site = load_site(site_name)
    if goal is not None and not site.instances(goal):
        raise UsageError(f"site {site.name} has no {goal}; it has {', '.join(sorted(site.categories))}")
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
def look(
    site_name: SiteArgument,
    output: Annotated[
        str, typer.Option("--output", "-o", help="Where to: .png or .jpg; NAME-look.png when absent.")
    ] = "",
    as_json: Json = False,
) -> None:
    """Picture every room and everything that stands in it, as a simulated camera sees it.

    vsnbench sites look apartment --output look.png
    """
    from pathlib import Path

    from vsnbench.errors import UsageError
    from vsnbench.protocol.site import load_site
    from vsnbench.simulator.contact_sheet import contact_sheet, save_image

    site = load_site(site_name)
    path = Path(output or f"{site.name}-look.png")
    if path.suffix not in (".png", ".jpg"):
        raise UsageError(f"cannot picture {path}", advice="name a file that ends in .png or .jpg")
    if not path.parent.is_dir():
        raise UsageError(f"cannot write {path}: there is no directory {path.parent}")
    image = contact_sheet(site)
    try:
        save_image(image, path)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    print_files([path], as_json=as_json)


@app.command()
def generate(
    seed: Annotated[int, typer.Option(min=0, help="The same seed always gives the same flat.")],
    output: Annotated[
        str, typer.Option("--output", "-o", help="Where to: a .yaml file; twin-SEED.yaml when absent, - for stdout.")
    ] = "",
    as_json: Json = False,
) -> None:
    """Make up a furnished flat of 50 to 100 m2 that passes every check, with all goal categories in it.

    vsnbench sites generate --seed 7
    vsnbench run --model oracle --goal chair --site twin-7.yaml
    """
    from pathlib import Path

    from vsnbench.errors import UsageError
    from vsnbench.exchange.site_file import site_yaml, write_site
    from vsnbench.simulator.twins.generate import generate_site

    path = Path(output or f"twin-{seed}.yaml")
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
    site_file: Annotated[str, typer.Argument(help="The site's file; a new one where there is none.")],
    underlay: Annotated[
        str, typer.Option(help="Lay this under the plan: a ROS map's map.yaml, or a picture of a plan.")
    ] = "",
    robot: Annotated[str, typer.Option(help="Check for this robot: a profile's name.")] = "turtlebot2",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page on 127.0.0.1; 0 for any.")] = 0,
) -> None:
    """Draw and correct a site in the browser, its checks beside it; the file's comments are kept. Ctrl-C ends.

    vsnbench sites edit lab.yaml --underlay map.yaml
    """
    import signal
    import threading
    from pathlib import Path

    from vsnbench.console.plan_underlay import Underlay
    from vsnbench.console.session_key import SessionKey
    from vsnbench.console.site_editor import MOST_BODY_BYTES, SiteEditor
    from vsnbench.console.web_server import WebServer
    from vsnbench.errors import UsageError
    from vsnbench.protocol.site import embedded_sites
    from vsnbench.robots.profiles import load_profile

    path = Path(site_file)
    if site_file in embedded_sites():
        raise UsageError(
            f"{site_file} is an embedded site", advice=f"copy it first: cp {embedded_sites()[site_file]} my-flat.yaml"
        )
    if path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"a site file ends in .yaml, and {site_file} does not")
    below = Underlay.of_file(Path(underlay)) if underlay else None
    editor = SiteEditor(path, load_profile(robot), below)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    key, most = SessionKey.new(), MOST_BODY_BYTES
    with WebServer(editor.app(), key, port=port, most_body_bytes=most, port_option="--port") as server:
        typer.echo(f"{path} is edited at {server.addresses[0]}")
        try:
            ended.wait()
        except KeyboardInterrupt:
            typer.echo("")


app.command("export")(site_exchange.export_site)
app.command("import")(site_exchange.import_site)
app.command("scan")(site_scan.command)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
