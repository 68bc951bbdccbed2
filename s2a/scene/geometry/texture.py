"""Colours of a scan as a texture."""

from __future__ import annotations

import numpy as np

BLOCK = 4
"""Texels along a triangle's edge in the texture."""


def bake(faces: np.ndarray, colors: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Turn colours per vertex into a texture, because simulators give a mesh one colour or a texture.

    Every triangle gets a block of BLOCK x BLOCK texels, in which its corners' colours blend.

    Args:
        faces: shape [face 3].
        colors: RGB, shape [vertex 3], uint8; None is grey.

    Returns:
        Texture coordinates of the corners, shape [3 face, 2], v upwards; texture RGBA [size size 4], uint8.
    """
    corners = np.full((len(faces), 3, 3), 170.0) if colors is None else colors[faces].astype(float)
    side = int(np.ceil(np.sqrt(max(1, len(faces)))))
    step = np.arange(BLOCK) / (BLOCK - 1)
    u, v = np.meshgrid(step, step)
    weights = np.stack([np.clip(1.0 - u - v, 0.0, 1.0), u, v])
    blocks = np.einsum("fck,cij->fijk", corners, weights / weights.sum(axis=0))
    padded = np.zeros((side * side, BLOCK, BLOCK, 3))
    padded[: len(faces)] = blocks
    image = padded.reshape(side, side, BLOCK, BLOCK, 3).swapaxes(1, 2).reshape(side * BLOCK, side * BLOCK, 3)
    texture = np.concatenate([image, np.full((*image.shape[:2], 1), 255.0)], axis=2).round().astype(np.uint8)
    index = np.arange(len(faces))
    first = np.stack([index % side, index // side], axis=1)[:, None] * BLOCK + 0.5
    texels = first + np.array([[0, 0], [1, 0], [0, 1]]) * (BLOCK - 1)
    uv = texels.reshape(-1, 2) / (side * BLOCK)
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype(np.float32), texture
