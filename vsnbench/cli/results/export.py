"""`vsnbench export`: episodes in the formats of other tools."""

import logging
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import Database, Goals, Models, Results, open_results, results_directory
from vsnbench.cli.support.output import Json, print_files, print_result
from vsnbench.errors import UsageError
from vsnbench.text.sanitize import counted

logger = logging.getLogger(__name__)
app = typer.Typer(no_args_is_help=True)

_FORMAT_SUFFIXES = (".tum", ".csv", ".json", ".bag", ".mcap", ".mp4", ".parquet", ".zip")


def _number(text: str) -> int:
    """Return an episode's number; a path has its own option.

    Raises:
        BadParameter: the text is not a number.
    """
    try:
        number = int(text)
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is not an episode's number; a path is --output {text}") from error
    if number < 1:
        raise typer.BadParameter(f"{text} is not an episode's number; they begin at 1")
    return number


def _file(output: Path, suffix: str) -> Path:
    """Return a file to write.

    Raises:
        UsageError: it has another suffix, or is a directory.
    """
    if output.is_dir():
        raise UsageError(f"--output {output} is a directory", advice=f"--output {output / f'episodes{suffix}'}")
    if output.suffix.lower() != suffix:
        raise UsageError(f"--output {output} must be a {suffix} file", advice=f"--output {output.with_suffix(suffix)}")
    return output


def _directory(output: Path) -> Path:
    """Return a directory to write into.

    Raises:
        UsageError: it is a file, or is named like one.
    """
    if output.suffix.lower() in _FORMAT_SUFFIXES or output.is_file():
        raise UsageError(
            f"--output {output} must be a directory, which gets the files", advice=f"--output {output.with_suffix('')}/"
        )
    return output


def _output(kind: str) -> Any:
    return typer.Option("--output", "-o", metavar=kind, help="Where to write.", show_default=False)


Numbers = Annotated[
    list[int] | None,
    typer.Argument(parser=_number, metavar="NUMBER", show_default="all that have ended", help="Numbers of episodes."),
]
Number = Annotated[int, typer.Argument(parser=_number, metavar="NUMBER", help="Number of the episode.")]
Directory = Annotated[Path, _output("DIR")]
CsvFile = Annotated[Path, _output("FILE.csv")]


@app.command()
def tum(
    output: Directory,
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write trajectories in the TUM format: timestamp tx ty tz qx qy qz qw.

    Example: [bold]vsnbench export tum --output trajectories/ && evo_traj tum trajectories/*.tum[/bold]
    """
    from vsnbench.interop.episodes import read_episodes, write_tum
    from vsnbench.results.reading.queries import episode_steps

    directory, written = _directory(output), []
    with open_results(results, db) as (_, engine):
        for episode in read_episodes(engine, numbers or (), split_list(model)):
            path = directory / f"{episode.id:06d}.tum"
            write_tum(episode, episode_steps(engine, episode.id), path)
            written.append(path)
    print_files(written, as_json=as_json)


@app.command("csv")
def csv_(
    output: CsvFile,
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write every step of every episode to one CSV file.

    Example: [bold]vsnbench export csv 17 18 --output steps.csv[/bold]
    """
    from vsnbench.interop.episodes import read_episodes
    from vsnbench.interop.step_csv import write_steps
    from vsnbench.results.reading.queries import episode_steps

    file = _file(output, ".csv")
    with open_results(results, db) as (_, engine):
        episodes = read_episodes(engine, numbers or (), split_list(model))
        written = write_steps(episodes, lambda episode: episode_steps(engine, episode.id), file)
    fields = {"files": [str(file)], "steps": written}
    print_result(fields, f"{counted(written, 'step')} in {file}", as_json=as_json)


@app.command()
def bag(
    number: Number,
    output: Annotated[Path, _output("FILE.bag")],
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write an episode as a ROS 1 bag: images, odometry, actions.

    Example: [bold]vsnbench export bag 17 --output episode.bag && rosbag info episode.bag[/bold]
    """
    from vsnbench.interop.episodes import read_episodes
    from vsnbench.interop.recorded_messages import COLOR
    from vsnbench.interop.rosbag import write_bag
    from vsnbench.results.reading.queries import episode_record, episode_steps

    file = _file(output, ".bag")
    with open_results(results, db) as (place, engine):
        read_episodes(engine, [number])
        messages = write_bag(episode_record(engine, number), episode_steps(engine, number), place.path, file)
    if messages.get(COLOR) == 0:
        logger.warning("episode %d keeps no images: the bag has only odometry and actions", number)
    text = f"{file}: " + ", ".join(f"{count} on {topic}" for topic, count in messages.items() if count)
    print_result({"files": [str(file)], "messages": messages}, text, as_json=as_json)


@app.command()
def mcap(
    output: Directory,
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write MCAP files with ROS 2 messages for Foxglove and `ros2 bag`: images, odometry, frames, actions.

    Example: [bold]vsnbench export mcap 17 18 --output foxglove/ && ros2 bag info foxglove/000017.mcap[/bold]
    """
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.interop.episodes import read_episodes
    from vsnbench.interop.mcap_file import write_mcap
    from vsnbench.interop.recorded_messages import COLOR
    from vsnbench.results.reading.queries import episode_record, episode_steps

    directory, written = _directory(output), []
    with open_results(results, db) as (place, engine), ProgressBars() as progress:
        episodes = read_episodes(engine, numbers or (), split_list(model))
        for done, episode in enumerate(episodes):
            progress.show("episodes", done, len(episodes))
            path = directory / f"{episode.id:06d}.mcap"
            record, steps = episode_record(engine, episode.id), episode_steps(engine, episode.id)
            messages = write_mcap(record, steps, place.path, path)
            if not messages[COLOR]:
                logger.warning("episode %d keeps no images: %s has only odometry and actions", episode.id, path)
            written.append(path)
    print_files(written, as_json=as_json)


@app.command()
def lerobot(
    output: Directory,
    numbers: Numbers = None,
    model: Models = None,
    goal: Goals = None,
    depth: Annotated[
        bool, typer.Option("--depth", help="Depth images too, without loss. Most LeRobot policies do not take them.")
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write a LeRobotDataset v3.0 for imitation learning: a frame per action, with its image, state and action.

    Episodes without verdict, images or odometry are left out.

    Example: [bold]vsnbench export lerobot --model oracle --goal chair --output dataset/[/bold]
    """
    from vsnbench.cli.results.lerobot_export import export_lerobot

    directory = _directory(output)
    place, chosen = results_directory(results, db), (numbers or (), split_list(model), split_list(goal))
    done = export_lerobot(place, directory, *chosen, with_depth=depth)
    text = f"{counted(done.episodes, 'episode')} with {counted(done.frames, 'frame')} in {directory}"
    print_result({"files": [str(directory)], **asdict(done)}, text, as_json=as_json)


@app.command("episodes")
def episodes_(
    output: CsvFile,
    numbers: Numbers = None,
    model: Models = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write one row per episode that has ended to a CSV file: condition, outcome, distances, times.

    The columns are those of `open_results("results").episodes()` in Python.

    Example: [bold]vsnbench export episodes --output episodes.csv[/bold]
    """
    from vsnbench.files.atomic import atomic_file
    from vsnbench.interop.episodes import read_episodes
    from vsnbench.report.frames import Results as Record
    from vsnbench.results.schema.migrate import open_record

    file = _file(output, ".csv")
    place, models = results_directory(results, db), split_list(model)
    frame = Record(place.database_url).episodes()
    if numbers or models:
        with open_record(place.database_url) as engine:
            chosen = [episode.id for episode in read_episodes(engine, numbers or (), models)]
        frame = frame[frame["episode"].isin(chosen)]
    with atomic_file(file) as part:
        frame.to_csv(part, index=False)
    fields = {"files": [str(file)], "episodes": len(frame)}
    print_result(fields, f"{counted(len(frame), 'episode')} in {file}", as_json=as_json)


@app.command()
def video(  # noqa: PLR0913 - Typer needs a parameter per option
    numbers: Annotated[
        list[int] | None,
        typer.Argument(
            parser=_number, metavar="NUMBER", show_default="all that match the options", help="Numbers of episodes."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="MP4 file; without --pair and --montage a directory for one each."),
    ] = None,
    pair: Annotated[bool, typer.Option("--pair", help="Two episodes side by side in one video.")] = False,
    montage: Annotated[bool, typer.Option("--montage", help="All episodes in a grid in one video.")] = False,
    failures: Annotated[bool, typer.Option("--failures", help="Only episodes that failed.")] = False,
    model: Models = None,
    goal: Goals = None,
    size: Annotated[str, typer.Option("--size", help="Size: talk (1280x720) or web (854x480).")] = "talk",
    speed: Annotated[float, typer.Option("--speed", help="Actions or images per second.", min=0.5, max=30.0)] = 4.0,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Write MP4 videos: camera, plan with the path, action, the model's scores, and the verdict.

    [bold]Examples[/bold]

        vsnbench export video 17
        vsnbench export video 12 47 --pair -o both.mp4
        vsnbench export video --model pirlnav --goal toilet --failures
        vsnbench export video --model vlv --goal chair --montage
    """
    from vsnbench.cli.results.video_export import VideoRequest, export_videos

    other_formats = {*_FORMAT_SUFFIXES, ".avi", ".gif", ".mkv", ".mov", ".webm"} - {".mp4"}
    if output is not None and output.suffix.lower() in other_formats and not output.is_dir():
        raise UsageError(f"--output {output} must be an .mp4 file or a directory", advice=f"--output {output.stem}.mp4")
    request = VideoRequest(
        tuple(numbers or ()), split_list(model), split_list(goal), failures, pair, montage, output, size, speed
    )
    print_files(export_videos(results_directory(results, db), request), as_json=as_json)
