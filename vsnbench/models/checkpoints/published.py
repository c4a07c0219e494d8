"""Published weights by name: addresses, hashes and licences of the files that models of vsnbench use."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class PublishedFile:
    """A file on its authors' server."""

    model: str
    """Model that uses it."""
    file_name: str
    """Name in the directory of weights."""
    url: str
    licence: str
    sha256: str = ""
    """Beginning of its hash; empty if the authors published none."""
    page: str = ""
    """Page of its authors that names the file."""


_PIRLNAV: Final = "https://habitat-on-web.s3.amazonaws.com/pirlnav_release/checkpoints"
_PIRLNAV_PAGE: Final = "https://github.com/Ram81/pirlnav#reproducing-results"

PUBLISHED: Final = {
    "mask-rcnn": PublishedFile(
        "vlv",
        "vlv_mask_rcnn.pth",
        "https://download.pytorch.org/models/maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth",
        "BSD-3-Clause (torchvision)",
        "bf2d0c1e",  # torchvision puts the first digits into the file's name
    ),
    "vlv-value": PublishedFile(
        "vlv",
        "vlv_model.torch",
        "http://matthewchang.web.illinois.edu/data/vlv_model.torch",
        "not stated by its authors",
        page="https://github.com/MatthewChang/video-dqn",
    ),
    "pirlnav-il": PublishedFile(
        "pirlnav",
        "pirlnav.ckpt",
        f"{_PIRLNAV}/objectnav_il_hd.ckpt",
        "not stated by its authors",
        page=_PIRLNAV_PAGE,
    ),
    "pirlnav-rl": PublishedFile(
        "pirlnav",
        "pirlnav.ckpt",
        f"{_PIRLNAV}/objectnav_rl_ft_hd.ckpt",
        "not stated by its authors",
        page=_PIRLNAV_PAGE,
    ),
}
"""Name -> file."""
