"""All detectors, by name.

A detector is a class in a file of its own, created from a layout, a registration, a timing and the
known properties of the sensor's pixels. Classes are imported on use: the names are read at
start-up, which must not wait for numba.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from link.detect.detector import Detector
    from link.detect.pixel import PixelLaw
    from link.layout import Layout
    from link.timing import Registration, Timing

DETECTORS: Final = {
    "joint": "link.detect.joint:Joint",
    "packed": "link.detect.packed:Packed",
    "threshold": "link.detect.threshold:Threshold",
    "forward-backward": "link.detect.forward_backward:ForwardBackward",
}
"""Module and class, by the name in scenarios and on the command line."""


def make_detector(
    name: str,
    layout: Layout,
    registration: Registration,
    timing: Timing,
    *,
    pixel: PixelLaw | None = None,
) -> Detector:
    """A detector by its name.

    Args:
        name: key of DETECTORS.
        layout, registration, timing: cells, their place in the image and their time.
        pixel: known properties of the sensor's pixels. The joint, the packed and the threshold
            detector learn everything and ignore it.
    """
    if name not in DETECTORS:
        raise ValueError(f"detector must be one of {', '.join(DETECTORS)}, not {name}")
    module, cls = DETECTORS[name].split(":")
    detector: Detector = getattr(import_module(module), cls)(layout, registration, timing, pixel)
    return detector
