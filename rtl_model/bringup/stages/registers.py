"""Stage registers: walking ones and addresses as data over what can be written, and values after
reset. What was there before stands again afterwards."""

from __future__ import annotations

from functools import partial

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.registers import REGISTERS, Register, parameters, reset_value

__all__ = ["check_registers"]

_NOT_PLAIN = {"capture_pointer"}  # reads otherwise than written beyond what was stored
_CHANGE = {  # read-only registers that do not keep their value after reset
    "ctrl_build", "ctrl_uptime", "prbs_source", "capture_state", "ctrl_bus_errors",
}  # fmt: skip
_BUS_MEND = "check that bit of the bus and of the register"


def check_registers(bench: Bench) -> Figures:
    """Walking ones, addresses as data, pattern memory's address lines, and a reset. StageFault
    stuck-bit, alias, memory or reset."""
    rows = [entry for entry in REGISTERS if entry.mode == "rw" and entry.name not in _NOT_PLAIN]
    kept = {entry.name: bench.read_stable(entry.name) for entry in rows}
    try:
        for entry in rows:
            bench.repeat(partial(_walk, bench, entry), "stuck-bit")
            bench.write(entry.name, kept[entry.name])
        bench.repeat(lambda: _address_in_data(bench, rows), "alias")
        words = bench.repeat(lambda: _address_lines(bench), "memory")
        if bench.monitor is not None:
            bench.monitor.expect_reset()
        compared = bench.repeat(lambda: _reset(bench), "reset")
    finally:
        for name, value in kept.items():
            bench.write(name, value)
    bench.repeat(lambda: _restored(bench, kept), "restore")
    return {
        "registers": len(rows),
        "bits_walked": sum(entry.width for entry in rows),
        "memory_words": words,
        "reset_values": compared,
    }


def _restored(bench: Bench, kept: dict[str, int]) -> None:
    """Sets registers back and holds them against that."""
    for name, value in kept.items():
        bench.write(name, value)
    for name, value in kept.items():
        got = bench.read_stable(name)
        if got != value:
            raise StageFault(
                "restore", f"{name} was set back to {value:#x} and reads {got:#x}", _BUS_MEND
            )


def _walk(bench: Bench, entry: Register) -> None:
    """One bit at a time, high and low, over the width; other bits must read 0."""
    mask = (1 << entry.width) - 1
    seen: list[tuple[int, int]] = []
    for value in [*(1 << n for n in range(32)), 0xFFFFFFFF, 0]:
        bench.write(entry.name, value)
        seen.append((value & mask, bench.read_expecting(entry.name, value & mask)))
    if all(must == got for must, got in seen):
        return
    high, low = 0, mask  # bits that were ever read 1, and those that always were
    for _, got in seen:
        high, low = high | got, low & got
    stuck0 = [n for n in range(entry.width) if not high >> n & 1]
    stuck1 = [n for n in range(entry.width) if low >> n & 1]
    extra = [n for n in range(entry.width, 32) if high >> n & 1]
    if stuck0 or stuck1:
        bit, level = (stuck0[0], 0) if stuck0 else (stuck1[0], 1)
        told = f"bit {bit} of {entry.name} is stuck at {level}"
    elif extra:
        told = f"bit {extra[0]} of {entry.name} reads 1, and it has {entry.width} bits"
    else:
        must, got = next(pair for pair in seen if pair[0] != pair[1])
        told = f"{entry.name} was written {must:#x} and reads {got:#x}"
    raise StageFault("stuck-bit", told, _BUS_MEND, {"register": entry.name})


def _address_in_data(bench: Bench, rows: list[Register]) -> None:
    """Each register holds a word of its own, all at once: none is another one's alias."""
    held = {}
    for entry in rows:
        held[entry.name] = (entry.address * 0x01000193 ^ entry.address) & ((1 << entry.width) - 1)
        bench.write(entry.name, held[entry.name])
    for entry in rows:
        got = bench.read_expecting(entry.name, held[entry.name])
        if got != held[entry.name]:
            raise StageFault(
                "alias",
                f"{entry.name} held {held[entry.name]:#x} and reads {got:#x} after others were "
                "written",
                "check the decoding of addresses on the bus",
                {"register": entry.name},
            )


def _address_lines(bench: Bench) -> int:
    """Words 0, 1, 2, 4, .. of the pattern memory, and its last, hold words of their own."""
    words = bench.geometry.pattern_bytes // 4
    base = bench.csr.base("pattern_mem")
    places = sorted({0, words - 1, *(1 << n for n in range(words.bit_length()) if 1 << n < words)})
    kept = [bench.bone.read_twice(base + 4 * place)[0] for place in places]
    must = [~(place * 0x9E3779B1) & 0xFFFFFFFF for place in places]
    for place, value in zip(places, must, strict=True):
        bench.bone.write(base + 4 * place, value)
    got = [bench.bone.read_twice(base + 4 * place)[0] for place in places]
    for place, value in zip(places, kept, strict=True):
        bench.bone.write(base + 4 * place, value)
    for place, value, read in zip(places, must, got, strict=True):
        if value != read:
            other = places[must.index(read)] if read in must else None
            told = "" if other is None else f", which is word {other}'s"
            bits = [n for n in range(32) if (value ^ read) >> n & 1]
            raise StageFault(
                "memory",
                f"word {place} of the pattern memory was written {value:#010x} and reads "
                f"{read:#010x}{told} (wrong bits {', '.join(map(str, bits))})",
                "check the address lines of that memory" if other is not None
                else "check that memory's data lines",
            )  # fmt: skip
    return len(places)


def _reset(bench: Bench) -> int:
    """Writes ctrl_reset and holds every register that has a value after it against the table;
    returns how many."""
    before = bench.read("ctrl_uptime")
    bench.write("ctrl_reset", 1)
    values = parameters(bench.geometry)
    compared = 0
    for entry in REGISTERS:
        if entry.mode == "wo" or entry.name in _CHANGE or entry.name.startswith("uart_"):
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
            "reset", "ctrl_uptime began anew with ctrl_reset", "check that counter's reset"
        )
    return compared
