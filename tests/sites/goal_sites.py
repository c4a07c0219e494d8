"""Site files with goals of every kind, in a copy of the apartment."""

from pathlib import Path

import cv2
import numpy as np

from vsnbench.sites.site import embedded_sites

GOALS = """
goals:
  - {id: red-armchair, kind: text, text: the red armchair, targets: [armchair]}
  - {id: window-corner, kind: text, text: the corner by the window, targets: [{point: [1.6, 0.5]}]}
  - {id: photo-bed, kind: image, image: bed.png, targets: [bed-1]}
  - {id: cold-box, kind: category, category: refrigerator}
  - id: to-the-kitchen
    kind: instruction
    text: leave the bedroom and stop in the kitchen
    targets: [{region: [[0.6, 5.9], [3.9, 5.9], [3.9, 6.8], [0.6, 6.8]], name: kitchen}]
    starts: [1, 2, 3]
"""


def write_site(directory: Path, goals: str = GOALS) -> Path:
    """Write the apartment with goals and the photograph that they name."""
    picture = np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    assert cv2.imwrite(str(directory / "bed.png"), picture)
    path = directory / "lab.yaml"
    path.write_text(embedded_sites()["apartment"].read_text(encoding="utf-8") + goals, encoding="utf-8")
    return path
