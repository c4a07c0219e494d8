"""The network gives what the original gave, in every runtime, over the boundary between two episodes."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.models.pirlnav.conftest import Recording
from vsnbench.models.pirlnav.acceleration import choose_engine, reference_engine
from vsnbench.models.pirlnav.checkpoint import read_checkpoint
from vsnbench.models.pirlnav.engine import HALF_TOLERANCE, Engine, StepInput, compare
from vsnbench.models.pirlnav.policy import ACTIONS, GOALS, PIRLNav
from vsnbench.models.pirlnav.preprocessing import preprocess
from vsnbench.models.pirlnav.settings import PIRLNavSettings, Runtime
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)


@pytest.fixture(params=["torch", "onnxruntime"])
def runtime(request: pytest.FixtureRequest) -> Runtime:
    return request.param


@pytest.fixture
def engine(small_checkpoint: Path, runtime: Runtime) -> Engine:
    chosen = choose_engine(read_checkpoint(small_checkpoint), PIRLNavSettings(runtime=runtime), "cpu")
    assert chosen.runtime is runtime
    return chosen.engine


def test_logits_values_and_actions_equal_the_originals(engine: Engine, recording: Recording) -> None:
    previous, actions = 0, []
    for i, frame in enumerate(recording.frames):
        answer = engine.step(
            StepInput(
                preprocess(frame, 256),
                (float(recording.gps_m[i, 0]), float(recording.gps_m[i, 1])),
                float(recording.compass_rad[i]),
                int(recording.goals[i]),
                previous,
                bool(recording.begins[i]),
            )
        )
        np.testing.assert_allclose(answer.logits, recording.logits[i], rtol=0, atol=1e-4)
        assert answer.value == pytest.approx(recording.values[i], abs=1e-4)
        previous = int(answer.logits.argmax())
        actions.append(previous)
    assert actions == recording.actions.tolist()


def test_the_policy_gives_the_originals_logits_and_actions(
    small_checkpoint: Path, runtime: Runtime, recording: Recording
) -> None:
    policy = PIRLNav(small_checkpoint, PIRLNavSettings(decision="greedy", runtime=runtime), "cpu")
    names = {number: name for name, number in GOALS.items()}
    for i, frame in enumerate(recording.frames):
        if recording.begins[i]:
            policy.reset(names[int(recording.goals[i])], seed=1)
        forward, right = map(float, recording.gps_m[i])
        pose = Pose(forward, -right, float(recording.compass_rad[i]))
        decision = policy.act(Observation(frame, None, pose, float(i), CAMERA))
        np.testing.assert_allclose(decision.diagnostics.details["logits"], recording.logits[i], rtol=0, atol=1e-4)
        assert decision.raw_action == list(ACTIONS)[recording.actions[i]]
        assert math.isclose(sum(decision.diagnostics.probabilities.values()), 1, abs_tol=1e-12)


def test_half_precision_in_the_encoder_stays_within_its_tolerance(small_checkpoint: Path) -> None:
    checkpoint = read_checkpoint(small_checkpoint)
    sizes = checkpoint.architecture
    reference, half = reference_engine(checkpoint), reference_engine(checkpoint, half=True)
    agreement = compare(reference, half, sizes, HALF_TOLERANCE)
    assert agreement.holds
    assert 0 < agreement.largest_difference < HALF_TOLERANCE / 2
    assert not compare(reference, half, sizes, 1e-6).holds
