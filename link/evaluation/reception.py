"""The receiver on a run's recording: its only input is the spikes."""

from __future__ import annotations

from cosim import BLOCK, PS, SpikeStream, Viform
from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD, words_for
from cosim.stage import blocks
from link.mode import Modem
from link.receiving import Received, Receiver
from link.receiving.tuned import Tuned
from link.setup.setup import FileSetup


def receive_stream(
    stream: SpikeStream, modem: Modem, device: Device | None, progress: Progress,
    tuned: Tuned | None = None,
) -> tuple[Received, Tuned | None]:  # fmt: skip
    """Result of the receiver on a recording, and what it knows of the link then.

    Args:
        stream: the recording.
        modem: settings of the receiver.
        device: OpenCL device of the run, None for the compiled form.
        progress: progress of the receiver.
        tuned: what the receiver knows of the link; None if it knows nothing.
    """
    receiver = Receiver(
        stream.shape, detector=modem.detector, interleave=modem.interleave, device=device,
        tuned=tuned, progress=progress,
    )  # fmt: skip
    progress.start("receiver", stream.cycles)
    for block in blocks(stream.cycles, BLOCK):
        words = stream.read_words(block.start // WORD, words_for(block.stop))
        receiver.step(Viform(words, block.cycles, stream.clock, block.start), block)
    received = receiver.finish()
    progress.advance(stream.cycles)
    return received, None if receiver.session is None else receiver.session.learned


def arrival_of(setup: FileSetup, received: Received) -> float | None:
    """Time from first light until the file was whole, s; None if it was not."""
    if received.delivered_tick is None:
        return None
    clock = setup.setting.camera.clock
    return (clock.edge(received.delivered_tick + 1) - setup.setting.first_light) / PS
