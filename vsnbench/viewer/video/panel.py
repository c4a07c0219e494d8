"""The part of a frame that shows one episode: camera, floor plan, action, and at the end the verdict."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from vsnbench.errors import UsageError
from vsnbench.palette import FAILURE, SUCCESS, VOID, rgb
from vsnbench.results.files.episode_entries import StepEntry
from vsnbench.text.sanitize import counted
from vsnbench.values.encoding.images import decode_picture
from vsnbench.values.movement import movement_text
from vsnbench.values.pose import Pose
from vsnbench.values.step import driven_path
from vsnbench.viewer.replay import EpisodeReplay
from vsnbench.viewer.video.canvas import FAINT, INK, Area, FrameCanvas, Image, Rgb
from vsnbench.viewer.video.plan import PATH_RGB, PlanPicture

SUCCESS_RGB, FAILURE_RGB, VOID_RGB = rgb(SUCCESS), rgb(FAILURE), rgb(VOID)
BAR_RGB: Rgb = (170, 190, 220)
_MISSING_RGB: Rgb = (60, 60, 64)
_BARS = 6


@dataclass(frozen=True, slots=True)
class PanelStyle:
    """Sizes of a panel in pixels."""

    text: int
    """Height of normal text."""
    details: bool = True
    """Show the plan, the action and the model's scores; otherwise only the camera and the result."""


@dataclass(frozen=True, slots=True)
class _Shot:
    """What one frame of the video shows."""

    jpeg: bytes | None
    step: int
    """Index of the step that the robot takes."""
    poses: int
    """Number of poses of the driven path until then."""
    cameras: Mapping[str, bytes | None]
    """Latest images of the further cameras, by role."""


def _shots_of(start: Pose, entries: list[StepEntry]) -> tuple[list[_Shot], list[Pose]]:
    """Return the frames of an episode and its path: one per step, or the first and its film where it has one."""
    if not any(entry.film for entry in entries):
        path = driven_path(start, (entry.step for entry in entries))
        return [_Shot(entry.rgb_jpeg, k, k + 1, _further(entry)) for k, entry in enumerate(entries)], path
    shots, path = [_Shot(entries[0].rgb_jpeg, 0, 1, _further(entries[0]))], [start]
    for k, entry in enumerate(entries):
        for frame in entry.film:
            path.append(frame.moment.pose)
            shots.append(_Shot(frame.rgb_jpeg, k, len(path), _further(entry)))
        path.append(driven_path(path[-1], [entry.step])[-1] if entry.step.world is not None else path[-1])
    return shots, path


def _further(entry: StepEntry) -> dict[str, bytes | None]:
    return {role: rgb for role, (rgb, _) in entry.cameras.items()}


class EpisodePanel:
    """Draws an episode, one frame per step or per image of its film, and a last one with the verdict."""

    def __init__(self, replay: EpisodeReplay, area: Area, style: PanelStyle) -> None:
        """Prepare the panel.

        Raises:
            UsageError: the episode has no images.
        """
        self._replay = replay
        self._style = style
        self._steps = [entry for entry in replay.entries if isinstance(entry, StepEntry)]
        if not self._steps or replay.has_no_images:
            raise UsageError(
                f"episode {replay.header.episode_id} has no images",
                advice="episodes recorded with `--keep none`, and some imported ones, cannot become a video",
                code="no-images",
            )
        self._shots, self._path = _shots_of(replay.header.begin.pose, self._steps)
        roles = sorted({role for shot in self._shots for role in shot.cameras}) if style.details else []
        self._camera = _Camera([shot.jpeg for shot in self._shots])
        self._further = {role: _Camera([shot.cameras.get(role) for shot in self._shots]) for role in roles}
        title, line = round(style.text * 2.2), round(style.text * 1.7)
        self._title = Area(area.left + style.text, area.top, area.width - 2 * style.text, title)
        body = Area(area.left, area.top + title, area.width, area.height - title)
        self._line = line
        self._banner = Area(body.left, body.top + body.height - 2 * line, body.width, 2 * line)
        if not style.details:
            self._picture = Area(body.left, body.top, body.width, body.height - line)
            self._banner = Area(body.left, body.top + body.height - line, body.width, line)
            return
        if body.width > body.height:
            seen = Area(body.left, body.top, round(body.width * 0.65), body.height - 2 * line)
            side = Area(body.left + seen.width, body.top, body.width - seen.width, seen.height)
            plan = Area(side.left, side.top, side.width, side.height // 2)
            words = Area(side.left, side.top + plan.height, side.width, side.height - plan.height)
        else:
            seen = Area(body.left, body.top, body.width, round(body.width * 0.75))
            left = body.height - seen.height - 2 * line
            plan = Area(body.left, body.top + seen.height, body.width // 2, left)
            words = Area(body.left + plan.width, plan.top, body.width - plan.width, left)
        strip = round(seen.height * 0.3) if roles else 0
        self._picture = Area(seen.left, seen.top, seen.width, seen.height - strip)
        self._strip = Area(seen.left, seen.top + self._picture.height, seen.width, strip)
        self._plan_area = plan.inset(style.text // 2)
        self._words = words.inset(style.text // 2)
        header = replay.header
        self._plan = PlanPicture(
            header.site, header.goal, self._plan_area.width, self._plan_area.height, header.robot_radius_m
        )

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self._shots) + 1

    def draw(self, canvas: FrameCanvas, frame: int) -> None:
        """Draw a frame, from 0; later ones show the end."""
        is_end = frame >= len(self._shots)
        shot = self._shots[min(frame, len(self._shots) - 1)]
        number = len(self._steps) - 1 if is_end else shot.step
        header = self._replay.header
        title = f"{header.goal} from start {header.start_number} · {header.model}"
        canvas.write(title, self._title, self._style.text, bold=True)
        place = min(frame, len(self._shots) - 1)
        canvas.paste(self._camera.picture(place), self._picture)
        if self._style.details:
            self._draw_further(canvas, place)
            path = self._path[: len(self._path) if is_end else shot.poses]
            color = self._result()[1] if is_end else PATH_RGB
            canvas.paste(self._plan.draw(path, color), self._plan_area)
            self._write_step(canvas, self._steps[number])
        if is_end:
            self._write_result(canvas)
        elif self._style.details:
            limit = header.parameters.action_limit
            most = "" if limit is None else f" of at most {limit}"
            done = self._banner.inset(self._line // 2)
            canvas.write(f"{'answer' if limit is None else 'action'} {number + 1}{most}", done, self._style.text, FAINT)

    def _draw_further(self, canvas: FrameCanvas, place: int) -> None:
        """Draw the images of the further cameras below that of the main one, each over its role."""
        strip, count = self._strip, len(self._further)
        height = strip.height - self._line
        width = min(strip.width // max(count, 1), round(height * 4 / 3))
        for number, (role, camera) in enumerate(self._further.items()):
            left = strip.left + (strip.width - count * width) // 2 + number * width
            canvas.paste(camera.picture(place), Area(left, strip.top, width, height).inset(2))
            words = Area(left + 2, strip.top + height, width - 4, self._line)
            canvas.write(role, words, round(self._style.text * 0.85), FAINT)

    def _write_step(self, canvas: FrameCanvas, entry: StepEntry) -> None:
        step, words = entry.step, self._words
        lines = [(_action(entry), INK, True)]
        if step.blocked:
            lines.append(("blocked by the depth guard", VOID_RGB, False))
        if step.result is not None and step.result.collision is not None:
            lines.append((f"collision: {step.result.collision.touched or 'unknown object'}", FAILURE_RGB, False))
        for place, (text, color, bold) in enumerate(lines):
            area = Area(words.left, words.top + place * self._line, words.width, self._line)
            canvas.write(text, area, self._style.text, color, bold=bold)
        top = words.top + len(lines) * self._line
        scores = sorted(entry.decision.diagnostics.probabilities.items(), key=lambda item: -item[1])[:_BARS]
        for place, (name, score) in enumerate(scores):
            row = Area(words.left, top + place * self._line, words.width, self._line)
            if row.top + row.height > words.top + words.height or not 0 <= score <= 1:
                break
            bar = Area(row.left, row.top + 2, round(row.width * score), row.height - 4)
            if bar.width > 0:
                canvas.fill(bar, BAR_RGB)
            canvas.write(f"{_spoken(name)}  {score:.2f}", row, round(self._style.text * 0.85))

    def _result(self) -> tuple[str, Rgb]:
        end = self._replay.end
        if end is None:
            return "not ended", VOID_RGB
        verdict = end.verdict
        color = VOID_RGB if verdict.success is None else SUCCESS_RGB if verdict.success else FAILURE_RGB
        if self._style.details:
            return verdict.text, color
        word = "success" if verdict.success else _spoken(verdict.end_reason.value)
        return f"{word}, {counted(end.actions, 'action')}", color

    def _write_result(self, canvas: FrameCanvas) -> None:
        text, color = self._result()
        canvas.fill(self._banner, color)
        margin = self._style.text
        where = Area(self._banner.left + margin, self._banner.top, self._banner.width - 2 * margin, self._banner.height)
        canvas.write(text, where, self._style.text, (255, 255, 255), bold=True)


class _Camera:
    """Decodes the colour images of an episode; a missing or damaged one repeats the last."""

    def __init__(self, files: list[bytes | None]) -> None:
        self._files = files
        self._number = -1
        self._shown: Image = np.full((48, 64, 3), _MISSING_RGB, np.uint8)

    def picture(self, number: int) -> Image:
        """Return the image of a frame, (H, W, 3) RGB."""
        if number != self._number:
            self._number = number
            jpeg = self._files[number]
            bgr = decode_picture(jpeg, cv2.IMREAD_COLOR) if jpeg else None
            if bgr is not None:
                self._shown = np.ascontiguousarray(bgr[..., ::-1])
        return self._shown


def _action(entry: StepEntry) -> str:
    step = entry.step
    words = movement_text(step.movement) if step.movement is not None else _spoken(step.action.value)
    raw = _spoken(step.raw_action)
    return words if raw in ("", words, _spoken(step.action.value)) else f"{words} ({raw})"


def _spoken(name: str) -> str:
    return name.replace("_", " ").lower()
