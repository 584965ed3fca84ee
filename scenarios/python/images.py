"""Images from streams, for Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.spikes.viform import SpikeStream
from sensor import METHODS, tau_image, tfi, tfp

__all__ = ["reconstruct"]


def reconstruct(
    stream: SpikeStream, at: int, method: str = "tfp", *, window: int = 41,
    preceding: bool = False,
) -> npt.NDArray[np.float32]:  # fmt: skip
    """The image at an instant.

    Args:
        stream: the stream.
        at: cycle of the instant, from 0.
        method: "tfp", "tfi", or "tau" (255 - tau).
        window: cycles of tfp, an odd number.
        preceding: whether the window of tfp ends with the instant.

    Returns:
        (H, W) float32: spikes a cycle; for tau, its levels from 0 to 255.

    Raises:
        InputError: another method, or an instant or window that the stream does not have.
    """
    if method not in METHODS:
        raise InputError("method", f"one of {', '.join(METHODS)}", repr(method), "choose one")
    ways: dict[str, Any] = {
        "tfp": lambda: tfp(stream, at, window, preceding=preceding),
        "tfi": lambda: tfi(stream, at),
        "tau": lambda: tau_image(stream, at),
    }
    return np.asarray(ways[method](), np.float32)
