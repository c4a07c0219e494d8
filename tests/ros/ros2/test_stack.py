"""Stacks that drive themselves over ROS 2: announced, watched, stopped and judged by `vsnbench run`; a killed run."""

import json
import re
import sqlite3
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, Graph2, live_graph, moves, stands_since
from tests.ros.ros2.test_run import begin
from vsnbench.robots.profiles import profile_path

pytestmark = pytest.mark.ros2

ROOT = "/robot1"
PATHS = {"sofa": [[0.9, 0.0]], "chair": [[0.6, 0.0]]}
"""From position 8, the first ends 0.9 m from the sofa."""
StartStack = Callable[..., tuple[Process, str]]
SHORT = {"sofa": [[0.4, 0.0]]}
"""Ends farther than 1 m from the sofa."""
AT_REST_S = 5.0
"""Without a stop, the base drives until it hits a wall; docs/robot-faults.md has the times of a stop. A process killed
while it shares memory may delay the others by 2 s."""
RUNNING = "select count(*) from episode where state = 'running'"


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 in a namespace, whose camera has small images, simulated in the embedded apartment."""
    directory = tmp_path_factory.mktemp("ros2")
    profile = (
        profile_path("turtlebot4").read_text().replace("width: 640", "width: 160").replace("height: 360", "height: 90")
    )
    (directory / "small.yaml").write_text(profile)
    with live_graph(directory, shares_memory=True) as one:
        robot = one.vsnbench("robots", "simulate", robot_of(one))
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        yield one


def robot_of(graph: Graph2) -> str:
    return f"{graph.directory / 'small.yaml'}@{ROOT[1:]}"


@pytest.fixture
def start_stack(graph: Graph2) -> Iterator[StartStack]:
    """Start stacks as servers, each with its address, and end them after the test."""
    started: list[Process] = []

    def start(*words: str, paths: dict[str, list[list[float]]] = PATHS) -> tuple[Process, str]:
        server = graph.start(HERE / "nodes" / "stack.py", ROOT, json.dumps(paths), *words)
        started.append(server)
        wait_until(lambda: re.search(r"listens \d+\n", server.output), "the stack listens", 60)
        return server, f"http://127.0.0.1:{server.output.split('listens ')[1].split()[0]}"

    yield start
    for server in started:
        server.end()


def run(graph: Graph2, directory: Path, ways: str, *words: str, robot: str = "") -> tuple[Process, list[tuple]]:
    """Run a trial of a stack, and return the command and the ends of its episodes."""
    file = directory / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "1"\n{ways}\n')
    done = graph.vsnbench(
        *("run", "--robot", robot or robot_of(graph), "--model", f"stack:{file}", "--goal", "sofa", "--starts", "8"),
        *("--results", directory / "results", "--fail-fast", *words),
    )
    done.wait(250)
    return done, rows(directory, "select success, end_reason, reason from verdict order by id desc limit 1")


def rows(directory: Path, query: str) -> list[tuple]:
    if not (database := directory / "results" / "vsnbench.db").exists():
        return []
    with sqlite3.connect(database) as connection:
        return connection.execute(query).fetchall()


def ways_of(address: str) -> str:
    goal, state, abort = (f"{{http: '{address}/{name}'}}" for name in ("goal", "state", "abort"))
    return f"announce: {goal}\narrived: {state}\nabort: {abort}"


def test_a_stack_that_declares_its_arrival_is_judged_at_rest(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    server, address = start_stack()
    done, verdicts = run(graph, tmp_path, ways_of(address))
    assert done.popen.returncode == 0, done.output
    assert [verdict[:2] for verdict in verdicts] == [(1, "stop")]
    steps = rows(
        tmp_path, "select action, raw_action from step where episode_id = (select max(id) from episode) order by number"
    )
    assert set(steps[:-1]) == {("NOOP", "drives")}
    assert steps[-1] == ("STOP", "declared")
    ((protocol,),) = rows(tmp_path, "select protocol from campaign")
    assert (json.loads(protocol)["execution"]["driver"], json.loads(protocol)["depth_guard"]["enabled"]) == (
        "stack",
        False,
    )
    films = [
        json.loads(details)["sensing"].get("film", []) for (details,) in rows(tmp_path, "select details from step")
    ]
    assert max(frame[5] for film in films for frame in film) == pytest.approx(0.25)  # m/s, as the stack commanded
    assert "goal sofa" in server.output
    assert "abort" in server.output


def drives(directory: Path, watch: Process) -> bool:
    """Return whether the robot moves in an episode; the first run moves it before, to measure its watchdog."""
    try:
        return moves(watch) and rows(directory, RUNNING) == [(1,)]
    except sqlite3.OperationalError:  # the record is being made
        return False


def test_a_killed_run_leaves_a_robot_at_rest(graph: Graph2, tmp_path: Path) -> None:
    watch = graph.start(HERE / "nodes" / "odometry_watch.py", "/robot1/odom")
    killed = begin(graph, robot_of(graph), tmp_path / "results")
    wait_until(lambda: drives(tmp_path, watch) or killed.popen.poll() is not None, "the robot moves", 140)
    assert moves(watch), killed.output
    killed.popen.kill()
    kill_s = time.monotonic()
    wait_until(lambda: stands_since(watch) is not None, "the robot stands")
    stood_s = stands_since(watch) - kill_s
    sys.stdout.write(f"stands {stood_s:.2f} s after the run was killed\n")
    assert stood_s < AT_REST_S
    assert rows(tmp_path, "select count(*) from verdict") == [(0,)]


TOPICS = """
announce: {topic: {name: their/goal, type: std_msgs/msg/String, content: {data: "{goal}"}}}
arrived: {topic: {name: their/arrived, type: std_msgs/msg/Bool}}
abort: {topic: {name: their/abort, type: std_msgs/msg/Empty}}"""
ACTION = """
announce: {action: {name: navigate, type: test_msgs/action/Fibonacci, by_goal: {chair: {order: 1}, sofa: {order: 0}}}}
arrived: {action: true}"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "ways"),
    [("topic", TOPICS), ("event", TOPICS), ("action", ACTION)],
)
def test_a_stack_on_the_network_of_the_robot_is_told_and_heard(
    graph: Graph2, start_stack: StartStack, tmp_path: Path, kind: str, ways: str
) -> None:
    """Two trials: the state of the first still says "arrived" when the second goal is announced."""
    server, _ = start_stack("--ways", kind)
    done, _ = run(graph, tmp_path, ways, "--goal", "chair")
    assert done.popen.returncode == 0, done.output
    assert rows(tmp_path, "select end_reason from verdict order by id") == [("stop",)] * 2
    driven_m = [path_m for (path_m,) in rows(tmp_path, "select path_length_m from episode order by id")]
    assert driven_m == pytest.approx([0.9, 0.6], abs=0.1)
    assert re.findall("goal (.*)", server.output) == ["sofa", "chair"]


@pytest.mark.long
def test_an_action_that_fails_is_void_and_one_that_never_ends_is_canceled(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    (tmp_path / "short.yaml").write_text("name: short\nmax_time_s: 6\n")
    ended = {}
    for after, paths in (("fail", SHORT), ("wait", {"sofa": [[0.4, 0.0], [0.0, 0.0]] * 50})):
        directory = tmp_path / after
        directory.mkdir()
        server, _ = start_stack("--ways", "action", "--after", after, paths=paths)
        _, verdicts = run(graph, directory, ACTION, "--protocol", tmp_path / "short.yaml")
        ended[after] = verdicts[0][:2], "abort" in server.output
        server.end()
    assert ended == {"fail": ((None, "model_error"), False), "wait": ((0, "time_limit"), True)}


@pytest.mark.long
def test_the_guard_stops_a_stack_that_drives_at_an_obstacle(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    """The path goes through the sofa, at which the robot looks from position 8."""
    server, address = start_stack(paths={"sofa": [[4.0, 0.0]]})
    _, verdicts = run(graph, tmp_path, f"{ways_of(address)}\ndepth_guard: true")
    assert [verdict[:2] for verdict in verdicts] == [(None, "model_error")]
    ((error, path_m),) = rows(tmp_path, "select error, path_length_m from episode order by id desc limit 1")
    assert "the depth guard stopped the robot that the stack drove: obstacle" in error
    assert 0.3 < path_m < 3.0
    assert rows(tmp_path, "select count(*) from step where collision_touched is not null") == [(0,)]
    ((protocol,),) = rows(tmp_path, "select protocol from campaign")
    assert json.loads(protocol)["depth_guard"]["enabled"] is True
    assert "abort" in server.output


@pytest.mark.long
def test_a_robot_without_odometry_is_refused_before_the_first_trial(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    server, address = start_stack()
    profile = (graph.directory / "small.yaml").read_text()
    (tmp_path / "silent.yaml").write_text(profile.replace("odometry: odom\n", "odometry: silent_odom\n"))
    assert (tmp_path / "silent.yaml").read_text() != profile
    done, verdicts = run(graph, tmp_path, ways_of(address), robot=f"{tmp_path / 'silent.yaml'}@{ROOT[1:]}")
    assert done.popen.returncode != 0
    assert "/robot1/silent_odom" in done.output.splitlines()[-1], done.output
    assert verdicts == []
    assert "goal" not in server.output


@pytest.mark.long
@pytest.mark.parametrize(
    ("ways", "says"),
    [
        (TOPICS, "no node publishes /robot1/their/arrived (std_msgs/msg/Bool)"),
        (TOPICS.replace("Bool", "Boole"), "message type std_msgs/msg/Boole is not installed here"),
        (ACTION, "no node offers the action navigate"),
    ],
    ids=["silent-topic", "unknown-type", "no-action"],
)
def test_nothing_moves_where_nobody_is_there_to_drive(graph: Graph2, tmp_path: Path, ways: str, says: str) -> None:
    done, _ = run(graph, tmp_path, ways)
    assert done.popen.returncode != 0
    assert says in done.output
    assert all(path_m < 0.02 for (path_m,) in rows(tmp_path, "select path_length_m from episode"))


@pytest.mark.long
def test_a_command_that_ends_has_arrived_or_failed(graph: Graph2, tmp_path: Path) -> None:
    """The first path ends too far from the goal, and the second ends with another exit code."""
    ended = []
    for after in ("arrive", "fail"):
        words = [
            sys.executable,
            HERE / "nodes" / "stack.py",
            ROOT,
            json.dumps(SHORT),
            "--goal",
            "{goal}",
            "--after",
            after,
        ]
        directory = tmp_path / after
        directory.mkdir()
        _, verdicts = run(
            graph,
            directory,
            f"announce: {{command: {json.dumps(list(map(str, words)))}}}\narrived: {{exit_code: 0}}",
        )
        ended += [
            (verdict[:2], rows(directory, "select error from episode order by id desc limit 1")) for verdict in verdicts
        ]
    assert ended[0][0] == (0, "stop")
    assert ended[1][0] == (None, "model_error")
    assert "exit code 4" in ended[1][1][0][0]


@pytest.mark.long
def test_a_robot_at_rest_has_arrived_where_the_stack_says_nothing(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    _, address = start_stack("--after", "wait")
    ways = ways_of(address).replace(f"{{http: '{address}/state'}}", "{rest_s: 2}")
    _, verdicts = run(graph, tmp_path, ways)
    assert [verdict[:2] for verdict in verdicts] == [(1, "stop")]
    assert rows(tmp_path, "select raw_action from step order by episode_id desc, number desc limit 1") == [("at rest",)]


@pytest.mark.long
def test_a_stack_that_drives_on_is_held_and_named(graph: Graph2, start_stack: StartStack, tmp_path: Path) -> None:
    _, address = start_stack("--after", "drive-on")
    _, verdicts = run(graph, tmp_path, ways_of(address))
    assert [verdict[1] for verdict in verdicts] == ["stop"]
    ((words,),) = rows(tmp_path, "select text from event where kind = 'drives_on'")
    assert "their_stack" in words


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "reason", "says"),
    [
        (("--after", "die"), "model_lost", "no stack answers"),
        (("--after", "fail"), "model_error", "no path to the goal"),
        (("--answer", "500"), "model_error", "answered 500"),
        (("--answer", "hang"), "model_lost", "did not answer"),
        (("--answer", "huge"), "model_error", "more than"),
    ],
)
def test_a_stack_that_fails_is_void_with_its_reason(
    graph: Graph2, start_stack: StartStack, tmp_path: Path, words: tuple[str, ...], reason: str, says: str
) -> None:
    _, address = start_stack(*words)
    _, verdicts = run(graph, tmp_path, ways_of(address))
    ((error,),) = rows(tmp_path, "select error from episode order by id desc limit 1")
    assert [verdict[:2] for verdict in verdicts] == [(None, reason)]
    assert says in error


@pytest.mark.long
@pytest.mark.timeout(700)
def test_a_locked_blind_study_compares_a_policy_with_a_stack(
    graph: Graph2, start_stack: StartStack, tmp_path: Path
) -> None:
    _, address = start_stack()
    (tmp_path / "secret_planner.yaml").write_text(f'name: theirs\nversion: "1"\n{ways_of(address)}\n')
    study = tmp_path / "study.yaml"
    study.write_text(
        "title: two ways\nquestion: which one finds the sofa more often\n"
        "arms: {ours: {model: forward}, navigator: {model: 'stack:secret_planner.yaml'}}\n"
        f"goals: [sofa]\nstarting_positions: 1-6\nrobot: {robot_of(graph)}\nprotocol: {{max_actions: 6}}\n"
    )
    results = ("--results", tmp_path / "results")
    said = {}
    for words in (("lock", study), ("run", study), ("report", study), ("unblind", study, "--reason", "done")):
        one = graph.vsnbench("study", *words, *results)
        one.wait(500)
        assert one.popen.returncode == 0, one.output
        said[words[0]] = one.output
    assert not re.search("theirs|navigator|secret_planner", said["run"] + said["report"])
    drives = rows(
        tmp_path,
        "select model.name, json_extract(protocol, '$.execution.driver'), count(*) from episode "
        "join trial on trial.id = trial_id join campaign on campaign.id = trial.campaign_id "
        "join model on model.id = model_id group by 1, 2 order by 1",
    )
    assert drives == [("forward", None, 6), ("theirs", "stack", 6)]
    assert "is navigator" in said["unblind"]
