"""A camera whose frames come one by one, for Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.plan.error import Bounds
from scenarios.python.errors import in_python
from scenarios.python.frames import check_frame
from scenarios.scenes.clips.fitted import Fit
from scenarios.scenes.clips.pictures import shown

if TYPE_CHECKING:
    from sensor.asynchronous.core import FilmedEvents
    from sensor.continuous.core import FilmedIntensities
    from sensor.latched.core import Filmed

S = TypeVar("S", bound="Filmed | FilmedEvents | FilmedIntensities")
"""What a camera gives."""


class LiveStream(Generic[S]):
    """A live camera of `Camera.open`. Frames are pushed by one thread.

    Attributes:
        error: Bounds of the error of the simulation, over a second of any light up to white.
        notes: What a user must know of the light so far.
    """

    def __init__(
        self, live: Any, fit: Fit, white: np.float32, stated: dict[str, float], notes: list[str],
        check_open: Callable[[], object],
    ) -> None:  # fmt: skip
        self.error: Bounds = live.error
        self.notes, self._check_open = notes, check_open
        self._live, self._fit, self._white, self._stated = live, fit, white, stated
        self._like: tuple[Any, ...] | None = None

    def __repr__(self) -> str:
        height, width = self._fit.shape
        frames = "no frame so far" if self._like is None else "frames {} {}".format(*self._like)
        return f"LiveStream: {width} x {height} pixels, {frames}, bound {self.error.bound:.2g}"

    @in_python
    def push(self, frame: npt.ArrayLike) -> S | None:
        """Takes the next frame, see `Camera.film`.

        Returns:
            The spikes of the cycles that are complete with it; None after the first frame.

        Raises:
            InputError: A frame of another shape or type than the first, or one that is none, or the
                camera is closed.
        """
        self._check_open()
        values = check_frame(frame)
        like = values.shape, values.dtype
        if self._like not in (None, like):
            raise InputError(
                "a frame", "as the first, {} {}".format(*self._like or ()),
                f"{values.shape} {values.dtype}", "make all frames alike",
            )  # fmt: skip
        self._like = like
        part: Any = self._live.push(shown(values, self._fit) * self._white)
        if part is not None:  # it is ours: a copy would check its arrays again
            vars(part).update(self._stated)
        return part
