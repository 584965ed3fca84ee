"""The near end of a link: the stream becomes packets, which wait until the panel has room."""

from __future__ import annotations

from typing import Protocol

from cosim.spikes.viform import Viform
from cosim.stage import Block, State
from link.coding.stream_boxes import StreamOutbox
from link.sending import Transmission
from link.setup.stream import StreamSetup


class PacketSender(Protocol):
    """A coder and its send buffer."""

    def put(self, data: Viform) -> None:
        """Codes the next block. A packet can be sent from the end of its last cycle on."""
        ...

    def pop(self, before: int) -> bytes | None:
        """The next packet that can be sent from cycle `before` on or earlier; None for none."""
        ...

    def state(self) -> State: ...
    def restore(self, state: State) -> None: ...


class NearEnd:
    """Coder, send buffer and the panel's frames: a stage after the camera, and the source of what
    the panel shows.

    Args:
        sender: coder and buffer.
        setup: the link.

    Attributes:
        sent: the transmission, which takes packets as the panel needs them.
    """

    def __init__(self, sender: PacketSender, setup: StreamSetup) -> None:
        self.sender, self._setup = sender, setup
        self._outbox = StreamOutbox(setup.form, setup.blocks, self._ready)
        self.sent = Transmission(setup.mode, self._outbox)

    def _ready(self, block: int) -> bytes | None:
        return self.sender.pop(self._setup.made_at(block))

    def step(self, data: Viform | None, block: Block) -> Viform | None:
        """Codes a block of the stream; None before and after it."""
        if data is not None:
            self.sender.put(data)
        return data

    def state(self) -> State:
        return {
            f"{name}/{key}": value
            for name, part in self._parts().items()
            for key, value in part.state().items()
        }

    def restore(self, state: State) -> None:
        for name, part in self._parts().items():
            prefix = f"{name}/"
            part.restore(
                {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            )

    def _parts(self) -> dict[str, PacketSender | StreamOutbox | Transmission]:
        return {"sender": self.sender, "outbox": self._outbox, "panel": self.sent}
