"""Scales the mask of a box to the image."""

import numpy as np
import numpy.typing as npt

_AT_LEAST = 0.5


def paste_mask(
    mask: npt.NDArray[np.float32], box: tuple[float, float, float, float], image: tuple[int, int]
) -> npt.NDArray[np.bool_]:
    """Return (H, W): the pixels of the object.

    Args:
        mask: (M, M) probabilities within the box.
        box: left, top, right, bottom in pixels.
        image: (height, width).
    """
    import cv2

    side = mask.shape[0]
    padded = np.pad(mask, 1)  # the mask fades out at the box's edge
    grow = (side + 2) / side
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    half_width, half_height = (box[2] - box[0]) / 2 * grow, (box[3] - box[1]) / 2 * grow
    left, top = int(x - half_width), int(y - half_height)
    width = max(int(x + half_width) - left + 1, 1)
    height = max(int(y + half_height) - top + 1, 1)
    resized = cv2.resize(padded, (width, height), interpolation=cv2.INTER_LINEAR) >= _AT_LEAST
    whole = np.zeros(image, np.bool_)
    from_row, to_row = max(top, 0), min(top + height, image[0])
    from_column, to_column = max(left, 0), min(left + width, image[1])
    if from_row < to_row and from_column < to_column:
        whole[from_row:to_row, from_column:to_column] = resized[
            from_row - top : to_row - top, from_column - left : to_column - left
        ]
    return whole
