"""Fixtures of the ROS tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros.ros1.network import RosNetwork, live_network


@pytest.fixture
def network(tmp_path: Path) -> Iterator[RosNetwork]:
    """A separate ROS network."""
    with live_network(tmp_path) as ros:
        yield ros
