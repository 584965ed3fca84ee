"""AXI4 of the EBAPS board's memory: bursts of a frame, bus masters, and the rules of the bus.

Document 002, section 3.2 and equation 5: address = ADDR_BIAS + offset of the region + a running
address, which increases by the length of a burst at each address handshake (AWVALID and AWREADY). A
write burst begins when prog_empty of its FIFO is low. Assumed, since not printed: beats of 128
bits, bursts of 64 beats (1 KiB, so none crosses 4 KiB if the bias is a multiple of 4 KiB), one
outstanding burst in each direction. A channel is None while its VALID is low, and its payload
otherwise.

Rules: AMBA AXI4 (ARM IHI 0022), A3.2.1 (VALID stays until READY, payload with it), A3.4.1 (1 to 256
beats, no crossing of 4 KiB, LAST with the last beat), A3.3.1 (a response follows address and data).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from imagers.ebaps.board.fifo import AsyncFifo
from imagers.ebaps.board.timing import REGIONS, region_bytes

BEAT_BYTES = 16
"""128 bits, as the memory interface gives them: assumed."""
BURST_BEATS = 64
"""Beats of a burst: assumed."""
LONGEST_BURST = 256
"""Beats: AXI4, A3.4.1."""
PAGE = 4096
"""Bytes that a burst must stay within: AXI4, A3.4.1."""


class Burst(NamedTuple):
    """An AXI4 burst: address and length.

    Attributes:
        address: address of its first byte.
        beats: AWLEN or ARLEN and one.
    """

    address: int
    beats: int


class Beat(NamedTuple):
    """A beat of an AXI4 write or read.

    Attributes: data: 128 bits. strobe: one bit per byte that is written. last: WLAST or RLAST.
    """

    data: int
    strobe: int
    last: bool


class Signals(NamedTuple):
    """All five channels before an edge of the memory's clock; None where VALID is low."""

    aw: Burst | None
    awready: bool
    w: Beat | None
    wready: bool
    b: bool
    bready: bool
    ar: Burst | None
    arready: bool
    r: Beat | None
    rready: bool


def region_offset(region: int) -> int:
    """ADDR_offset of a region: five contiguous regions of 2 621 440 bytes."""
    if not 0 <= region < REGIONS:
        raise ValueError(f"a region must be 0 to {REGIONS - 1}, not {region}")
    return region * region_bytes()


def burst_address(bias: int, region: int, running: int) -> int:
    """Equation 5: ADDR_BIAS + ADDR_offset + address_r."""
    return bias + region_offset(region) + running


def bursts_of(bias: int, region: int, size: int, beats: int = BURST_BEATS) -> Iterator[Burst]:
    """The bursts of `size` bytes from a region's start; the last may be shorter."""
    start = burst_address(bias, region, 0)
    running, left = 0, -(-size // BEAT_BYTES)
    while left > 0:
        now = min(beats, left)
        yield Burst(start + running, now)
        running += now * BEAT_BYTES
        left -= now


class _Plan:
    """Bursts of successive frames, in the order in which a master issues them."""

    def __init__(self, bias: int, beats: int) -> None:
        if not 1 <= beats <= LONGEST_BURST:
            raise ValueError(f"a burst must have 1 to {LONGEST_BURST} beats, not {beats}")
        self.bias, self.beats = bias, beats
        self.left = self.running = 0
        self._region = 0

    def begin(self, region: int, beats: int) -> None:
        """Begins a frame of this number of beats; the running address returns to 0."""
        region_offset(region)  # refuses a wrong one
        self._region, self.left, self.running = region, beats, 0

    @property
    def upcoming(self) -> int:
        """Number of beats of the next burst."""
        return min(self.beats, self.left)

    def burst(self) -> Burst:
        """The next burst; the running address is unchanged until its handshake."""
        return Burst(burst_address(self.bias, self._region, self.running), self.upcoming)

    def handshake(self, burst: Burst) -> None:
        """The address of the burst was accepted."""
        self.running += burst.beats * BEAT_BYTES
        self.left -= burst.beats


class WriteMaster:
    """S2MM: from a FIFO to memory. `aw`, `w` and `bready` are its outputs."""

    def __init__(self, fifo: AsyncFifo, bias: int = 0, beats: int = BURST_BEATS) -> None:
        self.fifo = fifo
        self.plan = _Plan(bias, beats)
        self.aw: Burst | None = None
        self.w: Beat | None = None
        self.bready = True
        self.bursts: list[Burst] = []
        self._busy = False
        self._unsent = self._unasked = 0
        self._strobe = 0

    def begin(self, region: int, size: int) -> None:
        """Begins to write a frame of `size` bytes to a region; bytes beyond it in the last beat are
        masked."""
        if not self.idle:
            raise ValueError("the last frame is still under way")
        beats = -(-size // BEAT_BYTES)
        self.plan.begin(region, beats)
        self._unasked = beats
        self._strobe = (1 << (size - 1) % BEAT_BYTES + 1) - 1

    @property
    def idle(self) -> bool:
        """Whether all bursts of the frame have their response."""
        return not self._busy and self.plan.left == 0

    def edge(self, now: int, seen: Signals) -> None:
        """An edge of the memory's clock."""
        # prog_empty, but a frame's last burst may be shorter than what it waits for
        ready = self.fifo.waiting >= min(self.fifo.prog_empty_at, self.plan.left)
        start = not self._busy and self.plan.left > 0 and ready
        if seen.aw is not None and seen.awready:
            self.plan.handshake(seen.aw)
            self.bursts.append(seen.aw)
            self.aw = None
        if seen.w is not None and seen.wready:
            self.w = None
        pops = self.w is None and self._unsent > 0 and not self.fifo.empty
        word = self.fifo.read_edge(now, pops)
        if word is not None:
            self._unsent -= 1
            self._unasked -= 1
            every = (1 << BEAT_BYTES) - 1
            strobe = self._strobe if self._unasked == 0 else every
            self.w = Beat(word, strobe, self._unsent == 0)
        if seen.b and seen.bready:
            self._busy = False
        if start:
            self.aw = self.plan.burst()
            self._unsent = self.aw.beats
            self._busy = True


class ReadMaster:
    """MM2S: from memory into one FIFO per region, in turn. `ar` and `rready` are its outputs. A
    burst is issued if prog_full of the FIFO is low; the FIFO then has room for a burst, so RREADY
    can stay high."""

    def __init__(self, fifos: list[AsyncFifo], bias: int = 0, beats: int = BURST_BEATS) -> None:
        for fifo in fifos:
            if fifo.depth - fifo.prog_full_at + 1 < beats:
                raise ValueError("prog_full must leave room for a burst")
        self.fifos = fifos
        self.plans = [_Plan(bias, beats) for _ in fifos]
        self.ar: Burst | None = None
        self.rready = True
        self.bursts: list[Burst] = []
        self._turn = 0
        self._busy = False

    def begin(self, regions: list[int], size: int) -> None:
        """Begins to read frames of `size` bytes, one from each region."""
        for plan, region in zip(self.plans, regions, strict=True):
            plan.begin(region, -(-size // BEAT_BYTES))

    def edge(self, now: int, seen: Signals) -> None:
        """An edge of the memory's clock, which is the write clock of all its FIFOs."""
        start = None
        if not self._busy:
            order = [(self._turn + n) % len(self.fifos) for n in range(len(self.fifos))]
            free = (n for n in order if self.plans[n].left and not self.fifos[n].prog_full)
            start = next(free, None)
        if seen.ar is not None and seen.arready:
            self.plans[self._turn].handshake(seen.ar)
            self.bursts.append(seen.ar)
            self.ar = None
        arrived = seen.r if seen.rready else None
        for n, fifo in enumerate(self.fifos):
            mine = arrived is not None and n == self._turn
            fifo.write_edge(now, arrived.data if mine and arrived is not None else None)
        if arrived is not None and arrived.last:
            self._busy = False
            self._turn = (self._turn + 1) % len(self.fifos)
        if start is not None:
            self._turn, self._busy = start, True
            self.ar = self.plans[start].burst()


class AxiRules:
    """Checks the signals of a bus against the rules; `faults` has one line per violation."""

    def __init__(self) -> None:
        self.faults: list[str] = []
        self.clock = 0
        self._before: Signals | None = None
        self._writes: deque[int] = deque()  # beats of bursts whose data is not over
        self._data: deque[int] = deque()  # beats of data whose address has not come
        self._beats = self._answers = self._reads_at = 0
        self._reads: deque[int] = deque()

    def see(self, now: Signals) -> None:
        """The signals before the next edge."""
        before = self._before
        if before is not None:
            for name in ("aw", "w", "ar", "r"):
                was, ready = getattr(before, name), getattr(before, f"{name}ready")
                if was is not None and not ready and getattr(now, name) != was:
                    self._fault(f"{name.upper()}VALID or its payload changed before READY")
            if before.b and not before.bready and not now.b:
                self._fault("BVALID fell before BREADY")
        if now.aw is not None and now.awready:
            self._burst("AW", now.aw)
            self._writes.append(now.aw.beats)
        if now.ar is not None and now.arready:
            self._burst("AR", now.ar)
            self._reads.append(now.ar.beats)
        if now.b and self._answers <= 0:
            self._fault("BVALID before address and data were taken")
        if now.b and now.bready:
            self._answers -= 1
        if now.w is not None and now.wready:
            self._beats += 1
            if now.w.last:
                self._data.append(self._beats)
                self._beats = 0
            elif self._writes and not self._data and self._beats >= self._writes[0]:
                self._fault("WLAST was low with a burst's last beat")
        if now.r is not None:
            self._read_beat(now)
        while self._writes and self._data:
            asked, sent = self._writes.popleft(), self._data.popleft()
            if asked != sent:
                self._fault(f"WLAST came with beat {sent} of a burst of {asked}")
            self._answers += 1
        self._before = now
        self.clock += 1

    def _read_beat(self, now: Signals) -> None:
        if not self._reads:
            self._fault("RVALID without an address")
            return
        last = self._reads_at + 1 == self._reads[0]
        if now.r is not None and now.r.last != last:
            self._fault(f"RLAST was wrong with beat {self._reads_at + 1} of {self._reads[0]}")
        if now.rready:
            self._reads_at += 1
            if last:
                self._reads.popleft()
                self._reads_at = 0

    def _burst(self, channel: str, burst: Burst) -> None:
        if not 1 <= burst.beats <= LONGEST_BURST:
            self._fault(f"{channel}: a burst of {burst.beats} beats")
        end = burst.address // BEAT_BYTES * BEAT_BYTES + burst.beats * BEAT_BYTES - 1
        if burst.address // PAGE != end // PAGE:
            self._fault(f"{channel}: the burst at {burst.address:#x} crosses 4 KiB")

    def _fault(self, what: str) -> None:
        self.faults.append(f"clock {self.clock}: {what}")
