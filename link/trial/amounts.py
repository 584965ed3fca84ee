"""What a run of a file takes and what it carries, from its set-up: counts, without any simulation
but the pilots of the mode."""

from __future__ import annotations

from dataclasses import dataclass

from cosim import PS
from cosim.spikes.viform import words_for
from link.layout import TRAINING
from link.prediction.rates import Rates, link_rates
from link.setup.modes import tag_warning
from link.setup.setup import FileLinkSetup
from link.setup.truth import panel_in_view


@dataclass(frozen=True)
class Amounts:
    """Amounts of a run.

    Attributes:
        cycles, pixel_cycles: number of cycles of the camera, and of pixel-cycles.
        planes, symbols: number of planes and symbols of the panel, training and closing included.
        data_symbols: number of symbols that carry data.
        frames, words: number of frames and words that are sent whole.
        file_bytes: bytes of the file.
        stream_bytes: bytes of the recorded words, before they are compressed.
    """

    cycles: int
    pixel_cycles: int
    planes: int
    symbols: int
    data_symbols: int
    frames: int
    words: int
    file_bytes: int
    stream_bytes: int


def amounts(setup: FileLinkSetup) -> Amounts:
    """Amounts of a run."""
    sent, chip = setup.sent, setup.setting.camera.chip
    return Amounts(
        setup.cycles, setup.pixel_cycles, sent.planes, sent.symbols,
        max(sent.data_end - TRAINING, 0), sent.outbox.frames_by(sent.groups),
        sent.outbox.words_by(sent.groups), len(setup.payload.data),
        4 * words_for(setup.cycles) * chip.height * chip.width,
    )  # fmt: skip


def carried(setup: FileLinkSetup) -> Rates:
    """Predicted rates of a run.

    The goodput is that of the block with which enough frames have arrived. The share of frames that
    are lost is that of the pilots, 0 for a given mode. It is None where no file is predicted to
    arrive: a panel out of view, tags too small, no mode that holds, or too few frames.
    """
    return link_rates(
        setup.sent.layout,
        setup.setting.panel.clock,
        len(setup.payload.data),
        _seconds(setup),
        setup.sent.outbox.word_rate,
    )


def _seconds(setup: FileLinkSetup) -> float | None:
    """Time from first light until the file is whole, s; None if it never is."""
    setting, sent, choice = setup.setting, setup.sent, setup.choice
    if not panel_in_view(setting) or tag_warning(setting, setup.mode) is not None:
        return None
    lost = 0.0
    if choice is not None:
        if not choice.holds:
            return None
        mine = [row.frames_lost for row in choice.rows if row.mode == setup.mode]
        lost = mine[0] or 0.0
    groups = sent.outbox.groups_for(sent.outbox.frames_needed / (1 - lost))
    if groups is None or groups > sent.groups:
        return None
    planes = (TRAINING + groups * sent.layout.group) * setup.mode.ticks
    clock = setting.camera.clock
    last = clock.cycle_at(setting.first_light + setting.panel.clock.edge(planes))
    return (clock.edge(last + 1) - setting.first_light) / PS
