"""Packets from the spikes of a camera, with the tick of their arrival."""

from __future__ import annotations

import math
from itertools import pairwise

from cosim.compute.opencl import Device
from cosim.spikes.viform import Viform
from link.coding.stream_boxes import StreamInbox, stream_blocks
from link.layout import Layout
from link.receiving.received import Received
from link.receiving.receiver import Receiver


class PacketReceiver:
    """A receiver of a stream of packets: a stage after a camera.

    Args:
        shape: (height, width) of the camera.
        cycles: length of the recording, ticks.
        detector: its name.
        interleave: interleaving as used by the sender.
        begin: cycle from which on the receiver listens, a multiple of the blocks' length.
        device: OpenCL device of the words' decoder; None for the compiled form.

    Attributes:
        known: tick up to which all packets that arrive at all have been returned; the length of the
            recording after the last block.
        received: result of the receiver; None before the last block.
        frames_lost: frames that did not arrive between two that did.
    """

    def __init__(
        self, shape: tuple[int, int], cycles: int, *, detector: str = "packed",
        interleave: bool = True, begin: int = 0, device: Device | None = None,
    ) -> None:  # fmt: skip
        self._begin = begin
        self._inbox: StreamInbox | None = None
        self._interleave, self._cycles, self._device = interleave, cycles, device
        self._receiver = Receiver(shape, detector=detector, inbox=self._open)
        self._seen = 0
        self._ticks: dict[int, int] = {}
        self._last = 0
        self.known = -math.inf
        self.received: Received | None = None

    def _open(self, layout: Layout) -> StreamInbox:
        self._inbox = StreamInbox(layout, interleave=self._interleave, device=self._device)
        return self._inbox

    @property
    def frames_lost(self) -> int:
        return 0 if self._inbox is None else self._inbox.frames_lost

    @property
    def interruptions(self) -> list[tuple[int, int]]:
        """Spans of ticks of which no frame arrived, between two of which all did; from two blocks
        on."""
        session, inbox = self._receiver.session, self._inbox
        if session is None or inbox is None:
            return []
        layout, groups = session.layout, stream_blocks(session.layout).groups
        length = round(groups * layout.group * layout.mode.ticks)
        right = [each.tick for each in session.instants if each.right]
        return [(a, b - length) for a, b in pairwise(right) if b - a > 2 * length + 2]

    def step(self, data: Viform) -> list[tuple[int, bytes]]:
        """Takes the words of a block. Returns the packets that were decoded, with the tick at which
        the last row of their light was latched, in order."""
        if data.start >= self._begin:
            self._receiver.step(data)
        if data.start + data.cycles >= self._cycles:
            self.received = self._receiver.finish()
            self.known = float(self._cycles)
        elif self._receiver.session is not None:
            self.known = max(self.known, self._receiver.session.decoded_until)
        return self._arrived()

    def _arrived(self) -> list[tuple[int, bytes]]:
        session, inbox = self._receiver.session, self._inbox
        if session is None or inbox is None:
            return []
        for instant in session.instants[self._seen :]:
            self._ticks[instant.group] = self._last = max(instant.tick, self._last)
        self._seen = len(session.instants)
        arrivals, inbox.arrivals = inbox.arrivals, []
        return [(self._ticks.get(each.group, self._last), each.packet) for each in arrivals]
