"""Check of a robot's camera against the camera that a model was trained with."""

from vsnbench.models.contract import ModelCard
from vsnbench.models.fit.camera import camera_differences
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.values.camera import Camera


def trained_camera_result(model: str, card: ModelCard | None, camera: Camera) -> CheckResult:
    """Report how a camera differs from the camera on a model's card.

    Args:
        model: name of the model.
        card: card of its class; None if only the created model has one.
        camera: camera of the robot's profile.
    """
    what = f"camera for {model}"
    if card is None:
        advice = f"`vsnbench models check {model} --robot ROBOT` compares them"
        return CheckResult(what, Health.WARNING, "not compared: the card exists once the model is created", advice)
    if card.camera is None:
        return CheckResult(what, Health.OK, "not compared: the model's card states no camera")
    if not (differences := camera_differences(card, camera)):
        return CheckResult(what, Health.OK, f"as the model was trained: {card.camera.text}")
    return CheckResult(
        what,
        Health.WARNING,
        f"{', '.join(difference.text for difference in differences)}; the model was trained with {card.camera.text}",
        "mount the camera like that, or state the difference with your results; for other weights than the published "
        f"ones: vsnbench models check {model}",
    )
