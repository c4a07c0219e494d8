"""Files that the commands of `json_outputs` read: models, sites, profiles, protocols and studies."""

import json
from pathlib import Path

from tests.docs.pages import ROOT
from vsnbench.robots.profiles import embedded_profiles

LATE_CARD = """from vsnbench import ModelCard, Policy, Sensor


class Late(Policy):
    def __init__(self):
        self.card = ModelCard("late", sensors=frozenset({Sensor.RGB}))
"""
"""A model whose card is known only when it is created."""
ANSWERS = """from vsnbench import (
    Action, ActionKind, Chunk, Decision, ModelCard, Move, Pixel, Policy, Sensor, Sidestep, Trajectory, Velocity,
    Waypoint,
)

RGB = frozenset({Sensor.RGB})
ANSWERS = [
    Pixel(320.0, 475.0), Chunk((Action.TURN_LEFT, Waypoint(0.3, 0.0))), Waypoint(0.2, 0.1, 0.5),
    Trajectory(((0.1, 0.0), (0.2, 0.1))), Velocity(0.1, 0.2, 0.5, 0.05), Move(-0.2, 0.1), Sidestep(0.05),
] + 12 * [Action.MOVE_BACKWARD]


class Answers(Policy):
    card = ModelCard("answers", sensors=RGB, action_kinds=frozenset(ActionKind))

    def reset(self, goal, seed):
        self.answers = list(ANSWERS)

    def act(self, observation):
        return Decision(self.answers.pop(0))


class Fragile(Policy):
    card = ModelCard("fragile", sensors=RGB)

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return Decision(Action.STOP if observation.rgb.mean() > 60 else Action.TURN_LEFT)


class Broken(Fragile):
    card = ModelCard("broken", sensors=RGB)

    def act(self, observation):
        raise RuntimeError("no weights")
"""
"""Models: every kind of movement until a collision; failures in the dark; errors."""
DRY_LOG = "1700000000.5,chair,['Forward', 'Left', 'Stop'],3\n"
HABITAT = [{"object_category": "bed", "success": 1, "num_steps": 71}]
PROTOCOL = """name: short
max_actions: 100
max_time_s: 600
max_path_m: 50
placement: {distance_m: 0.05, heading_deg: 2}
"""
LATERAL = """  max_lateral_m_s: 0.3
  min_linear_m_s: 0.02
  min_angular_rad_s: 0.05
  min_lateral_m_s: 0.02
  max_acceleration_m_s2: 1.0
  max_acceleration_rad_s2: 2.0
  dead_time_s: 0.1
"""
CAMERAS = """
cameras:
  left:
    { width: 320, height: 240, horizontal_fov_deg: 60, mount_height_m: 0.5, mount_left_m: 0.1, yaw_deg: 90,
      roll_deg: 1, exposure_s: 0.01 }
"""
ROOM = "".join(f"v {x} {y} {z}\n" for y in (0, 2.5) for z in (0, -3) for x in (0, 4)) + "".join(
    f"f {corners}\n" for corners in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
)
"""A room of 4 x 3 m as a mesh, y up."""
NEAR = [(3.6, 3.2), (3.6, 3.0), (3.6, 2.8), (3.7, 2.5), (4.0, 2.4), (4.3, 2.4), (3.5, 3.2), (3.5, 2.9)]
"""Starting positions near the chair of the starter's site."""
GOALS = """
goals:
  - { id: low-table, kind: text, text: the low table, targets: [table-1] }
  - { id: both, kind: sequence, goals: [chair, low-table] }
"""
STUDY = """title: Which is better, random?
question: Is random better?
arms: {oracle: {model: oracle-waypoints}, random: {model: random}, pirlnav: {model: pirlnav}}
goals: [chair]
starting_positions: 1-6
seed: 1
stopping: decided
about: these-cells
primary: {kind: difference, metric: progress}
"""


def write_files(directory: Path) -> None:
    """Write the files into a directory."""
    starter = (ROOT / "vsnbench/cli/starter/lab.yaml").read_text(encoding="utf-8")
    starts = "".join(
        f"  - {{ number: {number}, position: [{x_m}, {y_m}], heading_deg: 0 }}\n"
        for number, (x_m, y_m) in enumerate(NEAR, start=4)
    )
    profile = embedded_profiles()["turtlebot2"].read_text(encoding="utf-8")
    plain = profile.partition("\ninterface:")[0] + (
        "\ntolerances: {position_m: 0.01, turn_deg: 0.5}\n"
        "dynamics: {dead_time_s: 0.05, odometry_rate_hz: 20, wheel_acceleration_m_s2: 2}\n"
    )
    wheels = "  track_m: 0.230\n  wheel_radius_m: 0.035\n"
    assert wheels in plain
    texts = {
        "log/datos.csv": DRY_LOG,
        "episodes.json": json.dumps(HABITAT),
        "late.py": LATE_CARD,
        "answers.py": ANSWERS,
        "protocol.yaml": PROTOCOL,
        "invalid-protocol.yaml": "name: short\nmax_action: 100\nmax_time_s: -1\n",
        "flawed.yaml": starter.replace("[2.5, 0.6]", "[2.5, 3.4]").replace("[4.3, 3.2]", "[2.9, 3.4]"),
        "invalid-site.yaml": starter.replace("title:", "titel:"),
        "goals.yaml": starter + starts + GOALS,
        "robot.yaml": plain.replace("linear_m_s: 0.3", "linear_m_s: 0.9").replace(
            "tilt_deg:", "roll_deg: 2\n  exposure_s: 0.02\n  tilt_deg:"
        )
        + CAMERAS,
        "room.obj": ROOM,
        "legs.yaml": profile.partition("\ninterface:")[0].replace(wheels, LATERAL),
        "invalid-robot.yaml": profile.replace("radius_m: 0.177", "radius_m: 17"),
        "progress.yaml": STUDY,
    }
    for name, text in texts.items():
        (directory / name).parent.mkdir(exist_ok=True)
        (directory / name).write_text(text, encoding="utf-8")
