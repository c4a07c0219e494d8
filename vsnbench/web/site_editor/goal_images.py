"""Images of goals next to a site file: stored under a new name, and read for the page."""

import re
from pathlib import Path

from vsnbench.errors import SiteError
from vsnbench.sites.goals import GoalImage, goal_image, load_goal_image

_GOAL_ID = re.compile(r"[a-z0-9][a-z0-9_-]{0,79}")
_MOST_NAMES = 1000


def store_goal_image(site_file: Path, goal_id: str, data: bytes) -> GoalImage:
    """Write the image of a goal next to the site file, as `lab-GOAL.png` or `.jpg`, without overwriting a file.

    A recorded campaign knows an image by its content, so a new image never replaces an old one.

    Raises:
        SiteError: `invalid-image`, the data are not an image for a goal; or the file cannot be written.
    """
    suffix = "png" if data.startswith(b"\x89PNG") else "jpg"
    goal = goal_id if _GOAL_ID.fullmatch(goal_id) else "goal"
    try:
        checked = goal_image("the image", data)
        for number in range(1, _MOST_NAMES):
            name = f"{site_file.stem}-{goal}{f'-{number}' if number > 1 else ''}.{suffix}"
            try:
                with (site_file.parent / name).open("xb") as file:
                    file.write(data)
            except FileExistsError:
                continue
            return checked.model_copy(update={"file": name})
    except ValueError as error:
        raise SiteError(str(error), code="invalid-image") from error
    except OSError as error:
        raise SiteError(f"cannot write the image of goal {goal}: {error.strerror or error}") from error
    raise SiteError(f"{site_file.parent} has {_MOST_NAMES - 1} images of goal {goal}", advice="delete unused ones")


def read_goal_image(site_file: Path, name: str) -> tuple[bytes, str]:
    """Return an image next to the site file, and its media type.

    Raises:
        SiteError: `invalid-image`, there is no such image.
    """
    try:
        data = load_goal_image(site_file.parent, name).data or b""
    except ValueError as error:
        raise SiteError(str(error), code="invalid-image") from error
    return data, "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
