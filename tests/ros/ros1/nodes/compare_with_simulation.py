"""Compares the images of a robot over ROS at a start with the simulation in this process."""

import json
import sys

import numpy as np

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.registry import open_robot
from vsnbench.sites.site import load_site

robot, number = sys.argv[1], int(sys.argv[2])
site, parameters = load_site("apartment"), ProtocolParameters()
seen = []
for name in (f"simulated:{robot}", robot):
    with open_robot(name, site, parameters) as body:
        body.begin(site.start(number), seed=1)
        seen.append((body.observe(), body.locate()))
(here, place), (over_ros, fix) = seen
sys.stdout.write(
    json.dumps(
        {
            "place_m": place.pose.distance_to(fix.pose),
            "rgb": float(np.mean(here.rgb != over_ros.rgb)),
            "depth_m": float(np.nanmax(np.abs(here.depth_m - over_ros.depth_m))),
            "invalid": float(np.mean(np.isnan(here.depth_m) != np.isnan(over_ros.depth_m))),
            "instances": float(np.mean(here.instances.ids != over_ros.instances.ids)),
            "categories": dict(here.instances.categories) == dict(over_ros.instances.categories),
            "pose": [over_ros.pose.x_m, over_ros.pose.y_m, over_ros.pose.heading_rad],
        }
    )
)
