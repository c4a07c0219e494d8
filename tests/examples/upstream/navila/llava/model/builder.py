"""Stand-in for llava.model.builder: a model whose answers are a list.

Written from NaVILA's evaluation (AnjieCheng/NaVILA, commit 76b98f2, evaluation/vlnce_baselines/navila_trainer.py).
"""

from types import SimpleNamespace

import torch

from llava.constants import IMAGE_TOKEN_INDEX

ANSWERS = (
    "The next action is turn left 45 degree.",
    "The next action is move forward 75 cm.",
    "The next action is turn right 30 degrees.",
    "The next action is stop.",
)


class Tokenizer:
    eos_token_id = 2

    def batch_decode(self, output, skip_special_tokens=False):
        return [ANSWERS[int(output[0, 0])] + "<|end_of_text|>"]


class Model:
    config = SimpleNamespace(num_video_frames=8)
    device = torch.device("cpu")
    asked = -1

    def generate(self, tokens, images, stopping_criteria, **options):
        assert tokens.shape[0] == 1
        assert int((tokens == IMAGE_TOKEN_INDEX).sum()) == len(images) == 8
        assert images.dtype == torch.float16
        assert options["do_sample"] is False
        self.asked = min(self.asked + 1, len(ANSWERS) - 1)
        return torch.tensor([[self.asked]])


def load_pretrained_model(model_path, model_name, model_base=None):
    return Tokenizer(), Model(), object(), 4096
