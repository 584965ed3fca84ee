"""A link that carries a stream of packets, which are made while it runs.

The panel begins with the training, so the link starts some camera cycles before the stream. Then it
sends block after block, whether packets are ready or not. The frames of a block are made ASSEMBLY
ticks before the block is shown.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim import InputError
from cosim.compute.opencl import choose_device
from cosim.run.progress import Progress
from cosim.stage import BLOCK
from link.coding import Blocks
from link.coding.stream_boxes import StreamOutbox, stream_blocks, stream_rate
from link.layout import TRAINING, Layout
from link.section import LinkScenario
from link.sending import FileTransmission, Transmission
from link.setting import LEAD, TAIL, link_setting, steering_of
from link.setup.setup import LinkSetup, choose_link
from sensor import CameraSetting

ASSEMBLY: Final = 4
"""Camera cycles before the first light of a block, at which its frames are made: the sender needs
time to code them."""
_READ: Final = 3
"""Camera cycles from the end of a block's light until the receiver has its last row."""
_WHOLE: Final = 1
"""Camera cycle to which the begin of a block is rounded."""
_MOST_LOST: Final = 1e-6
"""Share of frames that a mode may be foreseen to lose. A stream has no fountain: a lost frame
damages some ten packets, and at 8 Gbit/s there are 66 000 frames a second."""
_STAND_IN: Final = 64
"""Symbols after the training that the check of the plan films."""


@dataclass(frozen=True)
class StreamSetup(LinkSetup):
    """A link for a stream, before it is planned. `sent` is a stand-in of random data of the same
    mode, for the check of the plan.

    Attributes:
        scenario: the scenario.
        form: form of the blocks.
        blocks: number of blocks.
        lead: camera cycles from the start of the link to cycle 0 of the stream.
    """

    scenario: LinkScenario
    form: Blocks
    blocks: int
    lead: int

    @property
    def symbols(self) -> int:
        layout = self.form.layout
        return TRAINING + self.blocks * self.form.groups * layout.group + layout.closing

    @property
    def block_planes(self) -> int:
        """Panel planes of a block."""
        return self.form.groups * self.form.layout.group * self.mode.ticks

    @property
    def block_cycles(self) -> float:
        """Camera cycles of a block."""
        return self.block_planes * self.setting.camera.clock.hz / self.setting.panel.clock.hz

    @property
    def rate(self) -> float:
        """Bits of packets that the link carries in a camera cycle."""
        return 8 * stream_rate(self.form) / self.block_cycles

    def spent(self) -> dict[str, float]:
        """Bits of a camera cycle that each part of the format takes; with `rate` they add up to all
        cells in all symbols. Training and closing symbols, once in a transmission, are not
        counted."""
        form, layout = self.form, self.form.layout
        symbols = form.groups * layout.group
        pilots, data = int(layout.pilot.sum()), layout.cells
        coded = 8 * form.groups * form.group_bytes
        words = 8 * form.word_bytes * form.frames * form.frame_words
        frames = 8 * form.frames * form.frame_bytes
        spent = {
            "tags and their surroundings": (math.prod(layout.shape) - pilots - data) * symbols,
            "pilots": pilots * symbols,
            f"line code {self.mode.line}": data * symbols - coded,
            "cells that fill no frame": coded - words,
            f"parity of {self.mode.word_code}": words - frames,
            "heads and checksums of frames": frames - 8 * stream_rate(form),
        }
        return {name: bits / self.block_cycles for name, bits in spent.items()}

    @property
    def delay(self) -> int:
        """Largest delay of a packet from the instant at which its last bit leaves a send buffer of
        the link's rate until it arrives, in camera cycles.

        A block takes at its begin what the link carries until the next one, so after a block no
        more waits than in the buffer. A packet just misses a block, and its own ends as much
        later."""
        return _delay(self.block_cycles)

    def first_cycle(self, block: int) -> int:
        """Camera cycle, of the link, in which the first light of a block begins."""
        setting = self.setting
        plane = (TRAINING * self.mode.ticks) + block * self.block_planes
        return setting.camera.clock.cycle_at(setting.first_light + setting.panel.clock.edge(plane))

    def block_until(self, tick: int) -> int:
        """Block whose light ends nearest to a cycle of the link."""
        return round((tick - self.first_cycle(0)) / self.block_cycles) - 1

    def made_at(self, block: int) -> int:
        """Cycle of the stream before which a packet must be complete to be sent in a block."""
        return self.first_cycle(block) - ASSEMBLY - self.lead

    def transmission(self, ready: Callable[[int], bytes | None]) -> Transmission:
        """Transmission. ready: see `StreamOutbox`."""
        return Transmission(self.mode, StreamOutbox(self.form, self.blocks, ready))


def _delay(block_cycles: float) -> int:
    """See `StreamSetup.delay`."""
    return ASSEMBLY + math.ceil(2 * block_cycles) + _READ + _WHOLE


def set_up_stream(
    scenario: LinkScenario, camera: CameraSetting, device: str | None, progress: Progress,
    cycles: int, hold: Callable[[float], int],
) -> StreamSetup:  # fmt: skip
    """Checks a link and chooses its mode.

    Args:
        scenario: a scenario of the link's section, its camera and its seed; the file and the
            duration are not read.
        camera: camera of the link, with every effect.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: progress of the pilots.
        cycles: length of the stream, camera cycles.
        hold: camera cycles that the stream waits before the link, of the bits that the link carries
            in a cycle.

    Raises:
        InputError: if the link cannot be simulated.
    """
    setting, opened = link_setting(scenario, camera), choose_device(device)
    # The mode is chosen for a long transmission: one second of the panel's raw bits at the most.
    size = round(setting.panel.clock.hz * math.prod(setting.panel.shape) / 64)
    chosen = choose_link(
        scenario.link.modem, setting, steering_of(scenario.sensor), scenario.tolerance, size,
        opened, progress, adaptive=False, keeps=True, most_lost=_MOST_LOST,
    )  # fmt: skip
    setting, mode = chosen.setting, chosen.mode
    layout = Layout(mode)
    try:
        form = stream_blocks(layout, scenario.link.modem.interleave)
        _ = form.frames
    except ValueError as exc:
        raise InputError(
            "link.modem", "a mode that the panel has room for", str(exc),
            "take smaller cells or a larger panel",
        ) from exc  # fmt: skip
    clock, panel = setting.camera.clock, setting.panel.clock
    trained = clock.cycle_at(setting.first_light + panel.edge(TRAINING * mode.ticks))
    lead = -(-(max(trained, LEAD) + ASSEMBLY) // BLOCK) * BLOCK
    planes = form.groups * layout.group * mode.ticks
    wait = hold(8 * stream_rate(form) * panel.hz / clock.hz / planes)
    wait += _delay(planes * clock.hz / panel.hz)
    length = (lead + cycles + wait) * panel.hz / clock.hz
    blocks = max(math.ceil((length - TRAINING * mode.ticks) / planes), 1)
    rng = np.random.Generator(np.random.Philox(key=scenario.seed))
    groups = -(-_STAND_IN // layout.group)
    stand_in = FileTransmission(
        mode, rng.bytes(layout.group_bytes(groups)), "stand-in",
        most_symbols=TRAINING + groups * layout.group,
    )  # fmt: skip
    late = clock.edge(lead)  # the spans of the scenario begin with the stream
    blocked = tuple((low + late, high + late) for low, high in setting.aim.blocked)
    setting = replace(setting, aim=replace(setting.aim, blocked=blocked))
    whole = TRAINING + blocks * form.groups * layout.group + layout.closing
    setting, lock = chosen.held(whole * mode.ticks, progress, setting)
    dark = setting.first_light + panel.edge(whole * mode.ticks)
    ticks = clock.cycle_at(dark) + 1 + TAIL
    return StreamSetup(chosen, setting, stand_in, ticks, lock, scenario, form, blocks, lead)
