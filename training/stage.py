"""One resumable stage of training, with periodic checkpoints that contain its log."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from training.atomic_files import TrainingError, write_atomic
from training.networks import learning_rate

logger = logging.getLogger(__name__)
LOG_EVERY_UPDATES = 20
Row = dict[str, Any]
"""One row of the log: plain JSON values."""


@dataclass(slots=True)
class TrainingStage:
    """Network under training, path of its state, and progress."""

    name: str
    path: Path
    recipe_sha256: str
    model: nn.Module
    parameters: list[nn.Parameter]
    peak_rate: float
    updates: int
    save_every: int
    update: int = 0
    rows: list[Row] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)
    """Further state for resumption: plain values and tensors."""

    def run(
        self,
        step: Callable[[], Tensor],
        largest_gradient: float,
        examine: Callable[[], Row],
        examine_every: int,
    ) -> list[Row]:
        """Train to the last update, from the newest checkpoint if there is one.

        Args:
            step: returns the loss of an update; stores its state in `extra`.
            largest_gradient: maximum norm of the gradient; larger ones are scaled down.
            examine: periodic measurement, also at the end.
            examine_every: number of updates between measurements.

        Returns:
            The log.

        Raises:
            TrainingError: the disk is full, the checkpoint belongs to another recipe, or the loss is not finite.
        """
        optimizer = torch.optim.AdamW(self.parameters, lr=self.peak_rate, weight_decay=1e-4)
        self._resume(optimizer)
        began, losses = time.perf_counter(), []
        while self.update < self.updates:
            for group in optimizer.param_groups:
                group["lr"] = learning_rate(self.peak_rate, self.update, self.updates)
            loss = step()
            if not bool(torch.isfinite(loss)):
                raise TrainingError(f"{self.name}: the loss of update {self.update} is not finite; lower the rate")
            optimizer.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(self.parameters, largest_gradient)
            optimizer.step()
            losses.append(float(loss.detach()))
            self.update += 1
            last = self.update == self.updates
            if last or self.update % LOG_EVERY_UPDATES == 0:
                pace = len(losses) / (time.perf_counter() - began)
                self.rows.append({"stage": self.name, "update": self.update, "loss": sum(losses) / len(losses)})
                logger.info("%s %d/%d loss %.4f, %.2f updates/s", *self._where(), self.rows[-1]["loss"], pace)
                began, losses = time.perf_counter(), []
            if last or self.update % examine_every == 0:
                self.rows.append({"stage": self.name, "update": self.update, **examine()})
                logger.info("%s %d/%d %s", *self._where(), self.rows[-1])
                began, losses = time.perf_counter(), []
            if last or self.update % self.save_every == 0:
                self._save(optimizer)
        return self.rows

    def _where(self) -> tuple[str, int, int]:
        return (self.name, self.update, self.updates)

    def _save(self, optimizer: torch.optim.Optimizer) -> None:
        state = {
            "recipe": self.recipe_sha256,
            "update": self.update,
            "model": self.model.state_dict(),
            "optimizer": optimizer.state_dict(),
            "rows": self.rows,
            "extra": self.extra,
        }
        write_atomic(self.path, lambda file: torch.save(state, file))

    def _resume(self, optimizer: torch.optim.Optimizer) -> None:
        if not self.path.is_file():
            return
        state = torch.load(self.path, map_location="cpu", weights_only=True)
        if state["recipe"] != self.recipe_sha256:
            raise TrainingError(f"{self.path} belongs to another recipe: choose another --output, or remove it")
        self.model.load_state_dict(state["model"])
        optimizer.load_state_dict(state["optimizer"])
        self.update, self.rows, self.extra = state["update"], state["rows"], state["extra"]
        logger.info("%s resumes at update %d of %d", *self._where())
