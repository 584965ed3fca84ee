"""`AdaptiveExposure`: the whole sensor, light to frames, over its registers.

A decision is made when a frame's last pixel has left. The next frame is then exposing already, so
the new exposure is the one after: exposure(k + 2) = decide(frame k). It is reckoned from the
exposure that frame k had, not from the multiplier register, which frame k - 1's decision may have
changed meanwhile: taking that one would follow one change of light twice (`follow`'s naive form).
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.frames import Frame
from rtl_model.imagers.adaptive.decision import LONGEST, Search, decide
from rtl_model.imagers.adaptive.registers import REGISTERS, parameters
from rtl_model.imagers.adaptive.sequencer import Sequencer, disturbed
from rtl_model.imagers.adaptive.statistics import Window, gather
from rtl_model.imagers.adaptive.timing import FRAME_RATE, FrameTiming, Timing
from rtl_model.registers.table import Register
from sensor.imagers import Exposed, Scenery
from sensor.imagers.cmos import AdaptivePixels

__all__ = ["AdaptiveExposure"]


class AdaptiveExposure:
    """An `Imager`. pixels: its array. timing: of its sequencer, else 100 frames/s for the array.
    registers: its table; a write counts from the next decision on, one of the window from the
    next frame's beginning."""

    name = "adaptive-exposure"
    registers: tuple[Register, ...] = REGISTERS

    def __init__(
        self, pixels: AdaptivePixels | None = None, timing: Timing | None = None,
        frame_rate: float = FRAME_RATE,
    ) -> None:  # fmt: skip
        self.pixels = pixels or AdaptivePixels()
        self.timing = timing or Timing.of(*self.pixels.shape, frame_rate)
        if (self.timing.rows, self.timing.columns) != self.pixels.shape:
            raise ValueError(f"timing must be for {self.pixels.shape} pixels, not {self.timing}")
        self._entries = {entry.name: entry for entry in self.registers}
        values = parameters(self.timing)
        self._values = {
            entry.name: entry.reset if isinstance(entry.reset, int) else values[entry.reset]
            for entry in self.registers
        }
        self._waiting: list[tuple[int, int, str, int]] = []
        self._written, self._now = 0, 0
        self._sequencer = Sequencer(self.timing)
        self._ahead: list[tuple[int, int]] = []
        self._recent: list[tuple[FrameTiming, int]] = []

    @property
    def now(self) -> int:
        """Where it stands, ps."""
        return self._now

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """See `Imager`. InputError for no such register, one that is not written, a value that
        does not fit, a time that has passed."""
        entry = self._entry(register)
        if entry.mode == "ro":
            raise InputError(register, "a register that is written", "one that is only read",
                             "write another")  # fmt: skip
        if not 0 <= value < 1 << entry.width:
            raise InputError(
                register, f"0 to {(1 << entry.width) - 1}", str(value),
                f"it has {entry.width} bits",
            )  # fmt: skip
        when = self._now if at is None else at
        if when < self._now:
            raise InputError(register, f"written at {self._now} ps or later", f"at {when} ps",
                             "time does not go back")  # fmt: skip
        insort(self._waiting, (when, self._written, register, value))
        self._written += 1
        self._apply(self._now)

    def read(self, register: str) -> int:
        """See `Imager`."""
        self._entry(register)
        return self._values[register]

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """See `Imager`."""
        if scene.shape != self.pixels.shape:
            raise ValueError(f"scene must be {self.pixels.shape}, not {scene.shape}")
        if not self._recent:
            self._power_on()
        edge = self.timing.clock.edge
        while True:
            timing, multiplier = self._recent[-1]
            ready = edge(timing.start + self.timing.deciding)
            if ready > until:
                break
            self._apply(edge(timing.start))
            window = self._window()
            threshold = self._values["window_threshold"]
            whole = bool(self._values["window_whole_scan"])
            begin, end = self._times(timing)
            light = scene.lux_seconds(0, begin, end)
            seconds = (end - begin) / 1e12
            exposed = Exposed(light, seconds, np.zeros(len(end)), 0, timing.number)
            values, saturated = self.pixels.digitise(exposed, seed, kept)
            seen = gather(values, saturated, window, whole_scan=whole)
            self._apply(ready)
            longest = min(self._values["exposure_longest"], LONGEST)
            made = decide(
                multiplier, seen.saturated, seen.largest, threshold=threshold,
                search=Search(self._values["exposure_search"] or 1), longest=longest,
            )  # fmt: skip
            chosen = made.multiplier if self._values["exposure_automatic"] else self._user
            self._ahead.append((chosen * self._minimum, chosen))
            self._values |= {
                "exposure_multiplier": chosen,
                "last_frame": timing.number & 0xFFFFFFFF,
                "last_saturated": seen.saturated,
                "last_largest": 256 if seen.largest is None else seen.largest,
                "last_multiplier": multiplier,
                "last_flag": int(made.flag),
                "frames": (timing.number + 1) & 0xFFFFFFFF,
            }
            self._now = ready
            state = {
                "multiplier": float(multiplier),
                "saturated": float(seen.saturated),
                "largest": float(self._values["last_largest"]),
                "flag": float(made.flag),
                "next_multiplier": float(chosen),
                "hold_clocks": float(timing.hold),
                "period_clocks": float(timing.period),
                "counter": float(timing.counter),
                "disturbed": float(disturbed(self.timing, [f for f, _ in self._recent])),
            }
            self._begin()
            yield Frame(values, self.pixels.bits, timing.number, begin, end, ready, state)
        self._now = max(self._now, until)
        self._apply(self._now)

    def _entry(self, register: str) -> Register:
        if register not in self._entries:
            raise InputError("register", "one of " + ", ".join(self._entries), register,
                             "look at the table")  # fmt: skip
        return self._entries[register]

    def _apply(self, until: int) -> None:
        """Writes that are due by an instant take their places."""
        while self._waiting and self._waiting[0][0] <= until:
            _, _, register, value = self._waiting.pop(0)
            self._values[register] = value

    @property
    def _minimum(self) -> int:
        return max(1, self._values["exposure_minimum"])

    @property
    def _user(self) -> int:
        return min(max(1, self._values["exposure_user"]), 1 << LONGEST)

    def _power_on(self) -> None:
        """Exposes with T, or with what the user has set (document 001, section 2)."""
        first = 1 if self._values["exposure_automatic"] else self._user
        self._values["exposure_multiplier"] = first
        self._ahead = [(first * self._minimum, first)] * 2
        self._begin()

    def _begin(self) -> None:
        exposure, multiplier = self._ahead.pop(0)
        self._recent = [*self._recent[-1:], (self._sequencer.step(exposure), multiplier)]

    def _window(self) -> Window:
        rows, columns = self._values["window_rows"], self._values["window_columns"]
        return Window(rows & 0xFFFF, rows >> 16, columns & 0xFFFF, columns >> 16)

    def _times(self, timing: FrameTiming) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], ...]:
        edge = self.timing.clock.edge
        rows = range(self.timing.rows)
        return (
            np.array([edge(timing.reset(row)) for row in rows], np.int64),
            np.array([edge(timing.sample(row)) for row in rows], np.int64),
        )
