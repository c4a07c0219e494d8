"""`vsnbench export`: episodes in the formats of other tools."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_files

logger = logging.getLogger(__name__)
app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

Numbers = Annotated[list[int] | None, typer.Argument(help="Numbers of episodes; all that have ended when absent.")]
Models = Annotated[list[str] | None, typer.Option("--model", "-m", help="Only these models.")]


@app.command()
def tum(
    directory: Annotated[Path, typer.Argument(help="Where to write; one file an episode.")],
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Trajectories in the TUM format: timestamp tx ty tz qx qy qz qw.

    Example: [bold]vsnbench export tum trajectories/ && evo_traj tum trajectories/*.tum[/bold]
    """
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import episode_steps
    from vsnbench.exchange.episodes import read_episodes, write_tum
    from vsnbench.record.results import ResultsDirectory

    written = []
    with open_record(ResultsDirectory.locate(results, db).database_url) as engine:
        for episode in read_episodes(engine, numbers or (), model or ()):
            path = directory / f"{episode.id:06d}.tum"
            write_tum(episode, episode_steps(engine, episode.id), path)
            written.append(path)
    print_files(written, as_json=as_json)


@app.command()
def habitat(
    directory: Annotated[Path, typer.Argument(help="Where to write the two files.")],
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Habitat-style episode_results.json and aggregated_results.json, of the episodes that count.

    Example: [bold]vsnbench export habitat results-habitat/ --model vlv[/bold]
    """
    from vsnbench.database.migrate import open_record
    from vsnbench.exchange.episodes import read_episodes
    from vsnbench.exchange.habitat import write_habitat
    from vsnbench.record.results import ResultsDirectory

    with open_record(ResultsDirectory.locate(results, db).database_url) as engine:
        written = write_habitat(read_episodes(engine, numbers or (), model or ()), directory)
    files = [directory / name for name in ("episode_results.json", "aggregated_results.json")]
    if as_json:
        print_files(files, as_json=True, episodes=written)
    else:
        typer.echo(f"{written} episode{'' if written == 1 else 's'} in {files[0]}")


@app.command("csv")
def csv_(
    file: Annotated[Path, typer.Argument(help="The file to write.")],
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Every step of every episode as one CSV file.

    Example: [bold]vsnbench export csv steps.csv 17 18[/bold]
    """
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import episode_steps
    from vsnbench.exchange.episodes import read_episodes
    from vsnbench.exchange.step_csv import write_steps
    from vsnbench.record.results import ResultsDirectory

    with open_record(ResultsDirectory.locate(results, db).database_url) as engine:
        episodes = read_episodes(engine, numbers or (), model or ())
        written = write_steps(episodes, lambda one: episode_steps(engine, one.id), file)
    if as_json:
        print_files([file], as_json=True, steps=written)
    else:
        typer.echo(f"{written} step{'' if written == 1 else 's'} in {file}")


@app.command()
def bag(
    number: Annotated[int, typer.Argument(help="The episode's number.", min=1)],
    file: Annotated[Path, typer.Argument(help="The bag to write.")],
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """One episode as a ROS 1 bag: images, odometry, actions.

    Example: [bold]vsnbench export bag 17 episode.bag && rosbag info episode.bag[/bold]
    """
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import episode_steps
    from vsnbench.exchange.episodes import read_episodes
    from vsnbench.exchange.rosbag import COLOR, write_bag
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    with open_record(place.database_url) as engine:
        (episode,) = read_episodes(engine, [number])
        messages = write_bag(episode, episode_steps(engine, episode.id), place.path, file)
    if messages.get(COLOR) == 0:
        logger.warning("episode %d keeps no images: the bag has its odometry and actions", number)
    if as_json:
        print_files([file], as_json=True, messages=messages)
        return
    typer.echo(f"{file}: " + ", ".join(f"{count} on {topic}" for topic, count in messages.items() if count))
