"""The model `human`: a person who sees what the robot's camera sees, and chooses each action on a page."""

import os
from typing import Final

from vsnbench.config import VARIABLE_OF
from vsnbench.errors import UsageError
from vsnbench.models.contract import Policy
from vsnbench.models.human.controls import NO_LIMITS, Controls
from vsnbench.models.task import Task
from vsnbench.text.sanitize import sanitize
from vsnbench.values.decision import Decision
from vsnbench.values.encoding.images import encode_jpeg
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.model.card import ModelCard
from vsnbench.values.model.person import DRIVER, HUMAN
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Observation, Sensor

MAX_NAME_LENGTH: Final = 60


class Human(Policy):
    """Shows the camera image to a driver, and waits for the chosen action."""

    card = ModelCard(
        HUMAN,
        goal_kinds=frozenset(GoalKind) - {GoalKind.POINT, GoalKind.ROUTE},
        sensors=frozenset({Sensor.RGB}),
        action_kinds=frozenset({ActionKind.DISCRETE}),
        deterministic=False,
    )

    def __init__(self, driver: str = "") -> None:
        """Name the driver.

        Args:
            driver: name of the person, which is recorded and part of the condition; by default $VSNBENCH_OPERATOR.

        Raises:
            UsageError: the name is missing (`no-driver`) or too long (`invalid-driver`).
        """
        name = " ".join(sanitize(driver or os.environ.get(VARIABLE_OF["operator"], "")).split())
        if not name:
            raise UsageError(
                "model human: the name of the driver is missing, which is recorded with the trials",
                advice="name the driver with --model human:NAME, or set VSNBENCH_OPERATOR",
                code="no-driver",
            )
        if len(name) > MAX_NAME_LENGTH:
            raise UsageError(
                f"model human: the name of the driver has {len(name)} characters",
                advice=f"give at most {MAX_NAME_LENGTH}",
                code="invalid-driver",
            )
        self.controls = Controls(name)
        self.card = ModelCard(
            HUMAN,
            goal_kinds=Human.card.goal_kinds,
            sensors=Human.card.sensors,
            weights_label=f"driver {name}",
            settings={DRIVER: name},
            deterministic=False,
        )

    def limit_actions(self, act_timeout_s: float) -> None:
        """Limit the time for an action, in seconds from when its picture is shown."""
        self.controls.act_timeout_s = act_timeout_s

    def reset(self, goal: str, seed: int) -> None:
        """Offer the trial, and return when the driver begins it.

        Raises:
            ModelError: no page serves the controls.
        """
        del seed
        self.controls.offer_trial(*_shown(goal))

    def begin(self, task: Task) -> None:
        """Offer the trial with the rule of success, and return when the driver begins it.

        Raises:
            ModelError: no page serves the controls.
        """
        self.controls.offer_trial(*_shown(task.goal), task.protocol.success_distance_m)

    def next_goal(self, goal: str) -> None:
        """Show the driver the next goal of a sequence."""
        self.controls.show_goal(*_shown(goal))

    def act(self, observation: Observation) -> Decision:
        """Return the action that the driver chooses for the camera image.

        Raises:
            ModelLostError: the driver chose none within the time limit.
        """
        return Decision(self.controls.ask(encode_jpeg(observation.rgb), observation.budget or NO_LIMITS))

    def end_episode(self) -> None:
        """Show the driver that the trial is over."""
        self.controls.end_trial()

    def close(self) -> None:
        """Show the driver that the session is over."""
        self.controls.close()


def _shown(goal: str) -> tuple[str, bytes | None]:
    """Return the words of a goal, and its photograph as JPEG if it has one."""
    image = goal.image if isinstance(goal, Goal) else None
    return goal.text if isinstance(goal, Goal) else goal, None if image is None else encode_jpeg(image)
