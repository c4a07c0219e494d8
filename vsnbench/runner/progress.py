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

from vsnbench.runner.attendant import EndedEpisode
from vsnbench.runner.episode import Step

LONGEST_BESIDE_BAR = 24
"""Letters of a label that have room beside the bar; a longer one, or a narrow terminal's, stands above it."""
_STYLE = {True: "green", False: "red", None: "yellow"}


class CampaignProgress:
    """A progress bar on stderr; falls back to plain lines where stderr is no terminal."""

    def __init__(
        self,
        label: str,
        trials: int,
        done: int,
        successes: int,
        max_actions: int,
        *,
        shows_actions: bool = True,
        beside: tuple[int, int] = (0, 0),
        keeps: str = "",
    ) -> None:
        self.console = Console(file=sys.stderr, highlight=False)
        narrow = self.console.width < 100
        beside_bar = "" if narrow or len(label) > LONGEST_BESIDE_BAR else label
        self._title = label if beside[1] or not beside_bar else ""
        self._keeps = keeps
        self._done, self._successes = done, successes
        self._max_actions = max_actions
        self._shows_actions = shows_actions
        self._bar = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=8 if narrow else 24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TextColumn("[dim]{task.fields[now]}"),
            *(() if narrow else (TimeElapsedColumn(),)),
            TimeRemainingColumn(),
            console=self.console,
            transient=True,
            refresh_per_second=4,
        )
        self._task: TaskID = self._bar.add_task(
            escape(beside_bar), total=beside[1] + trials, completed=beside[0] + done, rate=self._rate(), now=""
        )

    def __enter__(self) -> Self:
        if self._title:
            self.console.print(f"[bold]{escape(self._title)}[/bold]")
        if self._keeps:
            self.say(self._keeps)
        if self.console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def _rate(self) -> str:
        return f"SR {self._successes}/{self._done} = {self._successes / self._done:.0%}" if self._done else "SR -"

    def trial_begins(self, goal: str, start: int) -> None:
        """Show which trial is being run."""
        self._bar.update(self._task, now=f"{goal} from {start}")

    def step(self, goal: str, start: int, step: Step) -> None:
        """Show how far the episode has come."""
        action = step.decision.action.value.replace("_", " ").lower()
        now = f"{goal} from {start}: {step.index}/{self._max_actions}"
        if self._shows_actions:
            now += " blocked" if step.blocked else f" {action}"
        self._bar.update(self._task, now=now)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Write the episode's line; one that awaits judgement moves the bar and not the rate."""
        outcome, plan = ended.outcome, ended.plan
        success = outcome.verdict.success
        if success is not None:
            if not outcome.proposed:
                self._count(success)
            self._bar.advance(self._task)
        self._bar.update(self._task, now="")
        awaits = "[cyan]awaits judgement[/], proposed: " if outcome.proposed and success is not None else ""
        why = f": {escape(outcome.error)}" if outcome.error else ""
        self.console.print(
            f"[dim]#{ended.number}[/dim] {plan.goal} from {plan.start.number}: {awaits}"
            f"[{_STYLE[success]}]{escape(outcome.verdict.text)}[/]{why}",
            soft_wrap=not self.console.is_terminal,
        )

    def say(self, words: str) -> None:
        """Write a line above the bar."""
        self.console.print(f"[dim]{escape(words)}[/dim]", soft_wrap=not self.console.is_terminal)

    def pace(self, words: str) -> None:
        """Show how fast many workers get on, where one alone would show its action."""
        self._bar.update(self._task, now=words)

    def judged(self, success: bool | None) -> None:
        """Take a person's judgement into the rate."""
        if success is not None:
            self._count(success)

    def _count(self, success: bool) -> None:
        self._done += 1
        self._successes += success
        self._bar.update(self._task, rate=self._rate())

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Take the bar away while a person types."""
        self._bar.stop()
        try:
            yield
        finally:
            if self.console.is_terminal:
                self._bar.start()
