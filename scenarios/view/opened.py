"""A stream with what is known of its run, for `viform view`."""

from __future__ import annotations

from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import BLOCK, InputError
from cosim.files.atomic import identity
from cosim.files.zarr_store import ZarrStream, form_of
from cosim.light.source import Source, truth_at
from cosim.run.chain import STREAM
from cosim.run.result import read_result
from cosim.spikes.viform import WORD, SpikeStream
from sensor.codec.files import open_any
from sensor.reconstruct import reconstruct
from sensor.reconstruct.intervals import isi, spike_cycles
from sensor.reconstruct.playback import PLAYED

_KEPT: Final = 1 << 28
"""Bytes of decoded chunks in memory: 2048 cycles of 1000 x 1000 pixels."""
_PLANES: Final = 8
"""Planes of true light in memory."""
_AROUND: Final = 2
"""Chunks of 64 cycles before and after a cycle that are decoded together for intervals."""


@dataclass(eq=False)
class Opened:
    """A stream that is shown; for one thread at a time.

    Attributes:
        title: title of the page.
        stream: the stream.
        white: rate that is white, spikes a cycle; 1 where it is not known.
        window: window of TFP, cycles.
        source: the scene of the run, None if it is not known.
        notes: what a user should know.
        file: a file of the stream, another one of which means another stream; None to check none.
        as_opened: its `identity` before the stream was opened.
    """

    title: str
    stream: SpikeStream
    white: float
    window: int
    source: Source | None
    notes: list[str]
    file: Path | None = None
    as_opened: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        self._light: OrderedDict[int, npt.NDArray[np.float32]] = OrderedDict()
        self._pool = ThreadPoolExecutor(2)

    def check(self) -> None:
        """Raises InputError if the stream is not the one that was opened: what is kept of that one
        does not go with chunks, a scene or a size of another."""
        if self.file is None or (now := identity(self.file)) == self.as_opened:
            return
        raise InputError(
            self.title, "the stream that was opened",
            "another one under its name" if now else "one that was removed",
            "end viform view and start it again",
        )  # fmt: skip

    def _decode_around(self, at: int) -> None:
        """Decodes the chunks that an image by intervals reads, two at a time; those that are kept
        cost nothing."""
        if not isinstance(self.stream, ZarrStream):
            return
        near = range(at // BLOCK - _AROUND, at // BLOCK + _AROUND + 1)
        chunks = [n * BLOCK // WORD for n in near if 0 <= n * BLOCK < self.stream.cycles]
        for _ in self._pool.map(lambda w: self.stream.read_words(w, w + 1), chunks):
            pass

    def rates(self, at: int, method: str, window: int) -> npt.NDArray[np.float32]:
        """What an image shows at a cycle, (H, W): rates, or interval lengths for `tau`."""
        if method != "tfp":
            self._decode_around(at)
        if method == "tau":
            return isi(self.stream, at).astype(np.float32)
        return reconstruct(self.stream, method, at, window if method == "tfp" else None).rate

    def spikes(self, x: int, y: int, first: int, stop: int) -> list[int]:
        """Cycles in which a pixel has spikes."""
        (found,) = spike_cycles(self.stream, [(y, x)], (first, stop))
        return [int(cycle) for cycle in found]

    def light(self, at: int) -> npt.NDArray[np.float32]:
        """The true light in the middle of a cycle, (H, W), white = 1."""
        assert self.source is not None
        if at not in self._light:
            self._light[at] = self.source.truth(self.stream.clock.middle(at)).astype(np.float32)
            while len(self._light) > _PLANES:
                self._light.popitem(last=False)
        return self._light[at]

    def course(self, x: int, y: int, cycles: list[int]) -> list[float] | None:
        """The true light of a pixel at cycles, white = 1; None for scenes that draw whole planes
        only."""
        if self.source is None or not hasattr(type(self.source), "truth_at"):
            return None
        middle = self.stream.clock.middle
        return [truth_at(self.source, middle(c), [(y, x, "")])[0] for c in cycles]


def open_recording(path: Path, size: tuple[int, int] | None = None) -> Opened:
    """The stream of a run's folder or any stream, without a scene.

    Args:
        path: folder of a run, or a stream of any format.
        size: (width, height) of a stream without a header.

    Raises:
        InputError: there is no stream, or it is damaged.
    """
    run = (path / "result.json").exists()
    store = path / STREAM if run else path
    file = form_of(store) if store.is_dir() else store
    as_opened = identity(file)
    if not run:
        stream, notes = open_any(path, size)
        if isinstance(stream, ZarrStream):
            stream.kept = _KEPT
        return Opened(path.name, stream, 1.0, PLAYED, None, notes, file, as_opened)
    if not (path / STREAM).exists():
        frames = (path / "frames.zarr").exists()
        raise InputError(
            "the run", f"one with {STREAM}", "one of frames" if frames else "without",
            f"explore its frames in {path / 'report.html'}" if frames
            else "run it again without --store none",
        )  # fmt: skip
    result = read_result(path)
    found = ZarrStream(path / STREAM, kept=_KEPT)
    white = None if result is None else result.metrics.get("white_rate")
    rate = white.value if white is not None and white.value else 1.0
    return Opened(path.name, found, rate, PLAYED, None, [], file, as_opened)


def with_scene(opened: Opened, path: Path) -> Opened:
    """The same with the scene and the settings of the run in a folder, if it is one. It takes
    seconds: a clip is opened, and the planner of the camera is loaded."""
    if not (path / "result.json").exists():
        return opened
    title, window, source, told = _scene(path / "scenario.toml", opened.stream)
    return replace(opened, title=title, window=window, source=source, notes=[*opened.notes, *told])


def _scene(path: Path, stream: SpikeStream) -> tuple[str, int, Source | None, list[str]]:
    """Title, window of TFP and scene of a run, and a note where the true light is missing."""
    from scenarios.assemble.schema.loading import filmed, load
    from scenarios.assemble.source.latched.setup import set_up_camera

    try:
        scenario = filmed(load(str(path))[1], "view")
        setup = set_up_camera(scenario, "numba")
        source = setup.source()
    except InputError as exc:
        why = "the run has no scene" if "[scene]" in str(exc) else str(exc)
        return path.parent.name, PLAYED, None, [f"without true light: {why}"]
    if setup.mosaic is not None or setup.shape != stream.shape:
        note = "without true light: that of a colour filter array is not shown"
        return scenario.title, scenario.image.window, None, [note]
    return scenario.title, scenario.image.window, source, []
