"""Errors that users see, and exit codes."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of a command; `docs/command-line.md` has the same table."""

    DONE = 0
    """Success."""
    FAILED = 1
    """Failure, failed check or unfinished trials."""
    USAGE = 2
    """Usage error or invalid study file; the command changed nothing."""
    HUNG_UP = 129
    """The terminal was closed. The robot was stopped; every finished step is recorded."""
    INTERRUPTED = 130
    """Ctrl-C or the emergency stop. The robot was stopped; every finished step is recorded."""
    TERMINATED = 143
    """SIGTERM. The robot was stopped; every finished step is recorded."""


class VsnbenchError(Exception):
    """Error that the user can fix; exit code 1.

    `str` joins statement and advice in one line.

    Attributes:
        code: stable kebab-case name of the kind of error, for tests and scripts; texts may change, codes do not.
        advice: the next step for the user, or an empty string.
    """

    exit_code = ExitCode.FAILED
    code = "failed"

    def __init__(self, statement: object = "", *, advice: str = "", code: str = "") -> None:
        """Create an error.

        Args:
            statement: what is wrong, and where.
            advice: the fix; empty if it is obvious.
            code: kind of error, if it is more specific than that of the class.
        """
        super().__init__(str(statement))
        self.advice = advice
        if code:
            self.code = code

    @property
    def statement(self) -> str:
        """What is wrong, and where."""
        return str(self.args[0])

    def __str__(self) -> str:
        if not self.advice:
            return self.statement
        if self.statement.endswith(("?", "!", ".")):
            return f"{self.statement} {self.advice}"
        return f"{self.statement}{'; ' if ': ' in self.statement else ': '}{self.advice}"


class UsageError(VsnbenchError):
    """Options or arguments that do not exist or contradict each other; exit code 2."""

    exit_code = ExitCode.USAGE
    code = "usage"


class SiteError(VsnbenchError):
    """A site cannot be used: its file is invalid, or a check found an error."""

    code = "invalid-site"


class SiteFileError(SiteError):
    """A site file cannot be read or breaks the site format; exit code 2."""

    exit_code = ExitCode.USAGE


class ProtocolError(VsnbenchError):
    """A protocol file cannot be read or breaks its format."""

    code = "invalid-protocol"


class RobotError(VsnbenchError):
    """The robot, simulated or real, cannot be used."""

    code = "robot"


class NotPlacedError(RobotError):
    """The robot is not at its starting position; the operator can correct this."""

    code = "not-placed"


class NoAnswerError(RobotError):
    """A part of the robot or of its network does not answer; it may recover."""

    code = "no-answer"


class ImageError(RobotError):
    """An image message cannot be decoded."""

    code = "invalid-image"


class SensorLostError(RobotError):
    """A sensor of the robot sends nothing or invalid data."""

    code = "sensor-lost"


class ModelError(VsnbenchError):
    """A policy or its weights cannot be used."""

    code = "model"


class DecisionError(ModelError):
    """A decision has wrong types, invalid numbers or too much data."""

    code = "invalid-decision"


class SensorNotDeclaredError(ModelError, AttributeError):
    """A policy reads a sensor that is not on its card."""

    code = "sensor-not-declared"


class ModelLostError(VsnbenchError):
    """A policy in another process did not answer in time or ended."""

    code = "model-lost"


class RecordError(VsnbenchError):
    """The results directory or its database cannot be used."""

    code = "record"


class EpisodeClosedError(RecordError):
    """This process may not write to the episode: it has ended or belongs to another process."""

    code = "episode-closed"


class JudgedMeanwhileError(VsnbenchError):
    """Another operator judged the episode in the meantime; nothing was written."""

    code = "judged-meanwhile"


class StudyError(VsnbenchError):
    """A study file breaks its format or differs from its lock; exit code 2."""

    exit_code = ExitCode.USAGE
    code = "invalid-study"
