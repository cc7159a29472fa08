"""Noise of readings that follow each other closely."""

from __future__ import annotations

import numpy as np


def autoregressive(white: np.ndarray, kept: float) -> np.ndarray:
    """Of first order, from white noise and as strong: of each a share is kept in the next."""
    noise = white.copy()
    for number in range(1, len(noise)):
        noise[number] = kept * noise[number - 1] + (1 - kept**2) ** 0.5 * noise[number]
    return noise
