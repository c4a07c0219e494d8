"""Topics of hazard sensors that a profile names, and their faults on the network."""

import pytest

from vsnbench.robots.profiles import embedded_profiles, load_profile
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.ros.common.hazard_topics import HazardTopic

BUMPER = HazardTopic("bumper", "/bumper", "std_msgs/Bool")
VECTOR = HazardTopic("hazards", "/hazards", "a_package/Vector", missing_package="a_package")


@pytest.mark.parametrize(
    ("part", "types", "code"),
    [
        (BUMPER, {"std_msgs/Bool"}, ""),
        (BUMPER, {"std_msgs/Bool", "std_msgs/String"}, ""),
        (BUMPER, (), "unpublished-hazard-topic"),
        (BUMPER, {"std_msgs/String"}, "wrong-topic-type"),
        (VECTOR, (), "unpublished-hazard-topic"),
        (VECTOR, {"std_msgs/String"}, "wrong-topic-type"),
        (VECTOR, {"a_package/Vector"}, "no-hazard-type"),
    ],
)
def test_a_topic_on_which_no_report_can_arrive_has_a_fault(part: HazardTopic, types, code: str) -> None:
    fault = part.fault(types)
    assert ("" if fault is None else fault.code) == code
    assert fault is None or (part.topic in fault.statement and fault.advice)


@pytest.mark.parametrize("name", list(embedded_profiles()))
def test_every_hazard_topic_that_a_profile_names_is_checked(name: str) -> None:
    names = interface_of(load_profile(name))
    fields = [field for field in ("bumper", "cliff", "wheel_drop", "hazards") if getattr(names, field, "")]
    assert sorted(part.field for part in names.hazard_topics) == sorted(fields)
    assert {part.topic for part in names.hazard_topics} == {getattr(names, field) for field in fields}


def test_the_type_of_a_topic_is_that_of_the_profile() -> None:
    names = interface_of(load_profile("turtlebot2"))
    changed = names.model_copy(update={"cliff_type": "std_msgs/Bool"})
    assert [part.kind for part in changed.hazard_topics] == [
        "kobuki_msgs/BumperEvent",
        "std_msgs/Bool",
        "kobuki_msgs/WheelDropEvent",
    ]
