"""Plot of a run: losses of every stage and success rate on the validation sites."""

import io
from collections.abc import Sequence
from pathlib import Path

from training.atomic_files import write_atomic
from training.stage import Row


def draw_curves(rows: Sequence[Row], path: Path) -> None:
    """Write a PNG.

    Raises:
        TrainingError: the disk is full or not writable.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.4), layout="constrained")
    seen, cloned, success, stopping = figure.subplots(1, 4)
    _line(seen, rows, "seeing", "loss", "training")
    _line(seen, rows, "seeing", "held_out_loss", "held out")
    for stage in sorted({row["stage"] for row in rows if row["stage"].startswith("cloning")}):
        _line(cloned, rows, stage, "loss", stage)
        examined = [row for row in rows if row["stage"] == stage and "validation_episodes" in row]
        shares = [100 * row["validation_successes"] / row["validation_episodes"] for row in examined]
        success.plot([row["update"] for row in examined], shares, "o-", label=stage, markersize=3)
    calibrated = sorted((row for row in rows if row["stage"] == "calibration"), key=lambda row: row["stop_bias"])
    shares = [100 * row["validation_successes"] / row["validation_episodes"] for row in calibrated]
    stopping.plot([row["stop_bias"] for row in calibrated], shares, "o-", markersize=3)
    for axes, title, across in (
        (seen, "Seeing: loss", "update"),
        (cloned, "Cloning: loss", "update"),
        (success, "Validation success, %", "update"),
        (stopping, "Calibration success, %", "added to the logit of STOP"),
    ):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel(across)
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, frameon=False)
    success.set_ylim(0, 100)
    stopping.set_ylim(0, 100)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=130)
    write_atomic(path, lambda file: file.write(drawn.getvalue()))


def _line(axes: object, rows: Sequence[Row], stage: str, key: str, label: str) -> None:
    own = [row for row in rows if row["stage"] == stage and key in row]
    axes.plot([row["update"] for row in own], [row[key] for row in own], label=label, linewidth=1.2)  # type: ignore[attr-defined]
