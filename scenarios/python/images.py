"""Images from streams, for Python."""

from __future__ import annotations

import os
from operator import index

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.errors import quote
from cosim.spikes.viform import SpikeStream
from scenarios.assemble.camera.dim import dim_of_run
from scenarios.python.frames import is_whole
from scenarios.python.streams import Stream, as_stream
from scenarios.python.words import in_python
from sensor.reconstruct import METHODS, isi, tau_levels
from sensor.reconstruct import reconstruct as image_of
from sensor.reconstruct.intervals import interval_span


@in_python
def reconstruct(
    stream: SpikeStream | str | os.PathLike[str], at: int, method: str = "tfp", *,
    window: int | None = None, preceding: bool = False,
) -> npt.NDArray[np.float32]:  # fmt: skip
    """The image at an instant, as `viform image` makes it.

    Args:
        stream: the stream, or its path; one in a run's folder has its dim pixels by the run's
            readings.
        at: cycle of the instant, from 0.
        method: "tfp", "tfi", "tfstp", "motion-tfp", or "tau" (255 - tau).
        window: cycles; None for the default of the method.
        preceding: whether no spike after the instant is used.

    Returns:
        (H, W) float32: spikes a cycle; for tau, its levels from 0 to 255.

    Raises:
        InputError: another method, or an instant or window that the stream does not have.
    """
    opened = as_stream(stream)
    try:
        cycle = index(at)
    except TypeError:
        raise InputError("at", "the number of a cycle", quote(at), "round it") from None
    if window is not None and not is_whole(window):
        raise InputError("window", "a whole number of cycles", quote(window), "round it")
    names = (*METHODS, "tau")
    if method not in names:
        raise InputError("method", f"one of {', '.join(names)}", quote(method), "choose one")
    if method == "tau":
        span = interval_span(opened, cycle, window, preceding=preceding)
        return tau_levels(isi(opened, cycle, span)).astype(np.float32)
    light = dim_of_run(opened.path) if isinstance(opened, Stream) else None
    return image_of(opened, method, cycle, window, preceding=preceding, dim_light=light).rate
