"""Stand-in for llava.mm_utils, as NaVILA's evaluation/vlnce_baselines/navila_trainer.py uses it."""

import torch

from llava.constants import IMAGE_TOKEN_INDEX


def get_model_name_from_path(path):
    return path.rstrip("/").split("/")[-1]


def process_images(images, processor, config):
    return torch.zeros(len(images), 3, 8, 8)


def tokenizer_image_token(prompt, tokenizer, image_token_index=IMAGE_TOKEN_INDEX, return_tensors=None):
    pieces = prompt.split("<image>")
    tokens = [
        token for number, piece in enumerate(pieces) for token in [image_token_index] * (number > 0) + [len(piece)]
    ]
    return torch.tensor(tokens)


class KeywordsStoppingCriteria:
    def __init__(self, keywords, tokenizer, input_ids):
        assert all(keywords)
