"""UniGoal as a model: its own program searches in its real-world environment, whose three functions are written here.

Put this file and vsnbench_policy.py into UniGoal's directory, in its environment:

    python vsnbench_policy.py unigoal_adapter:UniGoal --port 8765
    vsnbench run --model ws://gpu-box:8765 --site examples/goals.yaml --goal photo-armchair

Upstream's program owns the loop: an episode is a run of its `main()` in a thread, which waits in `step` for the robot's
next observation. The networks are loaded once. The language model of its configuration must be running. Lines of
upstream are those of bagh2178/UniGoal at commit 4134fd1.
"""

import gzip
import importlib
import io
import math
import queue
import sys
import threading
import traceback
from types import SimpleNamespace

import numpy as np
from PIL import Image

ACTIONS = {0: "STOP", 1: "MOVE_FORWARD", 2: "TURN_LEFT", 3: "TURN_RIGHT"}
"""Actions by upstream's numbers (src/envs/instanceimagegoal_env.py:149-150)."""
SHRINK = 4
"""Upstream maps every fourth pixel (configs/config_habitat.yaml:14-17, src/agent/unigoal/agent.py:241)."""
UNKNOWN = {"unknown": 15}
"""Category before upstream has found the goal's own: the last channel of its segmentation, in which nothing is."""


class UniGoal:
    """Runs upstream's program, and exchanges observations and actions with its thread."""

    served = False
    """Whether this process has a robot: upstream's program drives one."""

    def __init__(self, config_file="configs/config_habitat.yaml", weights_label=""):
        """Import upstream's program, read its configuration, and replace its environment.

        Args:
            config_file: upstream's configuration; `cuda: false` in it for a CPU.
            weights_label: description of the checkpoints.
        """
        if UniGoal.served:
            raise ValueError("UniGoal's program drives one robot: serve one session")
        self.program = program = importlib.import_module("main")
        kept, sys.argv = sys.argv, ["main.py", "--config-file", str(config_file)]
        try:
            self.arguments = arguments = program.get_config()
        finally:
            sys.argv = kept
        arguments.visualize = 0  # its drawings need an episode of Habitat
        self.card = {
            "name": "unigoal",
            "sensors": ["rgb", "depth", "odometry"],
            "goal_kinds": ["category", "text", "image"],
            "forward_m": 0.25,  # Habitat's, which upstream leaves as it is
            "turn_deg": float(arguments.turn_angle),
            "camera": {
                "mount_height_m": arguments.camera_height,
                "tilt_deg": 0,
                "horizontal_fov_deg": arguments.hfov,
                "width": arguments.env_frame_width,
                "height": arguments.env_frame_height,
            },
            "weights_label": weights_label,
            "settings": {name: getattr(arguments, name) for name in ("llm_model", "vlm_model", "max_depth")},
            "deterministic": False,  # a language model in another process
        }
        self.made, self.networks = {"Graph": program.Graph, "UniGoal_Agent": program.UniGoal_Agent}, {}
        self.camera = self.thread = self.seen = self.said = None
        program.get_config, program.construct_envs = lambda: arguments, self._environment
        program.Graph, program.UniGoal_Agent = self._graph, self._agent
        real_world = importlib.import_module("src.envs.real_world_env")
        robot = _robot_class(real_world.RealWorld_Env)
        real_world.RealWorld_Env = lambda given: robot(given, self.seen, self.said)
        UniGoal.served = True

    def reset(self, goal, seed):
        """Refuse an episode without a task, which has no camera."""
        raise ValueError("unigoal needs the robot's camera: use a newer vsnbench on the robot's side")

    def begin(self, task):
        """Start upstream's program, and wait until it asks for an observation."""
        camera, goal, photograph = task.robot.camera, task.goal, io.BytesIO()
        if camera.width % SHRINK or camera.height % SHRINK:
            raise ValueError(f"UniGoal needs an image whose sides are multiples of {SHRINK} pixels")
        self._end()
        if vars(camera) != self.camera:
            self.networks, self.camera = {}, dict(vars(camera))
        is_image = goal.kind == "image"
        if is_image:
            Image.fromarray(np.ascontiguousarray(goal.image)).save(photograph, "PNG")
            photograph.seek(0)
        vars(self.arguments).update(
            goal_type="ins-image" if is_image else "text",
            goal=photograph if is_image else goal.text or str(goal),
            text_goal_dataset=_no_text_goals(),
            env_frame_width=camera.width,
            env_frame_height=camera.height,
            frame_width=camera.width // SHRINK,
            frame_height=camera.height // SHRINK,
            hfov=camera.horizontal_fov_deg,
            camera_height=camera.mount_height_m,
        )
        importlib.import_module("torch").manual_seed(task.seed)
        np.random.seed(task.seed % 2**32)  # noqa: NPY002 - upstream draws from the global generator
        self.seen, self.said = queue.Queue(), queue.Queue()
        self.thread = threading.Thread(target=self._run, args=(self.said,), daemon=True)
        self.thread.start()
        self._answer()

    def act(self, observation):
        """Return upstream's next action."""
        self.seen.put(observation)
        number = self._answer()
        return {"action": ACTIONS[number], "raw_action": str(number)}

    def _run(self, said):
        """Run upstream's program to the end of the episode."""
        try:
            self.program.main()
            said.put(RuntimeError("no action"))
        except Exception as error:
            traceback.print_exc()
            said.put(error)

    def _answer(self):
        """Return an action's number, or None of a program that is ready."""
        answer = self.said.get()
        if answer not in (None, *ACTIONS):
            raise RuntimeError(f"UniGoal's program ended with {answer!r}")
        return answer

    def _end(self):
        """End the program of an episode that ended without its STOP."""
        if self.thread is not None and self.thread.is_alive():
            self.seen.put(None)
            self.thread.join(50.0)
            if self.thread.is_alive():
                raise RuntimeError("UniGoal still decides on the last episode: try again, or restart its server")

    def _environment(self, arguments):
        """Return upstream's environment for a real robot.

        The arguments of the rest keep `habitat`: only then does upstream's agent take depth as the environment has it.
        """
        given = dict(vars(arguments), environment="real_world", text_goal_dataset=_no_text_goals())
        environment = importlib.import_module("src.envs.instanceimagegoal_env").InstanceImageGoal_Env(
            SimpleNamespace(**given)
        )
        environment.name2index = dict(environment.name2index, **UNKNOWN)
        return environment

    def _graph(self, arguments):
        """Return upstream's graph without the objects of the last episode, which its own `reset` leaves in one place.

        Before the first object, upstream reads them before they are there.
        """
        if "Graph" not in self.networks:
            self.networks["Graph"] = self.made["Graph"](arguments)
        self.networks["Graph"].scenegraph = {"nodes": [], "edges": []}
        return self.networks["Graph"]

    def _agent(self, arguments, environment):
        """Return upstream's agent in an environment."""
        if "UniGoal_Agent" not in self.networks:
            self.networks["UniGoal_Agent"] = self.made["UniGoal_Agent"](arguments, environment)
        self.networks["UniGoal_Agent"].envs = environment
        return self.networks["UniGoal_Agent"]


def _no_text_goals():
    """Return an empty list of text goals, which upstream reads from a file though it is given the goal."""
    return io.BytesIO(gzip.compress(b"{}"))


def _robot_class(base):
    """Return upstream's environment class for a real robot with its functions written."""
    quaternion = importlib.import_module("quaternion").quaternion

    class Robot(base):
        """The robot at the other end of two queues. After the last action, the thread of the program ends."""

        def __init__(self, arguments, seen, said):
            super().__init__(arguments)
            self.seen, self.said, self.observation = seen, said, None
            # Upstream takes the category of an episode of Habitat first, and then finds the goal's own.
            self.current_episode = SimpleNamespace(object_category=next(iter(UNKNOWN)), goal_object_id=0)

        def reset(self):
            self.said.put(None)
            return super().reset()

        def step(self, action):
            self.said.put(action["action"])
            if ACTIONS[action["action"]] == "STOP":
                sys.exit()
            return self.get_observation()

        def get_observation(self):
            self.observation = self.seen.get()
            if self.observation is None:
                sys.exit()
            x_m, y_m, heading_rad = self.pose()
            # Of Habitat's range, of which 0 would become the row's farthest and 30 cm, and 1 is not mapped.
            low_m, high_m = self.args.min_depth, self.args.max_depth
            depth = np.clip((self.observation.depth_m - low_m) / (high_m - low_m), 0.0, 1.0)
            return {
                "rgb": np.ascontiguousarray(self.observation.rgb),
                "depth": np.nan_to_num(depth, nan=1.0).astype(np.float32)[:, :, None],
                "gps": np.array([x_m, -y_m], np.float32),  # Habitat's is (forward, right)
                "compass": np.array([heading_rad], np.float32),
            }

        def get_agent_pose(self):
            x_m, y_m, heading_rad = self.pose()
            position = np.array([-y_m, 0.0, -x_m], np.float32)  # Habitat's is (right, up, backward)
            rotation = quaternion(math.cos(heading_rad / 2), 0.0, math.sin(heading_rad / 2), 0.0)
            return {"position": position, "rotation": rotation}

        def pose(self):
            """Return the camera's pose: x forward and y left of the start in metres, heading in radians."""
            pose, ahead_m = self.observation.pose, self.observation.camera.mount_forward_m
            x_m = pose.x_m + ahead_m * math.cos(pose.heading_rad)
            return x_m, pose.y_m + ahead_m * math.sin(pose.heading_rad), pose.heading_rad

    return Robot
