"""The operator at the terminal and in browsers: places the robot, lets it drive, and judges.

The first answer wins, wherever it is given. A typing error never becomes a verdict: Enter alone repeats the question,
and a collision or a distance far from the estimate must be confirmed. The answer `later` leaves the episode awaiting
judgement (`vsnbench judge`); so does a terminal that closes, or Ctrl-C, at a question.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeVar

from rich.markup import escape

from vsnbench.errors import ExitCode, UsageError
from vsnbench.protocol.judge import EndReason
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.judging.case import Case
from vsnbench.runner.judging.decision import ODOMETRY, Answer, AnswerKind, UnconfirmedAnswerError, decide
from vsnbench.runner.operator.answers import (
    MisreadError,
    TypedAnswer,
    parse_confirmation,
    parse_distance,
    parse_go,
    parse_touched,
)
from vsnbench.runner.operator.contract import (
    AbsentOperator,
    EndedEpisode,
    Judgement,
    SessionEndedError,
    TrialSkippedError,
    Upcoming,
)
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.operator.progress import ProgressDisplay
from vsnbench.runner.operator.prompts import (
    UNKNOWN_OPERATOR,
    AnsweredMeanwhileError,
    Choice,
    OperatorPrompts,
    Question,
    QuestionKind,
    RepliedElsewhereError,
)
from vsnbench.runner.operator.terminal_placing import TerminalPlacing
from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.runner.stopping.requests import StopAuthor, Stopped, StopRequest, StopRequests, leave_dead_terminal
from vsnbench.sites.site import StartingPosition
from vsnbench.text.distances import distance_text
from vsnbench.values.robot_profile import RobotProfile

Parsed = TypeVar("Parsed")

TERMINAL = "the terminal"


def require_terminal(profile: RobotProfile) -> None:
    """Check that there is a terminal to ask questions.

    Raises:
        UsageError: there is none.
    """
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            f"an operator must put {profile.name} at each starting position, and there is no terminal to ask one",
            advice="run in a terminal, without --quiet, or with --unattended (the episodes then await judgement: "
            "`vsnbench judge --pending`)",
            code="no-operator",
        )


def discard_typed() -> None:
    """Discard keys pressed while the robot drove; they do not answer the next question."""
    import termios

    with contextlib.suppress(OSError, ValueError, termios.error):
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


class TerminalOperator(AbsentOperator):
    """Asks the operator at the terminal, and accepts the answers of browsers."""

    is_present = True

    def __init__(
        self,
        display: ProgressDisplay,
        emergency: EmergencyStop,
        stop: StopRequests,
        prompts: OperatorPrompts,
        *,
        name: str = "",
        starts_trials: bool = False,
        has_page: bool = False,
    ) -> None:
        """Attend a session.

        Args:
            display: shows the progress.
            emergency: listens for the emergency stop key while the robot drives.
            stop: requests to stop.
            prompts: the questions.
            name: name of the person at the terminal.
            starts_trials: each trial waits for the operator's go, though the robot reaches its start by itself.
            has_page: browsers show the prompts too: void trials may run again, and the operator ends the session.
        """
        super().__init__(display)
        self._console = display.console
        self._paused = display.paused
        self._emergency = emergency
        self._stop = stop
        self._prompts = prompts
        self._own_name = name
        self._starts_trials = starts_trials
        self._started_by = ""
        self.repeats_void_trials = self._has_page = has_page

    @property
    def name(self) -> str:
        """Name of the operator who started the last trial, or an empty string."""
        return self._started_by

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show the trial. Where the robot reaches its start by itself, wait for the operator's go."""
        self._prompts.state.trial_begins(upcoming)
        super().trial_begins(upcoming)
        if self._starts_trials:
            with self._question(QuestionKind.BEGIN) as question:
                plan = upcoming.plan
                self._console.print(f"Next: [bold]{plan.goal} from starting position {plan.start.number}[/bold]")
                reply = self._first_reply(question, lambda: self._ask_until("Enter to go (skip / end): ", parse_go))
            self._start(reply)
        self._prompts.notify()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show the action."""
        self._prompts.state.step_taken(step)
        super().step_taken(plan, step)
        self._prompts.notify()

    def asks_where(self, *, can_measure: bool) -> bool:
        """Return whether an operator asked, at the terminal or in a browser."""
        if can_measure != self._prompts.state.measures_on_the_way:
            self._prompts.state.measures_on_the_way = can_measure
            self._prompts.notify()
        asked = self._prompts.take_where()
        if asked and not can_measure:
            self.show_where("not measured: it takes a depth camera, and a robot that rests between its actions")
        return asked and can_measure

    def show_where(self, text: str) -> None:
        """Show where the robot is."""
        self._prompts.state.whereabouts = text
        self._display.say(text)
        self._prompts.notify()

    def show_message(self, text: str) -> None:
        """Show a line, on the page as well."""
        self.show_where(text)

    def says_arrived(self) -> bool:
        """Return whether an operator declared the arrival, at the terminal or in a browser."""
        if not self._prompts.state.can_declare:
            self._prompts.state.can_declare = True
            self._prompts.notify()
        return self._prompts.take_arrival()

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how the episode ended."""
        self._prompts.driving = False
        self._prompts.take_arrival()
        self._prompts.take_where()  # a question that came too late is not one about the next episode
        self._prompts.state.episode_ended(ended)
        super().episode_ended(ended)
        self._prompts.record_changed()

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Show the starting position, have the placement checked, and wait for the go."""
        x, y = start.position
        where = f"x {x:.2f} m, y {y:.2f} m, facing {start.heading_deg:g}°"
        check = TerminalPlacing(placing, self._console, self._ask, self._prompts)
        with self._question(QuestionKind.PLACE, problem) as question:
            if problem:
                self._console.print(f"[yellow]not yet[/yellow]: {escape(problem)}")
            note = f" ({start.note})" if start.note else ""
            self._console.print(
                f"Put the robot at [bold]starting position {start.number}[/bold]: {where}{escape(note)}"
            )
            reply = self._first_reply(question, check.ask_choice, check.carry_out)
        self._start(reply)
        measures = ", w measures where it is" if placing.can_measure else ""
        self._console.print(f"[dim]driving; the space bar stops the robot and ends this episode{measures}[/dim]")

    def trials_to_repeat(self) -> Sequence[int]:
        """Return and forget the trials whose episodes an operator declared void."""
        to_repeat = self._prompts.state.to_repeat
        return [to_repeat.popleft() for _ in range(len(to_repeat))]

    def nothing_left(self) -> Sequence[int]:
        """Ask whether the session ends: a correction in a browser can make a trial run again."""
        if not self._has_page:
            return ()
        self._prompts.state.upcoming = None
        with self._question(QuestionKind.FINISH) as question:
            self._console.print("No trial is left. The page still takes corrections.")
            reply = self._first_reply(question, self._ask_end)
        return self.trials_to_repeat() if reply.answer is Choice.AGAIN else ()

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Ask what the robot touched and how far it is from the goal; None for later."""
        judgement: Judgement | None = None
        try:
            with self._question(QuestionKind.JUDGE) as question:
                case = Case.of_ended(ended)
                reply = self._first_reply(question, lambda: self._ask_judgement(case) or Choice.LATER)
                if isinstance(reply.answer, Judgement):
                    judgement = replace(reply.answer, author=reply.author)
        finally:
            if judgement is None:
                self._console.print(
                    f"\n[yellow]#{ended.number} awaits judgement[/yellow]: vsnbench judge {ended.number}"
                )
        if judgement is not None:
            if judgement.verdict.success is None:
                self._prompts.state.declare_void()
            self._display.judged(judgement.verdict.success)
            who = "you" if reply.source == TERMINAL else f"{escape(reply.author)} at {reply.source}"
            self._console.print(f"[dim]#{ended.number} judged by {who}:[/dim] {escape(judgement.verdict.text)}")
        return judgement

    @contextmanager
    def _question(self, kind: QuestionKind, problem: str = "") -> Iterator[Question]:
        with self._prompts.ask(kind, problem) as question, self._emergency.off(), self._paused():
            yield question

    def _first_reply(
        self,
        question: Question,
        ask: Callable[[], Choice | Judgement],
        carry_out: Callable[[str], None] = lambda _action: None,
    ) -> Question:
        """Return the first reply, from here or a browser; meanwhile carry out the requested actions."""
        while question.answer is None:
            try:
                return self._prompts.reply(question.number, ask(), self._own_name, TERMINAL)
            except RepliedElsewhereError:
                self._console.print()
            except AnsweredMeanwhileError as late:
                self._console.print(f"\n[yellow]{escape(str(late))}[/yellow]")
            while question.actions and question.answer is None:
                carry_out(question.actions.pop(0))
        answer = question.answer.value if isinstance(question.answer, Choice) else "a judgement"
        self._console.print(
            f"[cyan]{escape(question.author or UNKNOWN_OPERATOR)} answered at {question.source}[/cyan]: {answer}"
        )
        return question

    def _start(self, answered: Question) -> None:
        if answered.answer is Choice.SKIP:
            raise TrialSkippedError
        if answered.answer is Choice.END:
            raise SessionEndedError(f"{answered.author or UNKNOWN_OPERATOR} ended the session at {answered.source}")
        self._started_by = answered.author

    def _ask_end(self) -> Choice:
        self._ask_until("Enter ends the session: ", parse_go)
        return Choice.END

    def _ask_judgement(self, case: Case) -> Judgement | None:
        """Ask the questions that a case needs; return None for later."""
        if case.ended_with is EndReason.COLLISION:
            prompt = "The robot felt a collision. Was there one? (yes / later): "
            return decide(case, Answer(AnswerKind.CONFIRM)) if self._ask_until(prompt, parse_confirmation) else None
        touched = self._ask_touched()
        if touched is TypedAnswer.LATER:
            return None
        if isinstance(touched, str):
            return decide(case, Answer(AnswerKind.COLLISION, touched))
        if case.ended_with is EndReason.STOP:
            return self._ask_distance(case)
        return decide(case, Answer(AnswerKind.CONFIRM))

    def _ask_touched(self) -> TypedAnswer | str:
        while True:
            touched = self._ask_until("Did it touch anything? (no / what / later): ", parse_touched)
            if isinstance(touched, TypedAnswer):
                return touched
            if self._is_sure(f"A collision with {touched!r}: the episode has failed"):
                return touched

    def _ask_distance(self, case: Case) -> Judgement | None:
        keep = ""
        if case.estimate:
            keep = f"keep {distance_text(case.estimate.distance_m, case.parameters.success_distance_m)} / "
        if case.odometry:
            keep += f"{ODOMETRY} {distance_text(case.odometry.distance_m, case.parameters.success_distance_m)} / "
        prompt = f"Metres by tape to the nearest {case.goal}? (0.84 / {keep}later): "
        while True:
            distance = self._ask_until(prompt, parse_distance)
            if distance is TypedAnswer.LATER:
                return None
            is_kept = distance is TypedAnswer.KEEP
            answer = Answer(AnswerKind.CONFIRM) if is_kept else Answer(AnswerKind.MEASURED, str(distance))
            try:
                return decide(case, answer)
            except UnconfirmedAnswerError as doubt:
                if self._is_sure(str(doubt)):
                    return decide(case, replace(answer, is_confirmed=True))
            except MisreadError as error:
                self._console.print(f"[yellow]{escape(str(error))}[/yellow]")

    def _is_sure(self, of: str) -> bool:
        return self._ask_until(f"{of}. Is that right? (yes / no): ", parse_confirmation)

    def _ask_until(self, prompt: str, parse: Callable[[str], Parsed]) -> Parsed:
        """Ask until the answer can be parsed."""
        while True:
            try:
                return parse(self._ask(prompt))
            except MisreadError as error:
                self._console.print(f"[yellow]{escape(str(error))}[/yellow]")

    def _ask(self, prompt: str) -> str:
        """Return what is typed. Ctrl-C, a closed terminal and the end of the input take effect here.

        Raises:
            Stopped: the operator stopped the session, or the terminal closed.
        """
        with self._stop.interruptible():
            try:
                discard_typed()
                self._console.print(prompt, end="", markup=False, soft_wrap=True)
                return self._prompts.read_line()
            except (EOFError, OSError):
                leave_dead_terminal()
                raise Stopped(
                    StopRequest(StopAuthor.SYSTEM, "a terminal that was closed", exit_code=ExitCode.HUNG_UP)
                ) from None
