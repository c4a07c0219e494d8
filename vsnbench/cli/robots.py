"""`vsnbench robots`: list, show and check robot profiles."""

from typing import Annotated

import typer

from vsnbench.cli.output import Json, print_json

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="""List, show and check robots and their profiles.

    vsnbench robots list
    vsnbench robots show lola2 > my-robot.yaml
    vsnbench robots check my-robot.yaml
    """,
)

RobotArgument = Annotated[str, typer.Argument(help="A profile's name, or the path of its file.")]


@app.command("list")
def list_robots(as_json: Json = False) -> None:
    """List what --robot knows."""
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import name_column, print_list, prose_column
    from vsnbench.robots.interface_kinds import INTERFACE_KINDS
    from vsnbench.robots.profiles import embedded_profiles, load_profile
    from vsnbench.robots.registry import known_robots

    profiles = {name: load_profile(name) for name in embedded_profiles()}
    titles = {name: profile.title for name, profile in profiles.items()}

    def what(name: str) -> str:
        kind, _, profile = name.partition(":")
        if kind == "simulated":
            return f"{titles.get(profile or 'turtlebot2', profile)} in the site's simulated twin, in this process"
        if name not in profiles:
            return "a plug-in"
        interface = profiles[name].interface
        return f"{titles[name]} {INTERFACE_KINDS[interface.kind].words if interface else ''}".strip()

    rows = [(name, what(name)) for name in known_robots()]
    if as_json:
        print_json([{"name": name, "what": text} for name, text in rows])
        return
    columns = (name_column("--robot", least=24), prose_column("what it is"))
    print_list(columns, [(safe(name), safe(text)) for name, text in rows])


@app.command()
def show(robot: RobotArgument, as_json: Json = False) -> None:
    """Print a profile as it is read, every default filled in: YAML to start your own from."""
    import yaml

    from vsnbench.robots.profiles import load_profile

    content = load_profile(robot).model_dump(mode="json")
    if as_json:
        print_json(content)
    else:
        typer.echo(yaml.safe_dump(content, sort_keys=False, allow_unicode=True).rstrip())


@app.command()
def check(robot: RobotArgument, as_json: Json = False) -> None:
    """Check a profile: unknown keys, types, ranges, and whether its parts fit together. Exit code 1 when not."""
    from vsnbench.robots.profile_check import doubts_about
    from vsnbench.robots.profiles import load_profile

    profile = load_profile(robot)
    doubts = doubts_about(profile)
    if as_json:
        print_json({"robot": profile.name, "title": profile.title, "warnings": doubts})
        return
    for doubt in doubts:
        typer.echo(f"warning: {doubt}")
    typer.echo(f"{profile.name}: {profile.title}: the profile is valid; vsnbench doctor looks at the robot itself")
