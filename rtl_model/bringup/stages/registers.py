"""Stage registers: walking ones and addresses as data in all writable registers, and reset values.

The previous contents are restored.
"""

from __future__ import annotations

from functools import partial

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.registers import REGISTERS, Register, parameters, reset_value

_LIMITED = {"capture_pointer"}  # reads as at most the number of stored words
_VARYING = {  # read-only registers without a constant value after reset
    "ctrl_build", "ctrl_uptime", "prbs_source", "capture_state", "ctrl_bus_errors",
}  # fmt: skip
_BUS_REMEDY = "check that bit of the bus and of the register"


def check_registers(bench: Bench) -> Figures:
    """Checks with walking ones, addresses as data, the pattern memory's address lines and a reset.

    Raises StageFault stuck-bit, alias, memory, reset or restore.
    """
    rows = [entry for entry in REGISTERS if entry.mode == "rw" and entry.name not in _LIMITED]
    previous = {entry.name: bench.read_stable(entry.name) for entry in rows}
    try:
        for entry in rows:
            bench.repeat(partial(_walk, bench, entry), "stuck-bit")
            bench.write(entry.name, previous[entry.name])
        bench.repeat(lambda: _address_in_data(bench, rows), "alias")
        words = bench.repeat(lambda: _address_lines(bench), "memory")
        if bench.monitor is not None:
            bench.monitor.expect_reset()
        compared = bench.repeat(lambda: _reset(bench), "reset")
    finally:
        for name, value in previous.items():
            bench.write(name, value)
    bench.repeat(lambda: _restored(bench, previous), "restore")
    return {
        "registers": len(rows),
        "bits_walked": sum(entry.width for entry in rows),
        "memory_words": words,
        "reset_values": compared,
    }


def _restored(bench: Bench, previous: dict[str, int]) -> None:
    """Restores registers and checks their contents."""
    for name, value in previous.items():
        bench.write(name, value)
    for name, value in previous.items():
        got = bench.read_stable(name)
        if got != value:
            raise StageFault(
                "restore", f"{name} was set back to {value:#x} and reads {got:#x}", _BUS_REMEDY
            )


def _walk(bench: Bench, entry: Register) -> None:
    """Writes one bit at a time. Bits beyond the width must read 0."""
    mask = (1 << entry.width) - 1
    readings: list[tuple[int, int]] = []
    for value in [*(1 << n for n in range(32)), 0xFFFFFFFF, 0]:
        bench.write(entry.name, value)
        readings.append((value & mask, bench.read_expecting(entry.name, value & mask)))
    if all(must == got for must, got in readings):
        return
    high, low = 0, mask  # bits that read 1 at least once, and always
    for _, got in readings:
        high, low = high | got, low & got
    stuck0 = [n for n in range(entry.width) if not high >> n & 1]
    stuck1 = [n for n in range(entry.width) if low >> n & 1]
    extra = [n for n in range(entry.width, 32) if high >> n & 1]
    if stuck0 or stuck1:
        bit, level = (stuck0[0], 0) if stuck0 else (stuck1[0], 1)
        text = f"bit {bit} of {entry.name} is stuck at {level}"
    elif extra:
        text = f"bit {extra[0]} of {entry.name} reads 1, but the register has {entry.width} bits"
    else:
        must, got = next(pair for pair in readings if pair[0] != pair[1])
        text = f"{entry.name} was written {must:#x} and reads {got:#x}"
    raise StageFault("stuck-bit", text, _BUS_REMEDY, {"register": entry.name})


def _address_in_data(bench: Bench, rows: list[Register]) -> None:
    """Writes a different word to each register; a changed word reveals an alias of its address."""
    contents = {}
    for entry in rows:
        contents[entry.name] = (entry.address * 0x01000193 ^ entry.address) & (
            (1 << entry.width) - 1
        )
        bench.write(entry.name, contents[entry.name])
    for entry in rows:
        got = bench.read_expecting(entry.name, contents[entry.name])
        if got != contents[entry.name]:
            raise StageFault(
                "alias",
                f"{entry.name} held {contents[entry.name]:#x} and reads {got:#x} after others were "
                "written",
                "check the decoding of addresses on the bus",
                {"register": entry.name},
            )


def _address_lines(bench: Bench) -> int:
    """Writes different words at 0, 1, 2, 4 and so on and at the end of the pattern memory."""
    words = bench.geometry.pattern_bytes // 4
    base = bench.csr.base("pattern_mem")
    places = sorted({0, words - 1, *(1 << n for n in range(words.bit_length()) if 1 << n < words)})
    previous = [bench.bone.read_twice(base + 4 * place)[0] for place in places]
    must = [~(place * 0x9E3779B1) & 0xFFFFFFFF for place in places]
    for place, value in zip(places, must, strict=True):
        bench.bone.write(base + 4 * place, value)
    got = [bench.bone.read_twice(base + 4 * place)[0] for place in places]
    for place, value in zip(places, previous, strict=True):
        bench.bone.write(base + 4 * place, value)
    for place, value, read in zip(places, must, got, strict=True):
        if value != read:
            other = places[must.index(read)] if read in must else None
            owner = "" if other is None else f", which is word {other}'s"
            bits = [n for n in range(32) if (value ^ read) >> n & 1]
            raise StageFault(
                "memory",
                f"word {place} of the pattern memory was written {value:#010x} and reads "
                f"{read:#010x}{owner} (wrong bits {', '.join(map(str, bits))})",
                "check the address lines of that memory" if other is not None
                else "check that memory's data lines",
            )  # fmt: skip
    return len(places)


def _reset(bench: Bench) -> int:
    """Resets the board and compares every register that has a reset value; returns their number."""
    before = bench.read("ctrl_uptime")
    bench.write("ctrl_reset", 1)
    values = parameters(bench.geometry)
    compared = 0
    for entry in REGISTERS:
        if entry.mode == "wo" or entry.name in _VARYING or entry.name.startswith("uart_"):
            continue
        must, got = reset_value(entry, values), bench.read_stable(entry.name)
        if must != got:
            raise StageFault(
                "reset",
                f"{entry.name} reads {got:#x} after reset, not {must:#x}",
                "check that register's reset",
                {"register": entry.name},
            )
        compared += 1
    after = bench.read("ctrl_uptime")
    if (after - before) & 0xFFFFFFFF > 1 << 31:
        raise StageFault(
            "reset", "ctrl_uptime restarted with ctrl_reset", "check that counter's reset"
        )
    return compared
