"""Runs the network in PyTorch: on a CPU in float32 (the reference), or on a GPU."""

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
        self._hidden = torch.zeros(sizes.recurrent_layers, 1, sizes.hidden_size, device=self._device)

    @torch.inference_mode()
    def step(self, step: StepInput) -> StepOutput:
        """Run one step."""
        output = self._network(
            torch.from_numpy(step.image)[None].to(self._device),
            torch.tensor([step.gps_m], dtype=torch.float32, device=self._device),
            torch.tensor([[step.compass_rad]], dtype=torch.float32, device=self._device),
            torch.tensor([step.goal], device=self._device),
            torch.tensor([step.previous_index], device=self._device),
            torch.tensor([[0.0 if step.begins else 1.0]], device=self._device),
            self._hidden,
        )
        self._hidden = output.hidden
        answer = torch.cat([output.logits[0], output.value[0]]).cpu().numpy()
        return StepOutput(answer[:-1].astype(np.float32), float(answer[-1]))
