"""The nine drive signals of the EBAPS's sensor in closed form, in 40 MHz clocks, and the reset
times of its rows.

Document 002, section 3.1, names VSYNC, HCLK, HSYNC, VCLK, RD1, RD2, RST, SEL and T and says that
VSYNC's duty sets the exposure of a rolling shutter. It prints no order within a row. The following
order is assumed; it is that of a four-transistor pixel.

Reading row r begins at b = VSYNC's fall + 1280 r: VCLK moves to the row, SEL connects it, RST
empties the sense node, RD1 samples that, T carries the charge over (its fall ends the exposure),
RD2 samples again. HSYNC hands both samples to the output register at b + 72, and 1280 clocks of
HCLK shift them out, while the next row is sampled. Resetting row r begins at VSYNC's rise + 1280 r:
T and RST together, at the same place in the row as T in a reading, so the exposure between two
falls of T is that of VSYNC, to the clock. T acts on the row under SEL and, with RST, on the row
to be reset; RST without T acts on the row under SEL. A row's two instants lie 48 clocks (1.2 us)
after those that `Timing.row_times` gives; a frame's last pixel comes 72 clocks after
`Timing.ready`.

Both sequences share the lines. If T of a reset falls within SEL of another row, but not at the same
time as T of that row, it transfers the charge of that row at the wrong time: `disturbed_rows`. They
coincide if the exposure is a whole number of row times, as are the step (20 rows), T_default (512)
and T_max (1024) of the document.

Resets of neighbouring frames overlap. A shift register selects the row to be reset. It advances by
one row every 1280 clocks, with a pulse of RST and T in each row. The reset of a frame takes 32.768
ms, and resets begin every 33.3 ms minus the increase of the exposure. If the exposure increases by
more than the blanking (0.565 ms; a step of the loop is 0.64 ms), the next reset begins before this
one has ended. The register then holds two rows, and each pulse resets both. The exposure of a row
begins with the last pulse while the row is in the register, so the last rows of the earlier frame
and the first rows of the later one begin late, by less than a row time (32 us).

Assumed: a shift register rather than a counter (a single counter could not hold two rows), and the
position of the pulse in a row (`RESETTING`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from imagers.common.trace import Record, Signal
from imagers.ebaps.board.timing import Timing

DRIVES = ("VSYNC", "HCLK", "HSYNC", "VCLK", "RD1", "RD2", "RST", "SEL", "T")
"""Document 002, section 3.1."""
READING = {
    "VCLK": (0, 8),
    "SEL": (8, 72),
    "RST": (8, 16),
    "RD1": (24, 32),
    "T": (40, 48),
    "RD2": (56, 64),
    "HSYNC": (72, 80),
}
"""Clock after a row's beginning at which a signal rises, and falls: assumed."""
RESETTING = {"RST": (40, 48), "T": (40, 48)}
"""The same, for a row that is reset: assumed."""
LAG = READING["HSYNC"][0]
"""Clocks from a row's beginning to its first pixel."""
DRIVE_SIGNALS = (*(Signal(name.lower()) for name in DRIVES), Signal("hclk_on"))
"""Signals of a trace. `hclk` shows its edges in the first rows only, `hclk_on` when it runs."""
HCLK_ROWS = 2
"""Rows of a trace's first frame in which each edge of HCLK is written."""

Clocks = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Drive:
    """Pulses of frame k: exposed in period k, read in period k + 1. Times are clocks.

    timing: rows of at least 80 clocks, so that the pulses of a row fit.
    """

    timing: Timing = field(default_factory=Timing)

    def __post_init__(self) -> None:
        longest = max(end for _, end in READING.values())
        if self.timing.columns < longest:
            raise ValueError(f"a row must have {longest} clocks or more for its pulses")

    def vsync(self, frame: int, exposure: int) -> tuple[int, int]:
        """VSYNC's rise and fall in a frame's period. exposure: ns."""
        return self.timing.rise(frame, exposure), self.timing.vsync(frame + 1)

    def _rows(self, begin: int, pulse: tuple[int, int]) -> tuple[Clocks, Clocks]:
        rows = begin + self.timing.columns * np.arange(self.timing.rows, dtype=np.int64)
        return rows + pulse[0], rows + pulse[1]

    def reading(self, signal: str, frame: int) -> tuple[Clocks, Clocks]:
        """(rows,) each: rises and falls of a signal as a frame's rows are read."""
        return self._rows(self.timing.vsync(frame + 1), READING[signal])

    def resetting(self, signal: str, frame: int, exposure: int) -> tuple[Clocks, Clocks]:
        """(rows,) each: rises and falls of RST or T as a frame's rows are reset. exposure: ns."""
        return self._rows(self.timing.rise(frame, exposure), RESETTING[signal])

    def exposed(self, frame: int, exposure: int) -> Clocks:
        """(rows,) clocks from T's fall in a row's reset to its fall in the row's reading."""
        return self.reading("T", frame)[1] - self.resetting("T", frame, exposure)[1]

    def shifting(self, frame: int) -> tuple[int, int]:
        """Start and end of HCLK, which runs through all rows with one pulse per clock."""
        begin = self.timing.vsync(frame + 1) + LAG
        return begin, begin + self.timing.readout_clocks

    def pulses(self, signal: str, frame: int) -> int:
        """Number of rises of a signal during the read-out of a frame: one per row, for HCLK one per
        pixel."""
        return (
            self.timing.readout_clocks if signal == "HCLK" else self.reading(signal, frame)[0].size
        )

    def disturbed_rows(self, frame: int, exposure: int, following: int) -> int:
        """Rows of a frame whose SEL contains T of a reset at another time than their own T.

        Resets of the frame itself and of the next one occur during its read-out. exposure,
        following: exposures of these two frames, ns.
        """
        timing = self.timing
        begin = timing.vsync(frame + 1)
        rises = (timing.rise(frame, exposure), timing.rise(frame + 1, following))
        return sum(self._disturbed(rise - begin) for rise in rises)

    def resets_at_once(self, frame: int, exposure: int, following: int) -> int:
        """Number of rows that the next frame resets before the reset of this frame has reached the
        last row.

        It is above 0 if the exposure increases by more than the blanking of a period (0.565 ms): 3
        for a step of 0.64 ms. A shift register then holds two rows, which are reset together
        (`resets`); with counters a second one would be needed. exposure, following: ns.
        """
        apart = self.timing.rise(frame + 1, following) - self.timing.rise(frame, exposure)
        return max(0, -((apart - self.timing.readout_clocks) // self.timing.columns))

    def _disturbed(self, ahead: int) -> int:
        """Number of rows that a reset sequence disturbs if it begins this number of clocks after
        the read-out."""
        columns, (on, off) = self.timing.columns, READING["SEL"]
        rise, fall = RESETTING["T"]
        found = 0
        for apart in (ahead % columns, ahead % columns - columns):
            if apart and rise + apart < off and fall + apart > on:
                found += max(0, self.timing.rows - abs((ahead - apart) // columns))
        return found


def merged(pulses: Sequence[tuple[Clocks, Clocks]]) -> tuple[Clocks, Clocks]:
    """Rises and falls of the union of all pulses; adjacent pulses are joined."""
    begins = np.concatenate([begin for begin, _ in pulses])
    ends = np.concatenate([end for _, end in pulses])
    order = np.argsort(begins, kind="stable")
    begins, ends = begins[order], np.maximum.accumulate(ends[order])
    first = np.concatenate([[True], begins[1:] > ends[:-1]])
    last = np.concatenate([first[1:], [True]])
    return begins[first], ends[last]


def drive_records(frames: Sequence[tuple[int, int]], timing: Timing | None = None) -> list[Record]:
    """All records of the nine signals in order of time. frames: (number, exposure in ns) of frames
    that follow each other."""
    if not frames:
        return []
    at = Timing() if timing is None else timing
    drive = Drive(at)
    lines: dict[str, tuple[Clocks, Clocks]] = {}
    ends = [drive.vsync(*frame) for frame in frames]
    lines["vsync"] = merged([(np.array([rise]), np.array([fall])) for rise, fall in ends])
    for name in READING:
        parts = [drive.reading(name, number) for number, _ in frames]
        if name in RESETTING:
            parts += [drive.resetting(name, *frame) for frame in frames]
        lines[name.lower()] = merged(parts)
    running = [drive.shifting(number) for number, _ in frames]
    lines["hclk_on"] = merged([(np.array([begin]), np.array([end])) for begin, end in running])
    names = list(lines)
    clocks = np.concatenate([part for line in lines.values() for part in line])
    which = np.repeat(
        np.arange(2 * len(names)), [part.size for line in lines.values() for part in line]
    )
    found = [
        Record(at.ps(clock), names[n // 2], 1 - n % 2)
        for clock, n in zip(clocks.tolist(), which.tolist(), strict=True)
    ]
    half = PS // at.clock_hz // 2
    begin = running[0][0]
    for clock in range(begin, begin + HCLK_ROWS * at.columns):
        found += [Record(at.ps(clock), "hclk", 1), Record(at.ps(clock) + half, "hclk", 0)]
    return sorted(found, key=lambda record: record.ps)


def late_resets(timing: Timing, frame: int, exposures: tuple[int | None, int, int | None]
                ) -> Clocks:  # fmt: skip
    """(rows,) clocks between the reset of each row by its own frame and its last reset. exposures:
    of the previous frame, of `frame` and of the next frame, ns; None if there is no such frame.

    Only neighbours can overlap: two periods are longer than two readouts.
    """
    columns = timing.columns
    rows = np.arange(timing.rows, dtype=np.int64)
    before, own, after = exposures
    late = np.zeros(timing.rows, np.int64)
    start = timing.rise(frame, own)
    window = columns - RESETTING["T"][1]  # a pulse that ends later ends in the row that follows
    for other, exposure in ((frame - 1, before), (frame + 1, after)):
        if exposure is None:
            continue
        # The other reset's pulse of its row q comes columns x q after its beginning: the first
        # after each row's own, if it is there and the row still in the register.
        apart = timing.rise(other, exposure) - start
        shift = apart % columns
        place = rows + (shift - apart) // columns
        hit = (place >= 0) & (place < timing.rows) & (0 < shift <= window)
        late = np.where(hit, np.maximum(late, shift), late)
    return late


def row_times(
    timing: Timing, frame: int, exposures: tuple[int | None, int, int | None], rows: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(rows,) ps each: begin and end of the exposure of a frame's first rows, as `Timing.row_times`
    with late resets. A row whose last reset follows its read-out has no exposure."""
    begin, end = timing.row_times(frame, exposures[1], rows)
    late = late_resets(timing, frame, exposures)[:rows]
    start = timing.rise(frame, exposures[1])
    for row in np.flatnonzero(late):
        begin[row] = timing.ps(start + int(row) * timing.columns + int(late[row]))
    return np.minimum(begin, end), end
