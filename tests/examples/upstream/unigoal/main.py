"""Stand-in for main.py and the agent (bagh2178/UniGoal, commit 4134fd1): the loop around an agent that goes by a rule.

It turns to the left twice, and goes forward. A photograph is reached after three steps, words never.
"""

import argparse
import gzip
import json
from types import SimpleNamespace

from src.envs import construct_envs

CONFIG = {
    "environment": "habitat",
    "camera_height": 0.88,
    "hfov": 79,
    "env_frame_width": 480,
    "env_frame_height": 640,
    "frame_width": 120,
    "frame_height": 160,
    "turn_angle": 15,
    "min_depth": 0.0,
    "max_depth": 30.0,
    "llm_model": "words",
    "vlm_model": "words",
    "visualize": 1,
}


def get_config():
    parser = argparse.ArgumentParser()
    parser.add_argument("--config-file")
    return SimpleNamespace(**CONFIG, **vars(parser.parse_args()), goal="")


class Graph:
    def __init__(self, args):
        self.args = args


MADE = set()
"""Sizes of the images of the agents that were made, each once."""


class UniGoal_Agent:  # noqa: N801 - upstream's name
    def __init__(self, args, envs):
        size = args.env_frame_width, args.env_frame_height
        assert size not in MADE
        MADE.add(size)
        self.args, self.envs = args, envs

    def reset(self):
        assert self.args.env_frame_width == 4 * self.args.frame_width
        self.number = 0
        self.envs.reset()

    def step(self):
        action = 2 if self.number < 2 else 1 if self.number < 5 or self.args.goal_type == "text" else 0
        self.number += 1
        self.envs.step({"action": action})


def main():
    args = get_config()
    assert args.environment == "habitat"
    assert not args.visualize
    if args.goal_type == "text":
        with gzip.open(args.text_goal_dataset, "rt") as file:
            json.load(file)
    graph = Graph(args)
    agent = UniGoal_Agent(args, construct_envs(args))
    agent.reset()
    while True:
        assert graph.scenegraph == {"nodes": [], "edges": []}
        agent.step()
