"""Timing of the EMCCD's cycle, in clocks, and the frame time in closed form.

Source: document 003. Its formula of the frame time and its Table 2 are lost; the formula here
follows from the sequence that its text describes. Values that the text does not state are marked as
assumed.

The document dumps M rows before the window and 527 - M - N after it, which omits one of the 528
rows (`after_printed`). The sequence here dumps 528 - M - K, so each row leaves once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from cosim import InputError
from cosim.clock import Clock
from imagers.emccd.pixels.chip import (
    COLUMNS,
    DARK_ROWS,
    IMAGE_ROWS,
    LINE_CLOCKS,
    ROW_SHIFT,
    ROWS,
)

CLOCK_HZ: Final = 10_000_000
"""System clock, also of the converter and of the pixels (document); the rate is assumed."""
EXPOSURE_STEP_US: Final = 10
EXPOSURE_STEPS: Final = 4096
"""Document: exposure 10 us to 40.96 ms in steps of 10 us."""
SIZES: Final = (512, 256, 128, 64, 32, 16)
"""Rows of the windows in the table. Those of Table 2 of the document are lost; 256 and 128 are the
windows of its Fig. 5, the others are assumed."""
TABLE_EXPOSURE_STEPS: Final = 200
"""Exposure of Table 2 in the document, 2 ms."""

_SHIFT: Final = round(ROW_SHIFT * CLOCK_HZ)


@dataclass(frozen=True)
class Timing:
    """Timing of one camera.

    The last four values are assumed: reported row shifts take 0.3 to 1 us, and no figures of the
    gate were found.

    Attributes:
        clock_hz: system clock, Hz.
        rows, columns: size of the image area with its dark reference.
        dark_rows: dark rows at the head, and as many at the tail, that no window reads.
        line: pixel clocks of a row.
        transfer: clocks of one row shift in a frame transfer.
        shift: clocks of one row shift from the store into the horizontal register.
        dump: clocks of one row shift with the dump gate open.
        clear: clocks to empty the horizontal register once.
    """

    clock_hz: int = CLOCK_HZ
    rows: int = ROWS
    columns: int = COLUMNS
    dark_rows: int = DARK_ROWS
    line: int = LINE_CLOCKS
    transfer: int = _SHIFT
    shift: int = _SHIFT
    dump: int = _SHIFT
    clear: int = _SHIFT

    def __post_init__(self) -> None:
        if self.clock_hz <= 0 or self.clock_hz * EXPOSURE_STEP_US % 1_000_000:
            raise InputError(
                "the EMCCD's clock",
                f"a whole number of clocks in {EXPOSURE_STEP_US} us",
                f"{self.clock_hz} Hz",
                "take a multiple of 100 kHz",
            )
        short = [
            name
            for name in ("transfer", "shift", "dump", "clear")
            if getattr(self, name) < (1 if name == "clear" else 2)
        ]
        if short or self.line < self.columns or self.rows - 2 * self.dark_rows < 1:
            raise InputError(
                "the EMCCD's timing",
                "2 clocks a shift, a pixel clock a column and rows between the dark ones",
                f"{self}",
                "lengthen " + (", ".join(short) or "the line, or leave fewer rows dark"),
            )

    @property
    def clock(self) -> Clock:
        """The system clock."""
        return Clock(self.clock_hz)

    @property
    def step(self) -> int:
        """Clocks of one step of exposure."""
        return self.clock_hz * EXPOSURE_STEP_US // 1_000_000

    @property
    def image_rows(self) -> int:
        """Rows that a window may read."""
        return self.rows - 2 * self.dark_rows

    @property
    def transition(self) -> int:
        """Pixel clocks before the first column of a row appears at the output."""
        return self.line - self.columns

    @property
    def row_shift(self) -> float:
        """Time of one row shift in a frame transfer, s, which determines the smear."""
        return self.transfer / self.clock_hz


@dataclass(frozen=True)
class Settings:
    """Parameters of one cycle.

    Attributes:
        steps: exposure in steps of 10 us, 1 to 4096.
        first: first image row of the window.
        rows: number of rows of the window.
        gain_step: step of the potentiometer, 0 to 255.
        external: whether the cycle waits for a sync pulse.
    """

    steps: int = TABLE_EXPOSURE_STEPS
    first: int = 0
    rows: int = IMAGE_ROWS
    gain_step: int = 0
    external: bool = False

    def within(self, timing: Timing) -> Settings:
        """The parameters, clipped to the range of the camera: the window to the image rows, and the
        exposure to its limits."""
        first = min(self.first, timing.image_rows - 1)
        return Settings(
            steps=min(max(self.steps, 1), EXPOSURE_STEPS),
            first=first,
            rows=min(max(self.rows, 1), timing.image_rows - first),
            gain_step=self.gain_step,
            external=self.external,
        )


def frame_clocks(timing: Timing, settings: Settings) -> int:
    """Clocks of a cycle from its first shift to its last dumped row: two transfers, the exposure,
    the clear, R - K dumped rows, and a shift and a line for each of K rows."""
    rows, read = timing.rows, settings.rows
    return (
        2 * rows * timing.transfer
        + settings.steps * timing.step
        + timing.clear
        + (rows - read) * timing.dump
        + read * (timing.shift + timing.line)
    )


def frame_seconds(timing: Timing, settings: Settings) -> float:
    """`frame_clocks` in seconds."""
    return frame_clocks(timing, settings) / timing.clock_hz


def frame_rate(timing: Timing, settings: Settings) -> float:
    """Frame rate with internal sync, Hz; the cycles follow without a gap."""
    return timing.clock_hz / frame_clocks(timing, settings)


def window_table(
    timing: Timing | None = None,
    sizes: tuple[int, ...] = SIZES,
    steps: int = TABLE_EXPOSURE_STEPS,
) -> list[tuple[int, float]]:
    """(rows, frame rate in Hz) of centred windows at one exposure, as in Table 2."""
    timing = timing or Timing()
    return [
        (
            rows,
            frame_rate(timing, Settings(steps, (timing.image_rows - rows) // 2, rows)),
        )
        for rows in sizes
    ]


def after_printed(before: int, read: int) -> int:
    """Rows dumped after the window by the document, 527 - M - N. With M rows before and N rows
    read, it accounts for 527 of 528 rows."""
    return 527 - before - read


def exposure_range(timing: Timing | None = None) -> tuple[float, float, float]:
    """Shortest exposure, longest exposure and step, s, from the clocks of the sequencer."""
    timing = timing or Timing()
    step = timing.step / timing.clock_hz
    return step, EXPOSURE_STEPS * timing.step / timing.clock_hz, step
