"""The errors that users see: one line that says what was wrong, where, and what to do."""


class VsnbenchError(Exception):
    """Anything that stops a command for a reason its user can do something about; exit code 1."""

    exit_code = 1


class UsageError(VsnbenchError):
    """The command asked for something that does not exist or does not fit together; exit code 2."""

    exit_code = 2


class SiteError(VsnbenchError):
    """A site file that cannot be read or breaks a rule of the site format."""


class RobotError(VsnbenchError):
    """The robot, simulated or real, cannot be used or stopped answering."""


class NotPlacedError(RobotError):
    """The robot does not stand as it should at its start, and a person can put that right."""


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
