"""Images from streams, for Python."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import SpikeStream
from scenarios.assemble.dim_of_run import dim_of_run
from scenarios.python.streams import Stream
from sensor.reconstruct import reconstruct as image_of
from sensor.reconstruct import tau_image

__all__ = ["reconstruct"]


def reconstruct(
    stream: SpikeStream, at: int, method: str = "tfp", *, window: int | None = None,
    preceding: bool = False,
) -> npt.NDArray[np.float32]:  # fmt: skip
    """The image at an instant, as `viform image` makes it.

    Args:
        stream: the stream; one of a run's folder has its dim pixels by the run's readings.
        at: cycle of the instant, from 0.
        method: "tfp", "tfi", "tfstp", "motion-tfp", or "tau" (255 - tau).
        window: cycles; None for the default of the method.
        preceding: whether no spike after the instant is used.

    Returns:
        (H, W) float32: spikes a cycle; for tau, its levels from 0 to 255.

    Raises:
        InputError: another method, or an instant or window that the stream does not have.
    """
    if method == "tau":
        return tau_image(stream, at).astype(np.float32)
    light = dim_of_run(stream.path) if isinstance(stream, Stream) else None
    return image_of(stream, method, at, window, preceding=preceding, dim_light=light).rate
