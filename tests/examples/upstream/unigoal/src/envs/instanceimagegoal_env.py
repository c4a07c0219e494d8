"""Stand-in for upstream's environment: what it asks of the one of a real robot, and of its goal."""

import gzip
import json

import numpy as np
from PIL import Image


class InstanceImageGoal_Env:  # noqa: N801 - upstream's name
    def __init__(self, args):
        from .real_world_env import RealWorld_Env

        assert args.environment == "real_world"
        self.args, self._env = args, RealWorld_Env(args)
        self.name2index = {"chair": 0}
        if args.goal_type == "text":
            with gzip.open(args.text_goal_dataset, "rt") as file:
                json.load(file)

    def reset(self):
        seen = self._env.reset()
        assert self.name2index[self._env.current_episode.object_category] == 15
        assert int(self._env.current_episode.goal_object_id) == 0
        if self.args.goal_type == "ins-image":
            assert np.array(Image.open(self.args.goal)).shape[2] == 3
        else:
            assert isinstance(self.args.goal, str)
        return self.checked(seen)

    def step(self, action):
        return self.checked(self._env.step(action))

    def checked(self, seen):
        """Refuse what upstream could not read."""
        height, width = self.args.env_frame_height, self.args.env_frame_width
        assert seen["rgb"].shape == (height, width, 3)
        assert seen["depth"].shape == (height, width, 1)
        assert 0 < seen["depth"].min() < 0.3  # of 30 m
        assert seen["depth"].max() <= 1
        pose = self._env.get_agent_pose()
        position, rotation = pose["position"], pose["rotation"]
        assert np.allclose([position[2], position[0]], [-seen["gps"][0], seen["gps"][1]])
        assert np.isclose(2 * np.arctan2(rotation.y, rotation.w), seen["compass"][0])
        return seen, pose
