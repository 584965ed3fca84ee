"""Motion-aligned TFP: a window whose spikes follow what moves.

TFP of a long window has little noise and much motion blur. Here a window is cut into parts of few
cycles. Each part is shifted to where its content is at the instant, and the mean is taken of the
shifted parts. The motion is the dense optical flow (DIS, Kroeger et al., ECCV 2016, of OpenCV) from
a coarse TFP image at the instant to one before and one after it, which are a third of the window
apart and as long. Within half a window velocities are taken as constant.

The flow of a pixel into a half of the window is refused where it leaves the image, and where the
way there (forward flow), or there and back (and backward flow), ends at another brightness than it
began at: there something appears, disappears, or is not found again. Along an edge or on a plain
surface a flow is not determined and not needed, so brightness decides and not the distance. A pixel
has the halves that are not refused; one with none has the coarse image, a plain window.

All pixels must have the same colour filter, since the shifts mix neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.spikes.viform import WORD, SpikeStream, Viform, words_for
from sensor.reconstruct.playback import tfp, tfp_span

Grey = npt.NDArray[np.uint8]
Rate = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
SMOOTH: Final = 0.8
"""Standard deviation of the Gaussian filter before the flow, pixels."""
LEAST: Final = 12
"""Pixels of the shorter side that the flow takes."""
ALIGNED: Final = 201
"""Cycles of a window by default."""
PART: Final = 3
"""Cycles of a part, within which nothing is shifted. 9 cost 1 to 2 dB on a chart with strips that
move a pixel in three cycles."""
COARSE: Final = 3
"""Window over the length of a coarse image, and over the time between two of them. 2 and 4 are up
to 1 dB worse, on one scene or another."""
WHITE: Final = 99.5
"""Percentile of the coarse image that becomes white for the flow, which takes 8 bits."""
SAME: Final = 0.1
"""Change of brightness, over that white, from which on a flow is refused. 0.05 and 0.2 give the
same within 0.1 dB."""


@dataclass(frozen=True, eq=False)
class Aligned:
    """A motion-aligned image.

    Attributes:
        rate: (H, W) float32, spikes a cycle.
        plain: pixels with the plain window, both flows being refused, (H, W).
        one_sided: pixels with one half of the window, (H, W).
    """

    rate: Rate
    plain: Mask
    one_sided: Mask


def motion_tfp(stream: SpikeStream, at: int, window: int = ALIGNED) -> Aligned:
    """Spikes a cycle over a window around cycle `at` that follows the motion.

    Args:
        window: cycles, odd. Near an end of the stream the parts are taken that there are, and a
            half without a whole coarse image is left out.

    Raises:
        InputError: the stream does not hold the cycle, the window is even or below 1, or a side of
            the image is shorter than `LEAST`.
    """
    first, stop = tfp_span(stream, at, window)
    if min(stream.shape) < LEAST:
        size = f"{stream.shape[1]}x{stream.shape[0]}"
        raise InputError(
            "the stream", f"at least {LEAST} pixels high and wide for motion-tfp", size, "use tfp"
        )
    reach = (window // COARSE) | 1
    near, begin = _excerpt(stream, at - reach - reach // 2, at + reach + reach // 2 + 1)
    now = tfp(near, at - begin, reach)
    white = max(float(np.percentile(now, WHITE)), 1 / reach)
    seen = flow_grey(now, white)
    y, x = np.indices(stream.shape, np.float32)
    here = np.stack([x, y], axis=-1)
    parts, offset = _excerpt(stream, first, stop)
    middle = (at - PART // 2, at + PART // 2 + 1)
    length = min(middle[1], stream.cycles) - max(middle[0], 0)
    total = tfp(parts, at - offset, PART) * np.float32(length)
    cycles = np.full(stream.shape, length, np.float32)
    taken = np.zeros(stream.shape, np.uint8)
    for side in (-1, 1):
        there = at + side * reach
        if there - reach // 2 < 0 or there + reach // 2 >= stream.cycles:
            continue
        flow, good = _flow(seen, flow_grey(tfp(near, there - begin, reach), white), here)
        taken += good
        for step in range(PART, window // 2 - PART // 2 + 1, PART):
            cycle = at + side * step
            if cycle - PART // 2 < first or cycle + PART // 2 >= stop:
                break
            part = tfp(parts, cycle - offset, PART)
            moved = _sample(part, here + flow * np.float32(step / reach))
            total += np.where(good, moved * PART, 0)
            cycles += np.where(good, np.float32(PART), 0)
    plain = taken == 0
    # Cubic interpolation undershoots.
    rate = np.maximum(np.where(plain, now, total / cycles), 0)
    return Aligned(rate, plain, taken == 1)


def _excerpt(stream: SpikeStream, first: int, stop: int) -> tuple[Viform, int]:
    """The part of a stream that holds these cycles, in memory, and its first cycle."""
    low = max(first, 0) // WORD
    high = words_for(min(stop, stream.cycles))
    words = np.asarray(stream.read_words(low, high))
    cycles = min(high * WORD, stream.cycles) - low * WORD
    return Viform(words, cycles, stream.clock), low * WORD


def _flow(seen: Grey, other: Grey, here: Rate) -> tuple[Rate, Mask]:
    """Optical flow from one image to another, (H, W, 2) of columns and rows in pixels, and where it
    is not refused, (H, W). here: (H, W, 2), column and row of each pixel."""
    flow, back = optical_flow(seen, other), optical_flow(other, seen)
    end = here + flow
    good = (end >= 0).all(axis=-1) & (end <= here[-1, -1]).all(axis=-1)
    for image, place in ((other, end), (seen, end + _sample(back, end))):
        change = np.abs(_sample(image.astype(np.float32), place) - seen)
        good &= change <= 255 * SAME
    return flow, good


def flow_grey(rate: npt.NDArray[np.float32], white: float, smooth: float = SMOOTH) -> Grey:
    """A smooth image of 8 bits for the flow, (H, W); `white` becomes 255."""
    import cv2

    blurred = cv2.GaussianBlur(rate, (0, 0), smooth)
    return np.rint(255 * np.clip(blurred / white, 0, 1)).astype(np.uint8)


def optical_flow(first: Grey, second: Grey) -> npt.NDArray[np.float32]:
    """Motion from each pixel of the first image to the second, (H, W, 2) of columns and rows,
    pixels."""
    import cv2

    vision: Any = cv2  # its types lack this
    dis = vision.DISOpticalFlow_create(vision.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setFinestScale(0)  # every pixel; the preset's 1 costs up to 3 dB on fine detail
    return np.asarray(dis.calc(first, second, None), np.float32)


def _sample(image: Rate, place: Rate) -> Rate:
    """An image at places (H, W, 2) of columns and rows, by cubic interpolation; linear costs
    1 dB."""
    import cv2

    rows: Any = None  # they are in `place`
    moved = cv2.remap(image, place, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)
