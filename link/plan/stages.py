"""What the run of a link takes and carries, and its run time by stages, predicted on this device.

The set-up of a plan is that of a run: its pilots and its phase lock are timed as they are. The
first blocks of the run are filmed, and the receiver reads them; light, pixels, detector and decoder
then take as much time for each of the other blocks. The check of the plan is timed on fewer
symbols. What does not depend on the conditions of the link (figures, closed forms, the count of
errors) comes from a table.

Two times are predicted. The processor time of all threads does not depend on what else the machine
does. The time on the clock assumes that its processors are free: stages that run side by side take
as long as the longest of them, or as their processor time over the number of processors if that is
more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS, Viform
from cosim.compute.cores import cores
from cosim.plan.study import Spell, timed
from cosim.spikes.viform import words_for
from link.coding import Inbox
from link.layout import TRAINING, Layout
from link.prediction.rates import Rates, link_rates
from link.receiving import Receiver
from link.setup.distances import OTHERS
from link.setup.modes import tag_warning
from link.setup.setup import FileLinkSetup
from link.setup.truth import panel_in_view

PROGRAM: Final = 1.2
"""Start of the program and its libraries, s."""
CLOSED_FORM: Final = 1.7
"""`closed_form`, s: its draws are of one number."""
RECORDER: Final = 0.8, 4e-4
"""The recording, s, and s for a cycle."""
EYE: Final = 1.2, 1e-3
"""`open_eye`, s, and s for a cycle whose spikes it reads."""
ERRORS: Final = 7e-9
"""The count of wrong decisions, which sends the file again, s for a cell and symbol."""
SOFT: Final = 0.6
"""The sample of soft values beside what was sent, and the smaller figures of merit, s."""
REPORT: Final = 1.8
"""Figures and page, s."""
ELSEWHERE: Final = 0.9
"""The choice of a mode at another distance, s: 1.6 pilots of a strip in the mean."""
# They were measured in runs of 4 and 64 MB of `light-link`, as processor time of their threads
# (two shared cores of an EPYC 9004); a machine of another speed takes another time for all.
_SEARCH: Final = 1024
"""Ticks after which a receiver without a transmission searches again."""
_TOGETHER: Final = (
    ("air", "sensor", "recorder", "check on patches"),
    ("receiver", "closed form"),
    ("eye", "errors"),
)
"""Stages that run side by side, by the begin of their names. Parts of one stage follow each
other."""


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


@dataclass(frozen=True)
class StageTime:
    """Predicted time of a stage.

    Attributes:
        stage: its name.
        amount, unit: what it works on.
        wall_s, processor_s: its time.
    """

    stage: str
    amount: float
    unit: str
    wall_s: float
    processor_s: float

    @classmethod
    def of(cls, stage: str, amount: float, unit: str, each: Spell) -> StageTime:
        return cls(stage, amount, unit, each.wall, each.processor)


class _TimedInbox(Inbox):
    """An inbox that knows when its groups came, and what it took to read them.

    Attributes:
        first: time at which the first group came, on both clocks; None before.
        read: time of every group.
    """

    def __init__(self, layout: Layout, **options: Any) -> None:
        super().__init__(layout, **options)
        self.first: Spell | None = None
        self.read: list[Spell] = []

    def put(self, group: int, soft: npt.NDArray[np.float32]) -> int:
        if self.first is None:
            self.first = Spell.now()
        with timed(self.read):
            return super().put(group, soft)


def receiver_times(
    setup: FileLinkSetup, recorded: Sequence[Viform], todo: Amounts
) -> list[StageTime]:
    """Times of the receiver's stages: the receiver reads the first blocks of the run.

    Args:
        setup: the link.
        recorded: the blocks, in order.
        todo: the run.
    """
    modem, made = setup.modem, []

    def inbox(layout: Layout) -> Inbox:
        made.append(_TimedInbox(layout, interleave=modem.interleave, device=setup.device))
        return made[-1]

    receiver = Receiver(
        recorded[0].shape, detector=modem.detector, interleave=modem.interleave,
        device=setup.device, inbox=inbox,
    )  # fmt: skip
    begin = Spell.now()
    for block in recorded:
        receiver.step(block)
    receiver.finish()
    whole = Spell.now().since(begin)
    box = made[0] if made else None
    if box is None or box.first is None:
        searches = max(-(-todo.cycles // _SEARCH), 1)
        return [StageTime.of("receiver: search", searches, "searches", whole.times(searches))]
    found = box.first.since(begin)
    decoded = Spell(sum(one.wall for one in box.read), sum(one.processor for one in box.read))
    detected = Spell(
        max(whole.wall - found.wall - decoded.wall, 0.0),
        max(whole.processor - found.processor - decoded.processor, 0.0),
    )
    symbols = len(box.read) * box.layout.group
    more = todo.data_symbols / symbols
    return [
        StageTime.of("receiver: acquisition and learning", 1, "transmissions", found),
        StageTime.of("receiver: detector", todo.data_symbols, "symbols", detected.times(more)),
        StageTime.of("receiver: decoder", todo.words, "words", decoded.times(more)),
    ]


def recorder_time(todo: Amounts) -> StageTime:
    """Time of the recording's file."""
    seconds = RECORDER[0] + RECORDER[1] * todo.cycles
    return StageTime("recorder", todo.stream_bytes, "bytes", seconds, seconds)


def evaluation_times(setup: FileLinkSetup, todo: Amounts, arrives: bool) -> list[StageTime]:
    """Times of the closed form, of the figures of merit and of the report. arrives: whether data
    are predicted to be read, which they are computed from."""
    others = 0 if setup.mode_given else OTHERS
    bits = todo.data_symbols * setup.sent.layout.cells if arrives else 0

    def row(stage: str, amount: float, unit: str, seconds: float) -> StageTime:
        return StageTime(stage, amount, unit, seconds, seconds)

    return [
        row("closed form", 1, "links", CLOSED_FORM),
        row("eye", todo.cycles, "cycles", EYE[0] + EYE[1] * todo.cycles if arrives else 0.0),
        row("errors", bits, "bits", ERRORS * bits + (SOFT if arrives else 0.0)),
        row("report", 1, "pages", REPORT),
        row("rates at other distances", others, "distances", ELSEWHERE * others),
    ]


def _wall(rows: Sequence[StageTime], processors: int) -> float:
    """Time on the clock of all stages."""
    left, total = list(rows), 0.0
    for names in _TOGETHER:
        mine = {name: [r for r in left if r.stage.startswith(name)] for name in names}
        some = [row for group in mine.values() for row in group]
        longest = max((sum(r.wall_s for r in group) for group in mine.values()), default=0.0)
        total += max(longest, sum(row.processor_s for row in some) / processors)
        left = [row for row in left if row not in some]
    return total + sum(row.wall_s for row in left)


def stage_document(
    rows: Sequence[StageTime], processors: Callable[[], int] = cores
) -> dict[str, Any]:
    """Keys of `predicted` for a run's stages and its total. processors: how many it may use."""
    return {
        "stages": [asdict(row) for row in rows],
        "total_s": _wall(rows, processors()),
        "processor_s": sum(row.processor_s for row in rows),
    }
