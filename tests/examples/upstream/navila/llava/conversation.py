"""Stand-in for llava.conversation, as NaVILA's evaluation/vlnce_baselines/navila_trainer.py uses it."""

import copy
from enum import Enum, auto


class SeparatorStyle(Enum):
    TWO = auto()
    LLAMA_3 = auto()


class Conversation:
    roles = ("user", "assistant")
    sep, sep2, sep_style = "<|end_of_text|>", None, SeparatorStyle.LLAMA_3

    def __init__(self):
        self.messages = []

    def copy(self):
        return copy.deepcopy(self)

    def append_message(self, role, message):
        self.messages.append((role, message))

    def get_prompt(self):
        return "".join(f"{role}: {message or ''}\n" for role, message in self.messages)


conv_templates = {"llama_3": Conversation()}
