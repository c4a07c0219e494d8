"""What a person at the terminal sees of a running campaign: a bar with the success rate so far, a line an episode."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from vsnbench.runner.episode import EpisodeOutcome, Step

_STYLE = {True: "green", False: "red", None: "yellow"}
_WORD = {True: "success", False: "failed", None: "void"}


class CampaignProgress:
    """A progress bar on stderr; falls back to plain lines where stderr is no terminal."""

    def __init__(self, label: str, trials: int, done: int, successes: int, max_actions: int) -> None:
        self.console = Console(file=sys.stderr, highlight=False)
        self._done, self._successes = done, successes
        self._max_actions = max_actions
        self._bar = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TextColumn("[dim]{task.fields[now]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self.console,
            transient=True,
            refresh_per_second=4,
        )
        self._task: TaskID = self._bar.add_task(escape(label), total=trials, completed=done, rate=self._rate(), now="")

    def __enter__(self) -> Self:
        if self.console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def _rate(self) -> str:
        return f"SR {self._successes}/{self._done} = {self._successes / self._done:.0%}" if self._done else "SR -"

    def episode_begins(self, goal: str, start: int) -> None:
        """Show which trial is being run."""
        self._bar.update(self._task, now=f"{goal} from {start}")

    def step(self, goal: str, start: int, step: Step) -> None:
        """Show how far the episode has come."""
        self._bar.update(self._task, now=f"{goal} from {start}: action {step.index}/{self._max_actions}")

    def episode_ends(self, number: int, goal: str, start: int, outcome: EpisodeOutcome) -> None:
        """Write the episode's line and move the bar on when the trial is done."""
        success = outcome.verdict.success
        if success is not None:
            self._done += 1
            self._successes += success
            self._bar.advance(self._task)
        self._bar.update(self._task, rate=self._rate(), now="")
        reason = escape(outcome.error or outcome.verdict.text.split(": ", 1)[-1])
        actions = f"{outcome.actions} action{'' if outcome.actions == 1 else 's'}"
        self.console.print(
            f"[dim]#{number}[/dim] {goal} from {start}: [{_STYLE[success]}]{_WORD[success]}[/] "
            f"({outcome.verdict.end_reason}, {actions}) [dim]{reason}[/dim]",
            soft_wrap=True,
        )

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Take the bar away while a person types."""
        self._bar.stop()
        try:
            yield
        finally:
            if self.console.is_terminal:
                self._bar.start()

    def note(self, text: str) -> None:
        """Write a line above the bar."""
        self.console.print(escape(text), soft_wrap=True)
