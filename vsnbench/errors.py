"""The errors that users see: what was wrong and where, and, apart from that, what to do next; and the exit codes."""

from enum import IntEnum


class ExitCode(IntEnum):
    """What a command's end says to a script; `docs/command-line.md` has the same table."""

    DONE = 0
    """It did what was asked, and what it looked at is sound."""
    FAILED = 1
    """It could not, something it checked is not right, or trials are left."""
    USAGE = 2
    """What was typed, or a study's file, does not fit together; nothing was done."""
    HUNG_UP = 129
    """Ended by its terminal, which was closed: the robot stands, every finished step is recorded."""
    INTERRUPTED = 130
    """Ended by Ctrl-C or the emergency stop: likewise."""
    TERMINATED = 143
    """Ended by SIGTERM: likewise."""


class VsnbenchError(Exception):
    """Anything that stops a command for a reason its user can do something about; exit code 1.

    `str` makes one line of both parts, for a terminal, a log or the record.
    """

    exit_code = ExitCode.FAILED

    def __init__(self, statement: object = "", *, advice: str = "") -> None:
        """Keep the two parts of the message.

        Args:
            statement: what was wrong, and where.
            advice: what to do next; empty where nothing better is known than the statement.
        """
        super().__init__(str(statement))
        self.advice = advice

    @property
    def statement(self) -> str:
        """What was wrong, and where."""
        return str(self.args[0])

    def __str__(self) -> str:
        if not self.advice:
            return self.statement
        if self.statement.endswith(("?", "!", ".")):
            return f"{self.statement} {self.advice}"
        return f"{self.statement}{'; ' if ': ' in self.statement else ': '}{self.advice}"


class UsageError(VsnbenchError):
    """The command asked for something that does not exist or does not fit together; exit code 2."""

    exit_code = ExitCode.USAGE


class SiteError(VsnbenchError):
    """A site file that cannot be read or breaks a rule of the site format."""


class RobotError(VsnbenchError):
    """The robot, simulated or real, cannot be used or stopped answering."""


class NotPlacedError(RobotError):
    """The robot does not stand as it should at its start, and a person can put that right."""


class NoAnswerError(RobotError):
    """A part of the robot, or of its network, does not answer; it may come back."""


class SensorLostError(RobotError):
    """A sensor of the robot went silent or sends what cannot be used."""


class ModelError(VsnbenchError):
    """A policy or its weights cannot be used."""


class DecisionError(ModelError):
    """A decision, or a part of it, that is not one: wrong types, numbers that are none, more than may be kept."""


class ObservationError(VsnbenchError):
    """A message that should hold an observation and does not."""


class SensorNotDeclaredError(ModelError, AttributeError):
    """A policy reads a sensor that its card does not name."""


class ModelLostError(VsnbenchError):
    """A policy in another process did not answer in time, or is gone."""


class RecordError(VsnbenchError):
    """The results directory or its database cannot be used."""


class EpisodeClosedError(RecordError):
    """The episode is not this process's to write to: it has ended, or another process has it."""


class JudgedMeanwhileError(VsnbenchError):
    """Another has judged the episode since it was looked at; nothing was written."""


class StudyError(VsnbenchError):
    """A study file that breaks its format, or is not what was locked; exit code 2."""

    exit_code = ExitCode.USAGE
