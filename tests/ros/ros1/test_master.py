"""The address of the ROS master is checked before it is used."""

import pytest

from tests.ros.ros1.network import HERE, wait_until
from vsnbench.ros.ros1.master import Master, MasterError, call_xmlrpc


def test_an_unset_address_is_named(monkeypatch) -> None:
    monkeypatch.delenv("ROS_MASTER_URI", raising=False)
    with pytest.raises(MasterError, match="ROS_MASTER_URI is not set: export ROS_MASTER_URI=http://"):
        Master.from_environment()


@pytest.mark.parametrize("uri", ["localhost:11311", "http://localhost", "ftp://robot:11311", "http://robot:x"])
def test_an_invalid_address_is_an_error(monkeypatch, uri) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(MasterError, match="ROS_MASTER_URI is"):
        Master.from_environment()


def test_an_address_without_a_server_is_an_error(monkeypatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    with pytest.raises(MasterError, match=r"no ROS master answers at http://127\.0\.0\.1:1"):
        Master.from_environment().pid()


@pytest.mark.ros
def test_a_live_master_reports_its_registrations(network) -> None:
    assert network.master.pid() == network.roscore.popen.pid
    assert network.master.live_node("/rosout") is None
    assert network.master.state().services == {}


@pytest.mark.ros
def test_a_killed_node_whose_port_another_process_has_is_not_alive(network) -> None:
    network.start(HERE / "nodes" / "listener.py", "/anything", "__name:=listener")
    wait_until(lambda: network.master.live_node("/listener"), "the listener is up")
    uri = network.master.live_node("/listener")
    call_xmlrpc(network.master.uri, "registerPublisher", "/killed", "/cmd_vel", "geometry_msgs/Twist", uri)
    assert network.master.ask("lookupNode", "/killed") == uri
    assert network.master.live_node("/killed") is None
