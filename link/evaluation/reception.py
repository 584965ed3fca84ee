"""The receiver on a run's recording: its only input is the spikes."""

from __future__ import annotations

from cosim import BLOCK, SpikeStream, Viform
from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD, words_for
from cosim.stage import blocks
from link.receiving import Received, Receiver
from link.section import ModemSection

__all__ = ["receive_stream"]


def receive_stream(
    stream: SpikeStream, modem: ModemSection, device: Device | None, progress: Progress
) -> Received:
    """Returns the result of the receiver on a recording.

    Args:
        stream: the recording.
        modem: settings of the receiver.
        device: OpenCL device of the run, None for the compiled form.
        progress: of the receiver.
    """
    receiver = Receiver(
        stream.shape, detector=modem.detector, interleave=modem.interleave, device=device,
        progress=progress,
    )  # fmt: skip
    progress.start("receiver", stream.cycles)
    for block in blocks(stream.cycles, BLOCK):
        words = stream.read_words(block.start // WORD, words_for(block.stop))
        receiver.step(Viform(words, block.cycles, stream.clock, block.start), block)
    received = receiver.finish()
    progress.advance(stream.cycles)
    return received
