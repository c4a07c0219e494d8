"""A model that looks once around in one answer, and notes what it saw between its answers."""

import math

from vsnbench import Action, ActionKind, Chunk, Decision, Diagnostics, ModelCard, Observation, Policy, Sensor

TURNS = 12


class Panorama(Policy):
    """Turns around by a chunk of turns, then stops."""

    card = ModelCard(
        "panorama",
        sensors=frozenset({Sensor.RGB, Sensor.ODOMETRY}),
        action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.CHUNK}),
        history=TURNS,
    )

    def reset(self, goal: str, seed: int) -> None:
        """Forget the calls."""
        self.calls = 0

    def act(self, observation: Observation) -> Decision:
        """Turn around, then stop with the times, headings and colours of all views."""
        self.calls += 1
        if self.calls == 1:
            return Decision(Chunk((Action.TURN_LEFT,) * TURNS))
        seen = [
            [view.stamp_s, math.degrees(view.pose.heading_rad), float(view.rgb.mean())]
            for view in (*observation.history, observation)
        ]
        return Decision(Action.STOP, diagnostics=Diagnostics(details={"seen": seen}))
