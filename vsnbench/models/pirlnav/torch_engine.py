"""Runs the network in PyTorch: on a CPU in float32 (the reference), or on a GPU."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from vsnbench.models.pirlnav.engine import Engine, StepInput, StepOutput
from vsnbench.models.pirlnav.network import PIRLNavNetwork


class TorchEngine(Engine):
    """Eager PyTorch on one device."""

    def __init__(self, network: PIRLNavNetwork, device: str = "cpu", *, half: bool = False) -> None:
        self.label = f"PyTorch {torch.__version__} on {device}, {'half' if half else 'single'} precision"
        self._device = torch.device(device)
        if device == "cuda":  # cuDNN's default rounds factors to ten bits
            torch.backends.cudnn.allow_tf32 = False
        self._network = network.to(self._device)
        if half:  # only the encoder, which is most of the work; errors add up in the memory of an episode
            net = self._network.net
            for part in (net.visual_encoder.backbone, net.visual_encoder.compression, net.visual_fc):
                part.to(dtype=torch.float16)
        sizes = network.architecture
        self.memory = torch.zeros(sizes.recurrent_layers, 1, sizes.hidden_size, device=self._device)

    def step(self, step: StepInput) -> StepOutput:
        """Run one step."""
        [(output, self.memory)] = self._run([step], self.memory)
        return output

    def step_together(self, steps: Sequence[StepInput], memories: Sequence[Any]) -> list[tuple[StepOutput, Any]]:
        """Run a step of several episodes in one pass of the network. The last bits depend on their number."""
        if len(steps) == 1:
            return super().step_together(steps, memories)
        blank = torch.zeros_like(self.memory)
        return self._run(steps, torch.cat([blank if memory is None else memory for memory in memories], dim=1))

    @torch.inference_mode()
    def _run(self, steps: Sequence[StepInput], memory: torch.Tensor) -> list[tuple[StepOutput, Any]]:
        device = self._device
        logits, value, hidden = self._network(
            torch.from_numpy(np.stack([step.image for step in steps])).to(device),
            torch.tensor([step.gps_m for step in steps], dtype=torch.float32, device=device),
            torch.tensor([[step.compass_rad] for step in steps], dtype=torch.float32, device=device),
            torch.tensor([step.goal for step in steps], device=device),
            torch.tensor([step.previous_index for step in steps], device=device),
            torch.tensor([[0.0 if step.begins else 1.0] for step in steps], device=device),
            memory,
        )
        answers = torch.cat([logits, value], dim=1).cpu().numpy()
        memories = hidden.split(1, dim=1)
        return [
            (StepOutput(answer[:-1].astype(np.float32), float(answer[-1])), after)
            for answer, after in zip(answers, memories, strict=True)
        ]
