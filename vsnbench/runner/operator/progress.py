"""Progress of a campaign at the terminal: a bar with the success rate, and a line per episode."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

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

from vsnbench.protocol.limits import budget_left
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.episode.step import Step
from vsnbench.runner.operator.contract import NO_TRIALS, Display, EndedEpisode, TrialCounts
from vsnbench.text.terminal import Console

MAX_LABEL = 24
"""Length of a label that fits next to the bar. A longer one, and every one in a narrow terminal, is a line above it."""


_STYLE = {True: "green", False: "red", None: "yellow"}


class ProgressDisplay(Display):
    """A progress bar on stderr while the context is entered; plain lines where stderr is not a terminal.

    `other_trials` are those of the sweep's other campaigns, and `first_line` is shown above the bar. Without
    `shows_episodes` there is only the bar.
    """

    def __init__(
        self,
        label: str,
        trials: TrialCounts,
        parameters: ProtocolParameters,
        *,
        shows_actions: bool = True,
        other_trials: TrialCounts = NO_TRIALS,
        first_line: str = "",
        shows_episodes: bool = True,
    ) -> None:
        self.console = Console(file=sys.stderr, highlight=False)
        narrow = self.console.width < 100
        bar_label = "" if narrow or len(label) > MAX_LABEL else label
        self._title = label if other_trials.total or not bar_label else ""
        self._first_line, self._shows_episodes = first_line if shows_episodes else "", shows_episodes
        self._done, self._successes = trials.done, trials.successes
        self._parameters = parameters
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
            escape(bar_label),
            total=other_trials.total + trials.total,
            completed=other_trials.done + trials.done,
            rate=self._rate(),
            now="",
        )

    def __enter__(self) -> Self:
        if self._title and self._shows_episodes:
            self.console.print(f"[bold]{escape(self._title)}[/bold]")
        if self._first_line:
            self.say(self._first_line)
        if self.console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def _rate(self) -> str:
        return f"SR {self._successes}/{self._done} = {self._successes / self._done:.0%}" if self._done else "SR -"

    def trial_begins(self, goal: str, start: int) -> None:
        """Show the trial that is about to run."""
        self._bar.update(self._task, now=f"{goal} from {start}")

    def step(self, goal: str, start: int, step: Step) -> None:
        """Show the last action, the number of actions, and what is left of a time or path limit."""
        action = step.decision.action.value.replace("_", " ").lower()
        left = budget_left(step.spent, self._parameters)
        limit = self._parameters.action_limit
        now = f"{goal} from {start}: {step.index}" + ("" if limit is None else f"/{limit}")
        if left.time_left_s is not None:
            now += f" {left.time_left_s:.0f} s left"
        if left.path_left_m is not None:
            now += f" {left.path_left_m:.1f} m left"
        if self._shows_actions:
            now += " blocked" if step.blocked else f" {action}"
        self._bar.update(self._task, now=now)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Print the episode's line. An episode that awaits judgement advances the bar but not the rate."""
        outcome, plan = ended.outcome, ended.plan
        success = outcome.verdict.success
        if success is not None:
            if not outcome.proposed:
                self._count(success)
            self._bar.advance(self._task)
        self._bar.update(self._task, now="")
        if not self._shows_episodes:
            return
        awaits = "[cyan]awaits judgement[/], proposed: " if outcome.proposed and success is not None else ""
        why = f": {escape(outcome.error)}" if outcome.error else ""
        self.console.print(
            f"[dim]#{ended.number}[/dim] {plan.goal} from {plan.start.number}: {awaits}"
            f"[{_STYLE[success]}]{escape(outcome.verdict.text)}[/]{why}",
            soft_wrap=not self.console.is_terminal,
        )
        if (stop := outcome.stop) is not None:
            style = "yellow" if stop.verdicts_differ else "dim"
            self.console.print(f"[{style}]{escape(stop.text)}[/]", soft_wrap=not self.console.is_terminal)

    def say(self, text: str) -> None:
        """Print a line above the bar."""
        self.console.print(f"[dim]{escape(text)}[/dim]", soft_wrap=not self.console.is_terminal)

    def show_throughput(self, text: str) -> None:
        """Show how fast the workers run, in place of the last action."""
        self._bar.update(self._task, now=text)

    def judged(self, success: bool | None) -> None:
        """Add an operator's judgement to the rate."""
        if success is not None:
            self._count(success)

    def _count(self, success: bool) -> None:
        self._done += 1
        self._successes += success
        self._bar.update(self._task, rate=self._rate())

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Hide the bar while the operator types."""
        self._bar.stop()
        try:
            yield
        finally:
            if self.console.is_terminal:
                self._bar.start()
