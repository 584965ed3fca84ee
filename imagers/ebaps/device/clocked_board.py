"""The board clock by clock in a run: converter's lines, memory, second FPGA, Camera Link.

The values of a frame pass the converter's lines (`adc_lines`) and are written to their region
through FIFO and AXI4 while the frame before, which is in the live region, is read with the four
darks (`crossing`). The difference goes to the slave FPGA (`handshake`) and over Camera Link
(`cameralink`) to the host. Assumed: a frame is read while the next one is written, which is the way
of a memory with one live region; the pixels follow one another without the gaps between rows, as
within a row of the whole chip; on the link the frame is the upper left corner of the chip's, whose
other pixels are 0. A converter at 80 MS/s takes two samples of a pixel at 40 MHz; the second, which
has settled, counts.

The run goes on with what is in the memory. What a clock is too slow for is counted and reported
(`faults`), and the frames are what such a board would give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from imagers.ebaps.board.adc_lines import AdcLines, Alignment
from imagers.ebaps.board.cameralink import (
    DVAL,
    LINK_HZ,
    LinkTiming,
    deserialise,
    frame_words,
    read_frames,
    serialise,
)
from imagers.ebaps.board.crossing import Clocks, Path, Transfer, transfer
from imagers.ebaps.board.handshake import HandOver, hand_over
from imagers.ebaps.board.memory import BurstMemory
from imagers.ebaps.board.timing import LIVE, Timing
from imagers.ebaps.device.exposure import DARKS, mean_of_four, subtract

Image = npt.NDArray[np.uint16]
SAMPLES_A_PIXEL = 2
"""80 MS/s at a pixel clock of 40 MHz: document 002."""
_LINES_AT_ONCE = 64
"""Lines of a frame that are serialised together."""


@dataclass(frozen=True)
class Sent:
    """A live frame that waits in the memory for its way to the host.

    Attributes:
        image: (H, W) as the host has to receive it.
        darks: whether the mean of four dark frames was subtracted.
        pedestal: DN.
    """

    image: Image
    darks: bool
    pedestal: int


@dataclass
class BoardFigures:
    """What the clocked frames have shown.

    Attributes:
        alignment: alignment of the converter's lines.
        untrained: share of the first clocked frame's values that would be wrong without training.
        bits, bit_errors, expected_errors: counts of the samples; the last by the closed form.
        transfers: through the memory, in order.
        hand_overs: hand-overs to the slave FPGA.
        delivered: frames that the host received.
        wrong: pixels that differ from the frame that was sent, of lost frames all.
        pixels: pixels of the frames sent.
        link_clocks, link_pixels: words of the frames on the link, and those with a pixel.
    """

    alignment: Alignment | None = None
    untrained: float = 0.0
    bits: int = 0
    bit_errors: int = 0
    expected_errors: float = 0.0
    transfers: list[Transfer] = field(default_factory=list)
    hand_overs: list[HandOver] = field(default_factory=list)
    delivered: int = 0
    wrong: int = 0
    pixels: int = 0
    link_clocks: int = 0
    link_pixels: int = 0

    @property
    def reading(self) -> list[float]:
        """Values a second of each frame that was read."""
        return [
            (image.size - 1) * PS / (t.shown[1] - t.shown[0])
            for t in self.transfers
            for image in list(t.frames.values())[:1]
            if t.shown[1] > t.shown[0]
        ]


class Board:
    """See `FrameMemory`: the first frames pass clock by clock, the others are copied by bursts.

    Args:
        frames: live frames that are delivered clock by clock, with the dark frames before them.
        lines: lines of the converter.
        clocks: clocks of pixels, memory and link; the last is also the master FPGA's.
        timing: timing of the sensor; the link carries its whole frame.
        stall: share of the memory's clocks in which it is not ready.
        depth: words of a FIFO.
    """

    def __init__(
        self, frames: int, lines: AdcLines, clocks: Clocks | None = None, *,
        timing: Timing | None = None, stall: float = 0.0, depth: int = Path().depth,
    ) -> None:  # fmt: skip
        self.frames, self.lines, self.clocks = frames, lines, clocks or Clocks()
        self.timing = Timing() if timing is None else timing
        self.memory = BurstMemory()
        self.figures = BoardFigures()
        self._path = Path(clocks=self.clocks, stall=stall, depth=depth)
        self._seed = self._count = 0
        self._waiting: Sent | None = None

    @property
    def clocked(self) -> bool:
        """Whether the next frame passes clock by clock."""
        return self.figures.delivered < self.frames

    def seed(self, seed: int) -> None:
        """Sets the seed of jitter, stalls and synchronisers."""
        self._seed = seed
        self._path = replace(self._path, seed=seed)

    def store(self, region: int, frame: Image) -> None:
        """See `FrameMemory`. The live frame that waits is delivered meanwhile."""
        if not self.clocked:
            self.memory.store(region, frame)
            return
        values = self._converted(frame)
        self.memory.claim(region, values)
        waiting, self._waiting = self._waiting, None
        regions = [] if waiting is None else [*range(DARKS), LIVE] if waiting.darks else [LIVE]
        shape = (values.shape[0], values.shape[1])
        done = transfer(
            self.memory.ddr, self._path, write=(region, values),
            read=(regions, shape) if regions else None,
        )  # fmt: skip
        self._path = replace(self._path, seed=self._path.seed + 1)
        self.figures.transfers.append(done)
        if waiting is not None:
            self._deliver(waiting, done)

    def read(self, region: int) -> Image:
        """See `FrameMemory`."""
        return self.memory.read(region)

    def sends(self, sent: Sent) -> None:
        """The live frame in the memory has to reach the host like this."""
        self._waiting = sent if self.clocked else None

    def _converted(self, frame: Image) -> Image:
        """The values behind the converter's lines, which are trained before the first frame."""
        figures, lines = self.figures, self.lines
        first = figures.alignment is None
        alignment = figures.alignment or lines.train(self._seed)
        figures.alignment = alignment
        samples = np.repeat(frame.ravel(), SAMPLES_A_PIXEL)
        got = lines.receive(samples, alignment, self._count, self._seed)
        if first:
            raw = lines.receive(samples, lines.untrained(), self._count, self._seed)
            figures.untrained = float(np.mean(raw != samples))
        self._count += 1
        figures.bits += 16 * samples.size
        figures.bit_errors += int(np.bitwise_count(got ^ samples).sum())
        figures.expected_errors += lines.expected_errors(samples, alignment)
        return np.ascontiguousarray(got[SAMPLES_A_PIXEL - 1 :: SAMPLES_A_PIXEL]).reshape(
            frame.shape
        )

    def _deliver(self, sent: Sent, done: Transfer) -> None:
        figures = self.figures
        figures.delivered += 1
        figures.pixels += sent.image.size
        got = self._received(sent, done) if done.frames else None
        wrong = sent.image.size if got is None else int(np.count_nonzero(got != sent.image))
        figures.wrong += wrong

    def _received(self, sent: Sent, done: Transfer) -> Image | None:
        """The frame at the host; None if it is lost on its way."""
        shown = done.frames[LIVE]
        if sent.darks:
            darks = mean_of_four([done.frames[n] for n in range(DARKS)])
            shown = subtract(shown, darks, sent.pedestal)
        over = hand_over(
            shown, self.clocks.display, self.clocks.display, phase_ps=1 + self._seed % 9973,
            seed=self._seed,
        )  # fmt: skip
        self.figures.hand_overs.append(over)
        timing = self.link
        if over.image is None or timing is None:
            return None
        return self._over_link(over.image, timing)

    @property
    def link(self) -> LinkTiming | None:
        """Timing of Camera Link; None if its clock is too slow for the frames."""
        t = self.timing
        try:
            return LinkTiming(t.columns, t.rows, self.clocks.display, t.rate)
        except ValueError:
            return None

    def _over_link(self, image: Image, timing: LinkTiming) -> Image:
        rows, columns = image.shape
        whole = np.zeros((timing.rows, timing.columns), np.uint16)
        whole[:rows, :columns] = image
        words = list(frame_words(whole, timing))
        parts = [np.zeros(1, np.uint32)]  # FVAL low: the receiver waits for its rise
        for n in range(0, len(words), _LINES_AT_ONCE):
            part = deserialise(serialise(np.concatenate(words[n : n + _LINES_AT_ONCE])))
            self.figures.link_clocks += part.size
            self.figures.link_pixels += int(np.count_nonzero(part >> np.uint32(DVAL) & 1))
            parts.append(part)
        (got,) = read_frames(parts, timing.columns, timing.rows)
        return got[:rows, :columns]

    @property
    def faults(self) -> list[str]:
        """What went wrong, a line each; [] if every frame arrived bit for bit in time."""
        f, need = self.figures, LinkTiming(self.timing.columns, self.timing.rows, LINK_HZ)
        found: list[str] = []
        if f.alignment is not None and not f.alignment.found:
            lost = np.flatnonzero(f.alignment.eyes == 0).tolist()
            found.append(f"the training of the converter's lines found no eye on {_listed(lost)}")
        if f.bit_errors:
            found.append(f"{f.bit_errors} of {f.bits} bits from the converter are wrong")
        lost_words = sum(t.overflows for t in f.transfers)
        if lost_words:
            found.append(
                f"the write FIFO overflowed {lost_words} times: a memory clock of "
                f"{self.clocks.memory * 1e-6:g} MHz, or its stalls, are too slow for the pixels"
            )
        broken = [line for t in f.transfers for line in t.faults]
        if broken:
            found.append(f"{len(broken)} violations of AXI4, the first: {broken[0]}")
        slow = min(f.reading, default=need.pixel_rate)
        if slow < need.pixel_rate and self.link is not None:
            found.append(
                f"the memory gives {slow * 1e-6:.3g} Mpixel/s, less than the "
                f"{need.pixel_rate * 1e-6:.3g} Mpixel/s of {need.rate} frames/s"
            )
        if self.link is None:
            least = (self.timing.columns + 1) * self.timing.rows * self.timing.rate
            found.append(
                f"a link clock of {self.clocks.display * 1e-6:g} MHz is too slow: "
                f"{need.rate} frames/s need {least * 1e-6:.4g} MHz"
            )
        if f.delivered < self.frames:
            found.append(
                f"{f.delivered} of {self.frames} frames went through the board: lengthen duration"
            )
        if f.wrong:
            found.append(f"{f.wrong} of {f.pixels} pixels did not arrive as they were sent")
        return found


def _listed(lines: Sequence[int]) -> str:
    return ("line " if len(lines) == 1 else "lines ") + ", ".join(map(str, lines))
