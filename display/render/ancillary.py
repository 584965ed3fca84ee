"""What ancillary data of a stream change in the pixels of a panel, beyond its spikes.

A write to the threshold changes the packet, the light of a spike. A pixel has its state in packets:
its balance and its emitter's level are scaled, and so is the interval that it holds, so that its
light is the same before and after. A pixel that stores more than a lowered threshold fires at once.
Neither that interval nor the next one, for which it keeps the rest, is one of its light: it goes on
with the interval that it held, half of which is taken for gone. Rows that are not read any more
begin anew, dark.

A plane of charges has what pixels without a spike have gathered. A drive that holds light takes it
for an interval: m of N levels in T planes are a rate of m/(N T). A drive of packets shows m/N of a
packet in the plane after them. Either way it is a part of the next packet: the balance has it as
emitted, and a packet is what has not been shown of it (`Drive.residue`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim.spikes.ancillary import Ancillary, ChargePlane, RegisterWrite, cuts
from cosim.spikes.viform import Words, cut_words
from display.panels.panel import SpikePanel
from display.render.golden import FOREVER

Pixels = dict[str, npt.NDArray[Any]]
"""State of pixels, as of `GoldenRenderer.pixels`."""
Mask = npt.NDArray[np.bool_]


def rescaled(pixels: Pixels, ratio: float, read: Mask) -> Pixels:
    """Pixels in packets of another size.

    Args:
        pixels: the pixels before.
        ratio: packet before over the packet after.
        read: pixels that are read from now on, (H, W).
    """
    tau = np.rint(pixels["tau"] / ratio)
    held = pixels["tau"] > 0
    out = {
        "tau": np.where(held, np.clip(tau, 1, FOREVER), 0).astype(np.uint32),
        "age": pixels["age"].copy(), "started": pixels["started"] & read,
        **{name: pixels[name] * ratio for name in ("memory", "emitted", "level")},
    }  # fmt: skip
    for name in ("tau", "age", "memory", "emitted"):
        out[name][~read] = 0
    return out


def with_held(pixels: Pixels, held: npt.NDArray[np.uint32]) -> Pixels:
    """Pixels after a plane in which those that stored a lowered threshold have fired. held: the
    interval that each of these has held until then, 0 for the others, (H, W)."""
    keeps = held > 0
    return pixels | {
        "tau": np.where(keeps, held, pixels["tau"]),
        "age": np.where(keeps, held // 2, pixels["age"]).astype(np.uint32),
    }


def with_rates(pixels: Pixels, charge: ChargePlane, gain: npt.NDArray[np.uint32]) -> Pixels:
    """Pixels of a drive that holds light, after a plane of charges.

    Args:
        pixels: the pixels before.
        charge: the plane.
        gain: its levels on the panel, (H, W).
    """
    started, out = pixels["started"], {name: each.copy() for name, each in pixels.items()}
    still = ~started | (pixels["age"] >= charge.span)
    # A pixel that has never fired is taken for one that did before the stream, and paid for it.
    new = still & ~started & (gain > 0)
    out["age"][new], out["emitted"][new] = charge.cycle, 1.0
    out["started"] = started | new
    tau = np.rint(charge.levels * charge.span / np.maximum(gain, 1))
    out["tau"] = np.where(still, np.where(gain > 0, tau, 0), out["tau"]).astype(np.uint32)
    return out


def before_packets(
    pixels: Pixels, charge: ChargePlane, gain: npt.NDArray[np.uint32], fires: Mask
) -> tuple[Pixels, Pixels, Mask]:
    """Pixels of a drive of packets before the plane that shows charges, the same after it, and
    those that are to fire in it.

    Args:
        pixels: the pixels before.
        charge: the plane of charges.
        gain: its levels on the panel, (H, W).
        fires: pixels that fire in this plane in any case, whose packet has the charge.
    """
    shown = np.clip(pixels["emitted"] - pixels["memory"], 0.0, 1.0)
    part = np.minimum(gain / charge.levels, 1.0 - shown)
    lit = (part > 0) & ~fires
    before = {name: each.copy() for name, each in pixels.items()}
    before["emitted"] = np.where(lit, pixels["memory"] + 1.0 - part, pixels["emitted"])
    after = {"emitted": part + shown + part, "memory": part}
    return before, after, lit


def with_rest(pixels: Pixels, rest: Pixels, lit: Mask) -> Pixels:
    """Pixels after the plane of charges of `before_packets`, whose second and third values are
    `rest` and `lit`."""
    return pixels | {name: np.where(lit, rest[name], pixels[name]) for name in rest}


class Pixelled(Protocol):
    """What has pixels of a panel, all of one shape: (H, W), or (pixels,)."""

    def pixels(self) -> Pixels: ...
    def put_pixels(self, state: Pixels) -> None: ...


class Follower:
    """Follows the ancillary data of a stream with the pixels of a panel.

    Args:
        target: the pixels.
        panel: the panel.
        mapping: map from words of the stream to words of the panel; None for equal sizes.
        stream: (height, width) of the stream; None for that of the panel.

    Attributes:
        packet: light of a spike, of one at the nominal threshold.
        stream: shape of the stream, as given; it may be set before the first write.
    """

    def __init__(
        self, target: Pixelled, panel: SpikePanel,
        mapping: Callable[[Words], Words] | None = None, stream: tuple[int, int] | None = None,
    ) -> None:  # fmt: skip
        self._target, self._panel, self._mapping = target, panel, mapping
        self.stream = stream or panel.shape
        self.packet = 1.0

    def parts(
        self, words: Words, cycles: int, first: int, ahead: Sequence[Ancillary]
    ) -> Iterator[tuple[Words, int, int]]:
        """Words of the panel, first plane and number of planes, each to be shown before the next
        one is asked for.

        Args:
            words: (ceil(cycles / 32), ...) uint32, in the shape of the pixels.
            cycles, first: number of planes, and the first one.
            ahead: ancillary data of these planes.
        """
        for part, begin, count, before in cuts(words, cycles, first, ahead):
            after: Callable[[Pixels], Pixels] | None = None
            for each in before:
                fires = (part[0] & np.uint32(1)) > 0
                if isinstance(each, RegisterWrite):
                    after = self._write(each, fires)
                    continue
                after, lit = self._charged(each, fires)
                if lit is not None:
                    part = part.copy()
                    part[0] |= lit.astype(np.uint32)
            if after is None:
                yield part, begin, count
                continue
            yield part[:1] & np.uint32(1), begin, 1
            self._target.put_pixels(after(self._target.pixels()))
            if count > 1:
                yield cut_words(part, 1, count), begin + 1, count - 1

    def on_panel(self, values: npt.NDArray[Any]) -> npt.NDArray[np.uint32]:
        """Values of the pixels of the stream, (H, W), on those of the panel, in their shape."""
        words = values.astype(np.uint32)[None]
        return (words if self._mapping is None else self._mapping(words))[0]

    def _write(self, write: RegisterWrite, fires: Mask) -> Callable[[Pixels], Pixels] | None:
        """Shows spikes by the registers of a write from now on. Returns what changes the pixels
        after the next plane, in which those of `fires` fire; None for nothing."""
        rows = np.zeros(self.stream, np.bool_)
        rows[slice(*write.rows)] = True
        read = self.on_panel(rows).reshape(fires.shape) > 0
        ratio, self.packet = self.packet / write.packet, write.packet
        pixels = rescaled(self._target.pixels(), ratio, read)
        self._target.put_pixels(pixels)
        if ratio <= 1 or self._panel.packets:
            return None
        return partial(with_held, held=np.where(fires, pixels["tau"], 0))

    def _charged(
        self, charge: ChargePlane, fires: Mask
    ) -> tuple[Callable[[Pixels], Pixels] | None, Mask | None]:
        """Shows a plane of charges. Returns what changes the pixels after the next plane, and those
        that are to fire in it; None for nothing."""
        gain = self.on_panel(charge.gain).reshape(fires.shape)
        pixels = self._target.pixels()
        if not self._panel.packets:
            self._target.put_pixels(with_rates(pixels, charge, gain))
            return None, None
        before, rest, lit = before_packets(pixels, charge, gain, fires)
        self._target.put_pixels(before)
        return partial(with_rest, rest=rest, lit=lit), lit
