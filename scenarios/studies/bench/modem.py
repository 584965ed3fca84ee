"""The modem of light-link: from a file to panel words, and from spikes to the file.

The spikes are those of the shipped scenario, filmed through its air by its camera with the clock
locked to the panel, in the mode that a run chooses for a file of this size: scrambled symbols of
one tick, words of soft decisions. The receiver is that of a run. Acquisition, once a transmission,
has rows of its own; what `link.modem` times is the rest, from spikes to the checked file:
detection, tracking of the clock, collecting, decoding, CRCs and the fountain code. The plain
implementation is the joint detector and the words' decoder in numpy.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.timing import REAL_TIME, TimingRow, least_of
from cosim.spikes.viform import WORD, Viform, Words
from link.coding import Inbox, SoftBlocks, blocks_of
from link.coding.ldpc import ROUNDS
from link.coding.ldpc_decoding import decode_in_numpy
from link.detect.catalogue import make_detector
from link.detect.detector import Detector
from link.detect.joint import Joint
from link.detect.joint_numpy import soft_by_numpy
from link.layout import TRAINING
from link.mode import Mode
from link.receiving.acquiring import Acquired, acquire
from link.receiving.recording import Recording
from link.receiving.session import Session
from link.sending import FileTransmission
from link.setting import LinkSetting, link_setting
from link.setup.pilot import film_words
from link.timing import Registration
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load

BYTES: Final = 4_000_000
"""Bytes of the file."""
RATE: Final = 0.935
"""Rate of the words: what a run chooses for such a file."""
SETS: Final = ("link.panel.phase=0", "link.panel.clock_offset=0")
"""Keys of light-link, by which the clock is locked from the start."""
TURNS: Final = 5
PLAIN_WORDS: Final = 8
"""Words that the plain decoder decodes."""
_CELL, _TICKS, _SEED = 2, 1, 1


@dataclass(frozen=True, eq=False)
class Filmed:
    """A transmission of a file, and its spikes.

    Attributes:
        setting: setting of the link.
        data: the file.
        sent: the transmission.
        words: (n, height, width) uint32 spikes, bit 0 of word 0 tick 0.
    """

    setting: LinkSetting
    data: bytes
    sent: FileTransmission
    words: Words

    @property
    def symbols(self) -> int:
        """Symbols that carry data."""
        return self.sent.data_end - TRAINING

    def recording(self) -> Recording:
        """Spikes as a receiver stores them."""
        out = Recording(self.words.shape[1:])
        out.add(Viform(self.words, len(self.words) * WORD, self.setting.camera.clock))
        return out

    @cached_property
    def acquired(self) -> Acquired:
        """The transmission, located and timed by the receiver."""
        _, acquired = acquire(self.recording())
        assert acquired is not None
        return acquired

    def detector(self, name: str) -> Detector:
        """A detector that has learned from the training."""
        refined = self.acquired.refined
        place = Registration(refined.homography, np.zeros((0, 3)), refined.blur)
        made = make_detector(name, self.sent.layout, place, self.acquired.timing)
        made.learn(self.words, 0, self.sent.bits(0, TRAINING), 0)
        return made


def film_link(device: Device | None) -> Filmed:
    """Films a random file with the shipped link."""
    scenario = linked(load("light-link", [*SETS])[1], "bench link")
    setting = link_setting(scenario, camera_setting(scenario))
    height, width = setting.panel.shape
    mode = Mode(width, height, _CELL, _TICKS, "scrambled", None, RATE)
    data = np.random.Generator(np.random.Philox(key=_SEED)).bytes(BYTES)
    sent = FileTransmission(mode, data, "bench")
    words, _, _ = film_words(setting, sent, device)
    return Filmed(setting, data, sent, words)


def receive(filmed: Filmed, device: Device | None) -> tuple[float, float, float, float]:
    """Receives the file. Returns the wall time of the acquisition, of the learning that precedes
    the first data, and of all data, and the processor time of the data, s.

    Raises:
        RuntimeError: unless the file arrives.
    """
    recording, marks = filmed.recording(), [time.perf_counter()]
    _, acquired = acquire(recording)
    assert acquired is not None
    marks.append(time.perf_counter())
    inbox = Inbox(acquired.layout, device=device)
    session = Session(acquired, "packed", inbox, recording.shape)
    section = session.begin(recording)
    assert section is not None
    marks.append(time.perf_counter())
    busy = time.process_time()
    session.decode(recording, section)
    busy = time.process_time() - busy
    marks.append(time.perf_counter())
    if inbox.file is None or inbox.file.data != filmed.data:
        raise RuntimeError("the file of the benchmark did not arrive")
    first, second, third = np.diff(marks).tolist()
    return first, second, third, busy


def _plain(filmed: Filmed) -> float:
    """Wall time of a file's bit in the plain way, s: detection of a block, and decoding of
    PLAIN_WORDS of its words."""
    layout, form = filmed.sent.layout, blocks_of(filmed.sent.layout)
    assert isinstance(form, SoftBlocks)
    joint = filmed.detector("joint")
    assert isinstance(joint, Joint)
    block = form.groups * layout.group
    begin = time.perf_counter()
    soft = soft_by_numpy(joint, filmed.words, 0, TRAINING, block)
    spent = (time.perf_counter() - begin) / block * filmed.symbols
    row = np.zeros((form.groups, layout.group, layout.cells), np.int8)
    for n, group in enumerate(soft.reshape(row.shape)):
        form.store(group, n, row[n])
    some = form.collect(row)[:PLAIN_WORDS]
    begin = time.perf_counter()
    decode_in_numpy(form.code, some, ROUNDS)
    spent += (time.perf_counter() - begin) / len(some) * form.words * filmed.symbols / block
    return spent / (8 * len(filmed.data))


def _send(filmed: Filmed) -> int:
    """Makes all panel words of the file."""
    sent = FileTransmission(filmed.sent.mode, filmed.data, "bench")
    planes = 0
    for first in range(0, sent.planes, WORD):
        planes += len(sent.words(first, min(WORD, sent.planes - first)))
    return planes


def modem_rows(filmed: Filmed, device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """The rows `link.modem`, of the receiver and of the sender, and `link.acquisition`. "A core"
    is over processor time, which depends less on other load.

    Args:
        filmed: the file and its spikes.
        device: OpenCL device of the words' decoder; None for the compiled form.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    bits, cells = 8 * len(filmed.data), filmed.sent.layout.cells
    turns = [receive(filmed, device) for _ in range(TURNS + 1)][1:]
    found, learned, data, busy = (min(each) for each in zip(*turns, strict=True))
    whole = min(sum(each[:3]) for each in turns)
    send = least_of([lambda: _send(filmed)], 1)[0]
    pixels = filmed.words[0].size * filmed.symbols * _TICKS
    simulated = filmed.symbols * _TICKS / REAL_TIME
    plain = _plain(filmed)

    def row(what: str, spent: float, *ratios: float | None) -> TimingRow:
        tier = f"{what}, {cells} cells"
        return TimingRow("link.modem", tier, bits / spent, "bit/s", simulated / spent, *ratios)

    return [
        row("receive", data, pixels / data / ceiling if ceiling else None, plain * bits / data),
        row("receive, a core", busy, None, None),
        row("receive with acquisition", whole, None, None),
        row("send", send, None, None),
        TimingRow("link.acquisition", "find and time", found, "s", None, None, None),
        TimingRow("link.acquisition", "learn", learned, "s", None, None, None),
    ]
