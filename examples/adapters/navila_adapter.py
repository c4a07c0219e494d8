"""NaVILA as a model: follows instructions, and answers with a turn or a distance in words.

Put this file and vsnbench_policy.py into NaVILA's environment (its package `llava`):

    python vsnbench_policy.py navila_adapter:NaVILA --settings navila.json --port 8765
    vsnbench run --model ws://gpu-box:8765 --site examples/goals.yaml --goal past-the-sofa

navila.json: {"model_path": "navila-llama3-8b-8f", "question_file": "question.txt"}. The model was trained with one
question: copy it from `evaluation/vlnce_baselines/navila_trainer.py`, with {frames} and {instruction} in the places of
upstream's variables. Lines of upstream are those of AnjieCheng/NaVILA at commit 76b98f2.
"""

import math
import re
from pathlib import Path

import numpy as np
from PIL import Image

_STOP = re.compile(r"\bstop\b", re.IGNORECASE)
_ANSWER = re.compile(r"\b(forward|left|right)\b(?:\D{0,20}(\d+))?", re.IGNORECASE)
_FRAME_CM, _FRAME_DEG = 25, 15


class NaVILA:
    """Executes an answer in steps of 25 cm and 15 degrees, with an image for the model's video after each."""

    def __init__(
        self, model_path, question_file, conversation="llama_3", chunk=False, category_as="Search for a {}.", tokens=32
    ):
        """Load the model.

        Args:
            model_path: directory of the checkpoint.
            question_file: text of the question, with {frames} and {instruction}.
            conversation: name of upstream's template of a conversation.
            chunk: send the steps of an answer as a chunk. The model's video then has an image for each answer only.
            category_as: instruction for a goal that is a category.
            tokens: maximum length of an answer.
        """
        from llava.mm_utils import get_model_name_from_path
        from llava.model.builder import load_pretrained_model

        self.question = Path(question_file).read_text(encoding="utf-8").strip()
        if "{frames}" not in self.question or "{instruction}" not in self.question:
            raise ValueError(f"{question_file} must have {{frames}} and {{instruction}}")
        name = get_model_name_from_path(str(model_path))
        self.tokenizer, self.model, self.processor, _ = load_pretrained_model(str(model_path), name)
        self.conversation, self.chunk, self.tokens = conversation, chunk, tokens
        self.category_as = category_as
        self.card = {
            "name": "navila",
            "sensors": ["rgb"],
            "goal_kinds": ["instruction", "text", "category"],
            "action_kinds": ["discrete", "move"] + (["chunk"] if chunk else []),
            "weights_label": str(model_path),
            # The camera of upstream's evaluations (evaluation/habitat_extensions/config/vlnce_task.yaml:13-16).
            "camera": {"horizontal_fov_deg": 90, "width": 512, "height": 512},
            "settings": {"question": self.question, "chunk": chunk, "category_as": category_as, "tokens": tokens},
            "deterministic": False,  # half precision on a GPU
        }
        self.instruction, self.frames, self.left = "", [], []

    def reset(self, goal, seed):
        """Start an episode with an empty video. Upstream decodes greedily, so the seed is not used."""
        is_category = getattr(goal, "kind", "category") == "category"
        text = getattr(goal, "text", "") or str(goal)
        self.instruction = self.category_as.format(text) if is_category else text
        self.frames, self.left = [], []

    def act(self, observation):
        """Return the next step of the answer, or ask for a new one."""
        self.frames.append(Image.fromarray(observation.rgb))
        if self.left:
            return self.left.pop(0)
        text = self._answer(sampled(self.frames, self.model.config.num_video_frames))
        steps = steps_of(text)
        if self.chunk and steps != ["STOP"]:
            return {"parts": [step["movement"] for step in steps], "raw_action": text}
        first, self.left = steps[0], steps[1:]
        return {"action": "STOP", "raw_action": text} if first == "STOP" else dict(first, raw_action=text)

    def _answer(self, frames):
        import torch
        from llava.constants import IMAGE_TOKEN_INDEX
        from llava.conversation import SeparatorStyle, conv_templates
        from llava.mm_utils import KeywordsStoppingCriteria, process_images, tokenizer_image_token

        talk = conv_templates[self.conversation].copy()
        history = "<image>\n" * (len(frames) - 1)
        talk.append_message(talk.roles[0], self.question.format(frames=history, instruction=self.instruction))
        talk.append_message(talk.roles[1], None)
        device = self.model.device
        tokens = tokenizer_image_token(talk.get_prompt(), self.tokenizer, IMAGE_TOKEN_INDEX, return_tensors="pt")
        tokens = tokens.unsqueeze(0).to(device)
        images = process_images(frames, self.processor, self.model.config).to(device, dtype=torch.float16)
        end = talk.sep2 if talk.sep_style == SeparatorStyle.TWO else talk.sep
        with torch.inference_mode():
            output = self.model.generate(
                tokens,
                images=images,
                do_sample=False,
                max_new_tokens=self.tokens,
                use_cache=True,
                pad_token_id=self.tokenizer.eos_token_id,
                stopping_criteria=[KeywordsStoppingCriteria([end], self.tokenizer, tokens)],
            )
        return self.tokenizer.batch_decode(output, skip_special_tokens=True)[0].strip().removesuffix(end).strip()


def sampled(frames, count):
    """Return as many frames as the model takes, evenly from the past, the latest last; black ones in front."""
    blank = Image.new("RGB", frames[-1].size)
    padded = [blank] * (count - len(frames)) + frames
    chosen = np.linspace(0, len(padded) - 1, count - 1, endpoint=False, dtype=int)
    return [padded[index] for index in chosen] + [padded[-1]]


def steps_of(text):
    """Return the steps of an answer such as `turn left 45 degree` or `move forward 75 cm`; STOP ends the episode.

    Without a number, and with 0, an answer is one step, as in evaluation/vlnce_baselines/navila_trainer.py:242-280.
    """
    if _STOP.search(text):  # navila_trainer.py:222-234 looks for it first
        return ["STOP"]
    found = _ANSWER.search(text)
    if found is None:
        raise ValueError(f"NaVILA's answer has no action: {text!r:.200}")
    direction = found.group(1).lower()
    size = _FRAME_CM if direction == "forward" else _FRAME_DEG
    amount = int(found.group(2) or 0) or size
    parts = [size] * (amount // size) + [amount % size] * bool(amount % size)
    if direction == "forward":
        return [{"movement": {"kind": "move", "distance_m": part / 100}} for part in parts]
    side = 1 if direction == "left" else -1
    return [{"movement": {"kind": "move", "turn_rad": side * math.radians(part)}} for part in parts]
