"""The explorer of an imager's frames, with exposure, controllers and registers of each."""

from __future__ import annotations

from cosim.report.frames import FrameColumn, frames_part
from imagers.common.kind import ImagerKind
from imagers.report.imager_run import ImagerRun

__all__ = ["frames_explorer"]

_TEXTS = {
    "exposure": "of the first row", "ready": "end of the last row's readout",
    "mean": "of all pixels",
    "spread": "standard deviation of all pixels", "full_scale": "share of pixels at full scale",
}  # fmt: skip


def frames_explorer(kind: ImagerKind, run: ImagerRun) -> str:
    """Returns the HTML of the explorer."""
    frames, registers = run.frames, run.chain.registers
    columns = [
        FrameColumn("Frame", "begin", "ms", [one.begin * 1e-9 for one in frames]),
        FrameColumn("Frame", "exposure", "ms", [one.seconds * 1e3 for one in frames]),
        FrameColumn("Frame", "ready", "ms", [one.ready * 1e-9 for one in frames]),
        FrameColumn("Frame", "mean", "DN", [one.mean for one in frames]),
        FrameColumn("Frame", "spread", "DN", [one.spread for one in frames]),
        FrameColumn("Frame", "least", "DN", [one.least for one in frames]),
        FrameColumn("Frame", "most", "DN", [one.most for one in frames]),
        FrameColumn("Frame", "full_scale", "", [one.full for one in frames]),
    ]
    for name in sorted({name for one in frames for name in one.state}):
        values = [one.state.get(name) for one in frames]
        columns.append(FrameColumn("Controller", name, "", values))
    specific = kind.design().specific if registers else ()
    texts = {"begin": "of the first row's exposure", **_TEXTS}
    for entry in specific:
        held = registers.get(entry.name)
        if held is None:
            continue
        texts[entry.name] = entry.text
        if not entry.fields:
            columns.append(FrameColumn("Registers", entry.name, "", held))
        for part in entry.fields:
            name, mask = f"{entry.name}.{part.name}", (1 << (part.high - part.low + 1)) - 1
            columns.append(
                FrameColumn("Registers", name, "", [value >> part.low & mask for value in held])
            )
            texts[name] = part.text
    explorer = frames_part(
        [one.shape for one in frames], run.frame, (1 << run.planned.pixels.bits) - 1,
        [one.number for one in frames], [one.ready * 1e-9 for one in frames], columns, texts,
    )  # fmt: skip
    about = ", and what a host reads in each register once the frame is ready" if registers else ""
    return (
        f"<h3>Frame by frame</h3><p>Each frame with its exposure, the state of its controllers"
        f"{about}. What differs from the frame before is marked. Pictures show the values as they "
        f"are.</p>{explorer}"
    )
