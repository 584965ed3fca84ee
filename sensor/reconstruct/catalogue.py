"""The methods of images from spikes, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.spikes.viform import SpikeStream
from sensor.reconstruct.intervals import TIES, Ties, interval_rate, interval_span, isi, tfi
from sensor.reconstruct.motion import ALIGNED, motion_tfp
from sensor.reconstruct.plasticity import MEMORY, tfstp
from sensor.reconstruct.playback import PLAYED, tfp, tfp_span
from sensor.reconstruct.readings import Dim, DimLight

if TYPE_CHECKING:
    from sensor.reconstruct.shots import Registers

Make = Callable[[SpikeStream, int, Any, bool, Ties], "Image"]


TAU: Final = "tau"
"""Method whose image is no rate, and which is not in `METHODS`: 255 - tau."""


@dataclass(frozen=True, eq=False)
class Image:
    """An image at one instant.

    Attributes:
        rate: (H, W) float32, spikes a cycle.
        cycles: number of cycles of the window that the stream has; None without a window.
        plain: number of pixels without motion alignment; None for methods that have none.
        one_sided: number of pixels that are aligned with one half of the window; None likewise.
        dim: pixels that are read below threshold or rejected as dark; None without either.
    """

    rate: npt.NDArray[np.float32]
    cycles: int | None = None
    plain: int | None = None
    one_sided: int | None = None
    dim: Dim | None = None


@dataclass(frozen=True)
class Method:
    """A method.

    Attributes:
        title: what it is.
        window: cycles by default; None for no window.
        make: the image of (stream, cycle, window, preceding, ties); the window is None only if
            that of the method is.
        precedes: whether it has a form that uses no spike after the instant.
        ties: whether it takes the interval that holds the instant.
        best: windows among which `viform compare-methods` searches; empty for the default alone.
    """

    title: str
    window: int | None
    make: Make
    precedes: bool = True
    ties: bool = False
    best: tuple[int, ...] = ()


def _cycles(stream: SpikeStream, at: int, window: int, preceding: bool) -> int:
    first, stop = tfp_span(stream, at, window, preceding=preceding)
    return stop - first


def _tfp(stream: SpikeStream, at: int, window: int, preceding: bool, ties: Ties) -> Image:
    cycles = _cycles(stream, at, window, preceding)
    return Image(tfp(stream, at, window, preceding=preceding), cycles)


def _tfi(stream: SpikeStream, at: int, window: int | None, preceding: bool, ties: Ties) -> Image:
    cycles = None if window is None else _cycles(stream, at, window, preceding)
    return Image(tfi(stream, at, window, preceding=preceding, ties=ties), cycles)


def _tfstp(stream: SpikeStream, at: int, window: int, preceding: bool, ties: Ties) -> Image:
    return Image(tfstp(stream, at, window, preceding=preceding), _cycles(stream, at, window, True))


def _motion(stream: SpikeStream, at: int, window: int, preceding: bool, ties: Ties) -> Image:
    found, cycles = motion_tfp(stream, at, window), _cycles(stream, at, window, False)
    return Image(found.rate, cycles, int(found.plain.sum()), int(found.one_sided.sum()))


METHODS: Final = {
    "tfp": Method(
        "mean of a window", PLAYED, _tfp,
        best=(3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 31, 35, 41, 51, 61, 81, 101, 121, 141,
              161, 201, 241, 281, 321, 401, 501),
    ),
    "tfi": Method("1/ISI of the interval that holds the instant", None, _tfi, ties=True),
    "tfstp": Method("short-term plasticity", MEMORY, _tfstp),
    "motion-tfp": Method(
        "mean of a window that follows the motion", ALIGNED, _motion, precedes=False,
        best=(61, 81, 121, 161, 201, 241, 321, 401, 501),
    ),
}  # fmt: skip


def check_ties(ties: str, method: str) -> Ties:
    """The ties of this name. Raises InputError for none, or if the method does not have them."""
    chosen = next((each for each in TIES if each == ties), None)
    if chosen is None:
        raise InputError("--ties", f"one of {', '.join(TIES)}", repr(ties), "choose one")
    intervals = [name for name, each in METHODS.items() if each.ties] + [TAU]
    if chosen != TIES[0] and method not in intervals:
        names = " or ".join(intervals)
        raise InputError("--ties", f"given with --method {names}", f"with {method}", "leave it out")
    return chosen


def reconstruct(
    stream: SpikeStream,
    method: str,
    at: int,
    window: int | None = None,
    *,
    preceding: bool = False,
    ties: Ties = "before",
    dim_light: DimLight | None = None,
    registers: Registers | None = None,
) -> Image:
    """The image of a stream at cycle `at`.

    With writes to the threshold, a spike counts as much as it is of the nominal threshold: rates
    are light in nominal thresholds a cycle. Intervals are those between the writes around the
    instant. A row that is not read is black.

    Args:
        method: a name of `METHODS`.
        window: cycles; None for the default of the method.
        preceding: no spike after the instant is used.
        ties: interval of a pixel that fires at the instant: the one before it, or the one after.
        dim_light: how dim pixels are imaged; None for from spikes alone.
        registers: thresholds and windows that are written in the stream; None for none.

    Raises:
        InputError: an unknown method, a cycle beyond the stream, or a window that the method does
            not take.
    """
    if method not in METHODS:
        raise InputError("--method", f"one of {', '.join(METHODS)}", repr(method), "choose one")
    chosen = METHODS[method]
    if preceding and not chosen.precedes:
        names = ", ".join(name for name, each in METHODS.items() if each.precedes)
        raise InputError(
            "--preceding", f"given with --method {names}", f"with {method}", "leave it out"
        )
    check_ties(ties, method)
    size = chosen.window if window is None else window
    if registers is not None:
        return _written(registers, stream, method, at, size, preceding, ties)
    image = chosen.make(stream, at, size, preceding, ties)
    if dim_light is None:
        return image
    dim = dim_light.at(stream, at)
    return replace(image, rate=dim.put(image.rate), dim=dim)


def _written(
    registers: Registers, stream: SpikeStream, method: str, at: int, window: int | None,
    preceding: bool, ties: Ties,
) -> Image:  # fmt: skip
    """An image of a stream with writes, see `reconstruct`."""
    span = (at, at + 1)
    if METHODS[method].ties:
        within = interval_span(stream, at, window, preceding=preceding) or (0, stream.cycles)
        first, stop = registers.untouched(at)
        within = max(within[0], first), min(within[1], stop)
        image = Image(interval_rate(isi(stream, at, within, ties)))
    else:
        assert window is not None
        span = tfp_span(stream, at, window, preceding=preceding or method == "tfstp")
        image = METHODS[method].make(stream, at, window, preceding, ties)
    share = registers.shares(*span)
    light = np.where(share > 0, image.rate / np.where(share > 0, share, 1), 0)
    return replace(image, rate=light.astype(np.float32))
