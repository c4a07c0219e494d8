"""What JSON says of a condition: model, robot, site and protocol."""

from vsnbench.report.measures import COUNT, FLAG, NUMBER, TEXT, Measure, Measures
from vsnbench.results.model import EPISODE, PROVENANCE

_SURVEYED = "the model receives the site file: an upper bound, not a competitor"
_ACTIONS, _TIME = "limit of actions per episode", "time limit of an episode on the robot's clock"
CONDITION = Measures.shared(
    "condition_identity",
    Measure("name", TEXT, "name in tables; unique among the conditions of a report"),
    Measure("model", TEXT, "name of the model"),
    Measure("weights_label", TEXT, PROVENANCE["weights_label"].meaning),
    Measure("weights_sha256", TEXT, PROVENANCE["weights_sha256"].meaning),
    Measure("surveyed", FLAG, _SURVEYED),
    Measure("robot", TEXT, "name of the robot profile"),
    Measure("kind", TEXT, PROVENANCE["robot_kind"].meaning),
    Measure("environment", TEXT, "`real` or `simulated`"),
    Measure("published", FLAG, "a result of the paper instead of the record"),
    Measure("site", TEXT, "name of the site"),
    Measure("site_sha256", TEXT, "SHA-256 of the site's content"),
    Measure("protocol_name", TEXT, "name of the protocol; empty if none is recorded"),
    Measure("execution", TEXT, EPISODE["execution"].meaning),
    Measure("max_actions", COUNT, _ACTIONS, null="if the protocol has none"),
    Measure("max_time_s", NUMBER, _TIME, null="for no limit"),
    Measure("max_path_m", NUMBER, "limit of the driven path per episode", null="for no limit"),
    Measure("success_distance_m", NUMBER, "distance to the goal below which STOP is a success"),
    Measure("noise", FLAG, "simulated sensors and odometry have noise", "noisy"),
)
"""Measures of a `Condition`."""
