"""The receiver at a run's recording: it knows nothing but the spikes."""

from __future__ import annotations

import time
from typing import Any

from cosim import BLOCK, SpikeStream, Viform
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD, words_for
from cosim.stage import blocks
from link.receiving import Receiver
from link.run.prepare import PreparedLink

__all__ = ["receive_stream"]


def receive_stream(
    run: PreparedLink, stream: SpikeStream, seconds: dict[str, float], progress: Progress
) -> Any:
    """What the receiver makes of a recording. Of the run only its settings of the receiver are
    used."""
    begin = time.perf_counter()
    modem = run.scenario.link.modem
    receiver = Receiver(stream.shape, detector=modem.detector, interleave=modem.interleave)
    progress.start("receiver", stream.cycles)
    for block in blocks(stream.cycles, BLOCK):
        words = stream.read_words(block.start // WORD, words_for(block.stop))
        receiver.step(Viform(words, block.cycles, stream.clock, block.start), block)
        progress.advance(block.stop)
    received = receiver.finish()
    seconds["receiver"] = time.perf_counter() - begin
    return received
