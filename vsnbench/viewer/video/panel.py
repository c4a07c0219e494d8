"""The part of a frame that shows one episode: camera, floor plan, distance, action, and at the end the verdict."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vsnbench.errors import UsageError
from vsnbench.palette import FAILURE, SUCCESS, VOID, rgb
from vsnbench.protocol.judge import GoalDistance, distance_to_goal
from vsnbench.results.files.episode_entries import StepEntry
from vsnbench.text.distances import distance_text
from vsnbench.text.sanitize import counted
from vsnbench.values.encoding.images import decode_picture
from vsnbench.values.pose import Pose
from vsnbench.values.step import driven_path
from vsnbench.viewer.replay import EpisodeReplay
from vsnbench.viewer.video.canvas import FAINT, INK, Area, FrameCanvas, Image, Rgb
from vsnbench.viewer.video.plan import PATH_RGB, PlanPicture

SUCCESS_RGB, FAILURE_RGB, VOID_RGB = rgb(SUCCESS), rgb(FAILURE), rgb(VOID)
BAR_RGB: Rgb = (170, 190, 220)
_MISSING_RGB: Rgb = (60, 60, 64)
_LIMIT_RGB: Rgb = (190, 190, 186)
_BARS = 6
_LEAST_SCORE = 0.005
"""Lower scores would be 0.00."""
_CAMERA_SHARE = 0.72
"""Maximum share of a panel's longer side that the camera takes."""


@dataclass(frozen=True, slots=True)
class PanelStyle:
    """Sizes of a panel in pixels."""

    text: int
    """Height of normal text."""
    details: bool = True
    """Show the plan, the distance, the action and the model's scores; otherwise only the camera and the result."""


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
        title, self._line = round(style.text * 2.2), round(style.text * 1.7)
        self._title = Area(area.left + style.text, area.top, area.width - 2 * style.text, title)
        body = Area(area.left, area.top + title, area.width, area.height - title)
        if style.details:
            self._arrange(body)
        else:
            self._picture = body
        seen, lines = self._picture, 2 if style.details else 1
        strip = round(seen.height * 0.3) if roles else 0
        self._strip = Area(seen.left, seen.top + seen.height - strip, seen.width, strip)
        self._picture = seen = replace(seen, height=seen.height - strip)
        self._banner = Area(seen.left, seen.top + seen.height - lines * self._line, seen.width, lines * self._line)

    def _arrange(self, body: Area) -> None:
        """Place the camera, and plan and words beside it; below it where the panel is higher than wide."""
        header, margin, shape = self._replay.header, self._style.text // 2, self._camera.shape
        is_wide = body.width > body.height
        if is_wide:
            wide = min(round(body.height * shape), round(body.width * _CAMERA_SHARE))
            self._picture = Area(body.left, body.top, wide, min(body.height, round(wide / shape)))
            rest = Area(body.left + wide, body.top, body.width - wide, body.height).inset(margin)
        else:
            high = min(round(body.width / shape), round(body.height * _CAMERA_SHARE))
            self._picture = Area(body.left, body.top, body.width, high)
            rest = Area(body.left, body.top + high, body.width, body.height - high).inset(margin)
        room = (rest.width, rest.height // 2) if is_wide else (rest.width // 2, rest.height)
        self._plan = PlanPicture(header.site, header.goal, *room, header.robot_radius_m)
        wide, high = self._plan.size
        self._plan_area = Area(rest.left, rest.top, rest.width, high) if is_wide else replace(rest, width=wide)
        used = high + margin if is_wide else wide + 2 * margin
        self._words = (
            Area(rest.left + margin, rest.top + used, rest.width - 2 * margin, rest.height - used)
            if is_wide
            else Area(rest.left + used, rest.top, rest.width - used, rest.height)
        )
        self._distances = [self._distance(pose) for pose in self._path]
        below = body.height - self._picture.height
        self._curve = (
            Area(body.left, body.top + self._picture.height, self._picture.width, below).inset(margin)
            if is_wide and below > 4 * self._line
            else None
        )
        """Area of the distance curve; None if it is among the words."""

    def _distance(self, pose: Pose) -> GoalDistance | None:
        """Return the distance to the goal from a pose of the path; None if the site has no such goal."""
        header = self._replay.header
        try:
            return distance_to_goal(header.site, header.goal, replace(header.begin, pose=pose), header.parameters)
        except ValueError:
            return None

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
            poses = len(self._path) if is_end else shot.poses
            color = self._result()[1] if is_end else PATH_RGB
            canvas.paste(self._plan.draw(self._path[:poses], color), self._plan_area)
            self._write_step(canvas, number, poses)
        if is_end:
            self._write_result(canvas)

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

    def _write_step(self, canvas: FrameCanvas, number: int, poses: int) -> None:
        """Write the action, the distance and the scores of a step, in the order of the lines."""
        entry, limit = self._steps[number], self._replay.header.parameters.action_limit
        step, size = entry.step, self._style.text
        most = "" if limit is None else f" of at most {limit}"
        lines: list[tuple[str, Rgb, bool]] = [
            (_action(entry), INK, True),
            (f"{'answer' if limit is None else 'action'} {number + 1}{most}", FAINT, False),
        ]
        if step.blocked:
            lines.append(("blocked by the depth guard", VOID_RGB, False))
        if step.result is not None and step.result.collision is not None:
            lines.append((f"collision: {step.result.collision.touched or 'unknown object'}", FAILURE_RGB, False))
        if here := self._distances[poses - 1]:
            lines.append(self._distance_line(here))
        left = self._words
        for text, color, bold in lines:
            row, left = self._row(left)
            if row.height:
                canvas.write(text, row, size, color, bold=bold)
        bars = min(_BARS, max(1, left.height // self._line - 3))
        room = left.height - bars * self._line
        if self._curve is not None:
            self._draw_distances(canvas, self._curve, poses)
        elif room > 2 * self._line:
            curve = replace(left, height=min(room, 6 * self._line))
            self._draw_distances(canvas, curve.inset(self._line // 4), poses)
            left = replace(left, top=left.top + curve.height, height=left.height - curve.height)
        known = sorted(entry.decision.diagnostics.probabilities.items(), key=lambda item: -item[1])
        for name, score in known[:bars]:
            row, left = self._row(left)
            if not row.height or not _LEAST_SCORE <= score <= 1:
                break
            bar = Area(row.left, row.top + 2, round(row.width * score), row.height - 4)
            if bar.width > 0:
                canvas.fill(bar, BAR_RGB)
            canvas.write(f"{_spoken(name)}  {score:.2f}", row, round(size * 0.85))

    def _row(self, left: Area) -> tuple[Area, Area]:
        """Return the next line of an area and the rest; a line without height where none is left."""
        high = self._line if left.height >= self._line else 0
        return replace(left, height=high), replace(left, top=left.top + high, height=left.height - high)

    def _distance_line(self, here: GoalDistance) -> tuple[str, Rgb, bool]:
        limit_m = self._replay.header.parameters.success_distance_m
        text = f"{distance_text(here.distance_m, limit_m)} m to the goal"
        if here.is_under(limit_m):
            return f"{distance_text(here.distance_m, limit_m)} m: STOP succeeds", SUCCESS_RGB, True
        return text if here.in_sight else f"{text}, not in sight", INK, False

    def _draw_distances(self, canvas: FrameCanvas, area: Area, poses: int) -> None:
        """Draw the distance over the whole episode's path until now, and the distance within which STOP succeeds."""
        if not any(self._distances):
            return
        known = [math.nan if found is None else found.distance_m for found in self._distances]
        limit_m = self._replay.header.parameters.success_distance_m
        top_m = max([limit_m, *(value for value in known if math.isfinite(value))])

        def at(place: int, distance_m: float) -> tuple[float, float]:
            across = place / max(1, len(known) - 1)
            return area.left + across * area.width, area.top + (1 - distance_m / top_m) * area.height

        last = len(known) - 1
        canvas.line([at(0, limit_m), at(last, limit_m)], _LIMIT_RGB, 1)
        canvas.line([at(0, 0.0), at(last, 0.0)], FAINT, 1)
        points = [at(place, value) for place, value in enumerate(known[:poses]) if math.isfinite(value)]
        canvas.line(points, PATH_RGB, max(2, self._style.text // 6))

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

    @property
    def shape(self) -> float:
        """Width of the first image divided by its height."""
        high, wide = self.picture(0).shape[:2]
        return float(wide / high)

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
    words = step.movement.text if step.movement is not None else _spoken(step.action.value)
    raw = _spoken(step.raw_action)
    return words if raw in ("", words, _spoken(step.action.value)) else f"{words} ({raw})"


def _spoken(name: str) -> str:
    return name.replace("_", " ").lower()
