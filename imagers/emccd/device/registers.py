"""The registers of the EMCCD. Its five parameters take effect together, at the start of a cycle."""

from __future__ import annotations

from typing import Final

from imagers.emccd.device.timing import EXPOSURE_STEPS, Settings, Timing
from rtl_model.registers import Field, Register
from rtl_model.registers.design import Design, Update

__all__ = ["DESIGN", "PARAMETERS", "REGISTERS", "design"]

_FIRST: Final = Settings()

PARAMETERS: Final = (
    "emccd_exposure", "emccd_gain", "emccd_first_row", "emccd_rows", "emccd_sync",
)  # fmt: skip
"""Registers that take effect at the start of a cycle."""

REGISTERS: Final[tuple[Register, ...]] = (
    Register(
        "emccd_exposure", 0x300, "rw", _FIRST.steps, 13,
        f"exposure in steps of 10 us, 1 to {EXPOSURE_STEPS}; others as the nearest",
    ),
    Register("emccd_gain", 0x304, "rw", 0, 8, "step of the high voltage's potentiometer"),
    Register("emccd_first_row", 0x308, "rw", 0, 9, "image row where the window begins"),
    Register("emccd_rows", 0x30C, "rw", _FIRST.rows, 10, "rows of the window, cut at the last row"),
    Register("emccd_sync", 0x310, "rw", 0, 1, "0 internal, 1 external: a cycle waits for a pulse"),
    Register("emccd_trigger", 0x314, "wo", 0, 1, "1 gives a sync pulse, as the input does"),
    Register(
        "emccd_state", 0x320, "ro", 0, 3, "what the sequencer does",
        fields=(
            Field(
                "phase", 2, 0,
                "0 waits, 1 first transfer, 2 exposure, 3 second transfer, 4 clear, "
                "5 dump before, 6 readout, 7 dump after",
            ),
        ),
    ),
    Register("emccd_cycles", 0x324, "ro", 0, 32, "cycles begun"),
    Register("emccd_frames", 0x328, "ro", 0, 32, "frames whose last pixel has left"),
    Register("emccd_cycle_clock", 0x32C, "ro", 0, 32, "ctrl_uptime when the last cycle began"),
    Register("emccd_frame_clocks", 0x330, "ro", 0, 32, "clocks of the cycle at work"),
    Register("emccd_pulses_lost", 0x334, "ro", 0, 32, "sync pulses that no cycle waited for"),
    Register("emccd_work_exposure", 0x340, "ro", 0, 13, "exposure at work, steps of 10 us"),
    Register("emccd_work_gain", 0x344, "ro", 0, 8, "gain step at work"),
    Register("emccd_work_first_row", 0x348, "ro", 0, 9, "first row at work"),
    Register("emccd_work_rows", 0x34C, "ro", 0, 10, "rows at work"),
)  # fmt: skip

_UPDATES: Final[dict[str, Update]] = dict.fromkeys(PARAMETERS, "cycle")


def design(timing: Timing | None = None) -> Design:
    """The design behind the serial line, with the clock and size of `timing`."""
    timing = timing or Timing()
    return Design(
        "emccd", 3, "frame-transfer EMCCD", (timing.rows, timing.columns), timing.clock_hz,
        REGISTERS, _UPDATES,
    )  # fmt: skip


DESIGN: Final = design()
