"""An explorer of pictures: any two of several things side by side, and their difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from cosim.compute.stopping import threads
from cosim.report.explorer import explorer
from cosim.report.parts import data_url
from cosim.report.png import encode, reduced

_LONGEST, _EXACT = 400, 256
"""Longer side of a picture, pixels: larger ones than the first are reduced, and only those up to
the second are without loss."""

Picture = npt.NDArray[np.uint8]


def _source(picture: Picture) -> str:
    """The picture as a data URL: exact if it is small."""
    if max(picture.shape[:2]) <= _EXACT:
        return data_url(encode(picture), "image/png")
    return data_url(encode(reduced(picture, _LONGEST), ".jpg"), "image/jpeg")


def beside(
    names: Sequence[str],
    viewed: str,
    views: Mapping[str, Sequence[Sequence[Picture]]],
    instants: Sequence[str],
) -> str:
    """The HTML of the explorer.

    Args:
        names: names of the things.
        viewed: what a view is, for its label.
        views: pictures by the name of their view, (things, instants), grey and with the sRGB curve;
            those of a view have one size.
        instants: texts of the instants.
    """
    with threads(2) as pool:  # OpenCV releases the interpreter
        pictures = [
            [list(pool.map(_source, pictures)) for pictures in view] for view in views.values()
        ]
    given = {
        "names": list(names), "viewed": viewed, "views": list(views), "instants": list(instants),
        "pictures": pictures,
    }  # fmt: skip
    return explorer(given, "beside")
