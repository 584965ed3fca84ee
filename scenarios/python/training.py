"""Clips become spikes while a network trains, in the workers of a loader of PyTorch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.errors import quote
from scenarios.python.camera import Camera
from scenarios.python.errors import in_python
from scenarios.python.frames import check_instants, is_whole, rate_of
from sensor.latched.core import Filmed

try:
    from torch import from_numpy
    from torch.utils.data import IterableDataset, get_worker_info
except ImportError:  # arrays of numpy, for other loaders
    IterableDataset = object

    def get_worker_info() -> None:
        """There are no workers of PyTorch."""

    def from_numpy(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The array itself."""
        return array


class SpikeStream(IterableDataset):  # type: ignore[misc, type-arg, unused-ignore]
    """Clips that a camera films when they are asked for: a `torch.utils.data.IterableDataset` of
    tensors where PyTorch is installed, else an iterable of arrays.

    Clip n of epoch e has draws of its own, a function of the camera's seed, n and e, whatever the
    number of workers. Each iteration is the next epoch, from 0. Workers have copies of the stream:
    call `set_epoch` before each epoch, or let them live (`persistent_workers`).

    A worker that is spawned makes its own camera; so does one that is forked, as long as the
    process that forks it has filmed nothing.

    Args:
        clips: frames of each, see `Camera.film`; anything with a length and items, of which a
            worker reads its own, or any other iterable, which every worker walks through.
        camera: the camera.
        frame_rate: frames/s.
        white_rate: see `Camera.film`.
        instants: cycles of the true light; the middle one if None.

    Raises:
        InputError: an argument cannot be used.
    """

    @in_python(section="sensor")
    def __init__(
        self, clips: Any, camera: Camera[Filmed], frame_rate: float, *,
        white_rate: float | None = None, instants: Sequence[int] | None = None,
    ) -> None:  # fmt: skip
        items = isinstance(clips, Iterable) or hasattr(clips, "__getitem__")
        if not items or isinstance(clips, (Mapping, str)):
            raise InputError("clips", "frames of several clips", quote(clips), "give a list")
        if not isinstance(camera, Camera):
            raise InputError("camera", "a viform.Camera", quote(camera), "make one")
        if camera.pixel != "latched":
            raise InputError(
                "camera", "one with pixel = latched, whose planes are tensors",
                camera.pixel, "use Camera.film_many",
            )  # fmt: skip
        camera.check_white(white_rate)
        check_instants(instants)
        self._clips, self._camera, self._rate = clips, camera, rate_of(frame_rate)
        self._white_rate, self._instants, self._epoch = white_rate, instants, 0

    def __repr__(self) -> str:
        count = f"{len(self._clips)} clips" if hasattr(self._clips, "__len__") else "clips"
        return (
            f"SpikeStream: {count} at {self._rate:g} frames/s, epoch {self._epoch} next, by "
            f"{self._camera!r}"
        )

    def set_epoch(self, epoch: int) -> None:
        """Gives the next iteration the draws of an epoch, from 0."""
        if not is_whole(epoch) or not 0 <= epoch < 2**32:
            raise InputError("epoch", "a whole number from 0", quote(epoch), "change it")
        self._epoch = int(epoch)

    def _mine(self) -> Iterator[tuple[int, Any]]:
        """Numbers and frames of the clips of this worker."""
        worker = get_worker_info()
        first, count = (0, 1) if worker is None else (worker.id, worker.num_workers)
        clips: Any = self._clips
        if hasattr(clips, "__getitem__") and hasattr(clips, "__len__"):
            return ((n, clips[n]) for n in range(first, len(clips), count))
        return islice(enumerate(clips), first, None, count)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yields, for each clip of this worker:

        number: number of the clip.
        spikes: (T, H, W) uint8, 0 or 1.
        light: (n, H, W) float32, the true light at the instants, white = 1.
        instants: (n,) int64, cycles.
        """
        epoch, self._epoch = self._epoch, self._epoch + 1
        for number, frames in self._mine():
            call = (epoch << 32) + number
            spikes, light, at = self._camera.film_with_truth(
                frames, self._rate, white_rate=self._white_rate, instants=self._instants, call=call
            )
            yield {
                "number": number,
                "spikes": from_numpy(spikes.planes()),
                "light": from_numpy(light),
                "instants": from_numpy(np.array(at, np.int64)),
            }
