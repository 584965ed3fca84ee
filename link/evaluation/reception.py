"""The receiver on a run's recording, whose only input is the spikes, and the delivery of what it
received: the file, and the verdict.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from cosim import BLOCK, PS, SpikeStream, Viform
from cosim.compute.opencl import Device
from cosim.config.amounts import count
from cosim.files.atomic import atomic_write
from cosim.run.progress import Progress
from cosim.run.result import dumps
from cosim.spikes.viform import WORD, words_for
from cosim.stage import blocks
from link.mode import Modem
from link.receiving import Received, Receiver
from link.receiving.tuned import Tuned
from link.setting import Payload
from link.setup.setup import FileSetup
from link.verdict import Cause, Verdict

RECEIVED: Final = "received"
"""Folder of the received file in a run's folder."""
VERDICT: Final = "verdict.json"
"""File of the verdict in a run's folder."""


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


def judge_delivery(setup: FileSetup, received: Received) -> tuple[Verdict, bool]:
    """Verdict, and whether the file arrived as it was sent."""
    delivered = received.delivered
    if delivered is not None:
        if delivered == (setup.payload.data, setup.payload.name):
            return received.verdict, True
        text = "the receiver took other bytes for the file: nothing is handed out"
        return Verdict(Cause.NOISY, text), False
    if setup.shortened:
        text = f"{received.verdict.text}; {setup.shortened_message()}"
        return Verdict(received.verdict.cause, text), False
    if not setup.sent.sent_whole:
        return _too_large(setup, received), False
    return received.verdict, False


def _too_large(setup: FileSetup, received: Received) -> Verdict:
    """The verdict on a transmission that no receiver could have read the file from. Where nothing
    arrived for another reason, that comes first."""
    outbox, seen = setup.sent.outbox, received.verdict
    text = (
        f"the run's duration has room for {count(outbox.frames_by(setup.sent.groups))} frames, and "
        f"the file's {count(len(setup.payload.data))} bytes need {count(outbox.frames_needed)}; "
        "lengthen duration or leave it out"
    )
    if seen.cause in (Cause.TRUNCATED, Cause.NOISY):
        return Verdict(Cause.TOO_LARGE, text)
    if received.frames_right:
        return Verdict(Cause.TOO_LARGE, f"{text}; besides, {seen.cause.value}: {seen.text}")
    return Verdict(seen.cause, f"{seen.text}; besides, {text}")


def write_delivery(
    folder: Path, payload: Payload, delivered: bool, verdict: dict[str, Any]
) -> list[str]:
    """Writes the document of the verdict, and the file if it was delivered. Returns their names."""
    names = [VERDICT]
    place = folder / RECEIVED / payload.name
    for old in (folder / RECEIVED).glob("*"):
        old.unlink()
    if delivered:
        (folder / RECEIVED).mkdir(exist_ok=True)
        with atomic_write(place) as part:
            part.write_bytes(payload.data)
        names.append(f"{RECEIVED}/{payload.name}")
    with atomic_write(folder / VERDICT) as part:
        part.write_text(dumps(verdict) + "\n", encoding="utf-8")
    return names
