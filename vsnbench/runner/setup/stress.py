"""A stress test: every campaign of a sweep undisturbed, and with each disturbance at each severity."""

from collections.abc import Sequence

from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import NONE, SEVERITIES, STANDARD_SET, Disturbances, known_kind
from vsnbench.robots.registry import is_simulated
from vsnbench.statistics.power import least_p, min_starts
from vsnbench.text.sanitize import counted

DEFAULT_SEVERITIES = (1, 3, 5)


def check_robot(robot: str) -> None:
    """Refuse a real robot, which would have to repeat every trial with every disturbance.

    Raises:
        UsageError: the robot is not simulated in this process (`real-robot`).
    """
    if not is_simulated(robot):
        raise UsageError(
            f"a stress test needs a simulated robot, and {robot} is real",
            advice="measure single conditions with `vsnbench run --disturb`",
            code="real-robot",
        )


def weakness_of(starts: int, disturbances: int, alpha: float = 0.05) -> str:
    """Return why a stress test can show no loss whatever its results are; empty if it can.

    Args:
        starts: number of starting positions, the independent units of its test.
        disturbances: number of disturbed conditions, over which the p-values are corrected.
        alpha: largest p-value that shows a loss.
    """
    corrected = min(1.0, least_p(starts) * disturbances)
    if corrected <= alpha:
        return ""
    return (
        f"this stress test can show no loss: with {counted(starts, 'starting position')} the smallest possible p-value "
        f"is {least_p(starts):.2g}, after correction for {counted(disturbances, 'condition')} {corrected:.2g}; use at "
        f"least {min_starts(alpha / disturbances)} positions, or fewer disturbances and severities"
    )


def conditions_of(names: Sequence[str], severities: Sequence[int]) -> tuple[Disturbances, ...]:
    """Return the conditions of a stress test: undisturbed first, then each disturbance by severity.

    Args:
        names: names of disturbances; empty for the standard set.
        severities: from 1 to 5; empty for `DEFAULT_SEVERITIES`.

    Raises:
        UsageError: a name or a severity does not exist (`unknown-disturbance`, `invalid-severity`), or a name is given
            twice (`duplicate-disturbance`).
    """
    chosen: list[str] = []
    for name in names or STANDARD_SET:
        bare = name.strip().partition("=")[0].partition("@")[0]
        kind = known_kind(bare)
        if bare != name.strip():
            raise UsageError(
                f"--disturb {name}: a stress test takes names without values",
                advice=f"give --disturb {kind.name} --severity 1,3,5, or use `vsnbench run --disturb {name}`",
                code="invalid-disturbance",
            )
        if kind.name in chosen:
            raise UsageError(
                f"--disturb: {kind.name} is given twice", advice="give each name once", code="duplicate-disturbance"
            )
        chosen.append(kind.name)
    for severity in severities:
        if severity not in SEVERITIES:
            raise UsageError(
                f"--severity {severity}: severities are 1 to 5",
                advice="give numbers like 1,3,5",
                code="invalid-severity",
            )
    levels = sorted(set(severities or DEFAULT_SEVERITIES))
    return (NONE, *(Disturbances((known_kind(name).at(level),)) for name in chosen for level in levels))
