"""A Spot with its arm's camera as a `Base`, by velocity commands: `python socket_adapter.py spot:Spot HOSTNAME`.

Needs bosdyn-client, the credentials in $BOSDYN_CLIENT_USERNAME and $BOSDYN_CLIENT_PASSWORD, an E-Stop endpoint (the
tablet's), and the robot standing with the hand camera level. Give the profile `tolerances: {position_m: 0.05, turn_deg:
3}`.
"""

import time

from by_velocity import PERIOD_S, Base

EXPIRES_S = 0.6
COLOUR, DEPTH = "hand_color_image", "hand_depth_in_hand_color_frame"


class Spot(Base):
    """Each velocity command ends by itself after EXPIRES_S, so that a Spot that is no longer commanded stops.

    Args:
        hostname: of the robot.
        sdk: what `_sdk` returns, for another connection.
    """

    card = {  # noqa: RUF012
        "name": "spot-velocity",
        "version": "1",
        "movements": ["move", "waypoint", "trajectory", "velocity"],
        "sensors": ["rgb", "depth"],
    }
    least_m_s, least_rad_s = 0.1, 0.15
    near_m, near_rad = 0.02, 0.02

    def __init__(self, hostname: str = "192.168.80.3", sdk: dict | None = None) -> None:
        self._sdk = sdk or _sdk(hostname)
        self._snapshot = self._sdk["state"]()

    @property
    def now_s(self) -> float:
        return time.time()

    @property
    def pose(self) -> tuple[float, float, float]:
        self._snapshot = self._sdk["state"]()
        return self._snapshot["pose"]

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        try:
            self._sdk["command"](forward_m_s, turn_rad_s, EXPIRES_S)
        except self._sdk["errors"]:  # lease lost, motors off, behaviour fault, no answer
            return "fault"
        self._wait()
        return ""

    def _wait(self) -> None:
        time.sleep(PERIOD_S)

    def stop(self) -> None:
        try:
            self._sdk["stop"]()
        except self._sdk["errors"]:
            return  # without its lease the robot is not ours to stop: the last command has expired

    def state(self, *, with_depth: bool = False) -> dict:
        x, y, heading = self.pose
        state = {"pose": [x, y, heading], "stamp_s": self._snapshot["stamp_s"], "rival": self._snapshot["owner"]}
        state["battery"] = {"share": self._snapshot["battery"]}
        if with_depth:
            state["depth"], state["depth_stamp_s"] = self._sdk["depth"]()
        return state

    def colours(self) -> dict:
        return self._sdk["colours"]()


def _sdk(hostname: str) -> dict:
    """Connect, take the lease, power on and stand; return functions by name."""
    import bosdyn.client
    import bosdyn.client.util
    from bosdyn.api import image_pb2
    from bosdyn.client.exceptions import Error, ResponseError
    from bosdyn.client.frame_helpers import get_odom_tform_body
    from bosdyn.client.image import ImageClient, build_image_request
    from bosdyn.client.lease import LeaseClient, LeaseKeepAlive
    from bosdyn.client.robot_command import RobotCommandBuilder, RobotCommandClient, blocking_stand
    from bosdyn.client.robot_state import RobotStateClient

    robot = bosdyn.client.create_standard_sdk("vsnbench").create_robot(hostname)
    bosdyn.client.util.authenticate(robot)
    robot.time_sync.wait_for_sync()
    leases = robot.ensure_client(LeaseClient.default_service_name)
    keeper = LeaseKeepAlive(leases, must_acquire=True, return_at_exit=True)
    robot.power_on(timeout_sec=20)
    commands, states, images = (
        robot.ensure_client(client.default_service_name)
        for client in (RobotCommandClient, RobotStateClient, ImageClient)
    )
    blocking_stand(commands)

    def state() -> dict:
        now = states.get_robot_state()
        body = get_odom_tform_body(now.kinematic_state.transforms_snapshot)
        stamp = now.kinematic_state.acquisition_timestamp
        battery = now.battery_states[0].charge_percentage.value / 100 if now.battery_states else None
        owner = "" if keeper.is_alive() else "the owner of the lease"
        stamp_s = stamp.seconds + stamp.nanos * 1e-9
        return {"pose": (body.x, body.y, body.rot.to_yaw()), "stamp_s": stamp_s, "battery": battery, "owner": owner}

    def command(forward_m_s: float, turn_rad_s: float, expires_s: float) -> None:
        built = RobotCommandBuilder.synchro_velocity_command(v_x=forward_m_s, v_y=0.0, v_rot=turn_rad_s)
        commands.robot_command(command=built, end_time_secs=time.time() + expires_s)

    def image(source: str, pixels: int, encoding: int) -> tuple:
        request = build_image_request(source, pixel_format=pixels, image_format=encoding)
        shot = images.get_image([request])[0].shot
        stamp = shot.acquisition_time
        return shot.image, stamp.seconds + stamp.nanos * 1e-9

    def colours() -> dict:
        found, _ = image(COLOUR, image_pb2.Image.PIXEL_FORMAT_RGB_U8, image_pb2.Image.FORMAT_JPEG)
        return {"encoding": "jpeg", "height": found.rows, "width": found.cols, "data": found.data}

    def depth() -> tuple:  # 16-bit millimetres: the source's depth_scale is 1000
        found, stamp_s = image(DEPTH, image_pb2.Image.PIXEL_FORMAT_DEPTH_U16, image_pb2.Image.FORMAT_RAW)
        return {"encoding": "mm16", "height": found.rows, "width": found.cols, "data": found.data}, stamp_s

    return {
        "state": state,
        "command": command,
        "stop": lambda: commands.robot_command(RobotCommandBuilder.stop_command()),
        "colours": colours,
        "depth": depth,
        "errors": (Error, ResponseError),
    }
