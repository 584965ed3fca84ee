"""An imager's registers over the serial line: the same bytes, addresses and counters as the
board's."""

import csv
import io
import random

import pytest

from cosim import InputError
from imagers.catalogue import kind_of
from imagers.common.registers import RegisterFile, line_of
from rtl_model.registers import REGISTERS, Register
from rtl_model.registers.design import HEAD, IMAGER_MAGIC, Design
from tests.rtl_model.registers.checks import faults

SPECIFIC = (
    Register("toy_now", 0x300, "rw", 5, 8, "taken at once"),
    Register("toy_frame", 0x304, "rw", 6, 8, "taken with a frame"),
    Register("toy_cycle", 0x308, "rw", 7, 12, "taken with a cycle"),
    Register("toy_strobe", 0x30C, "wo", 0, 4, "does something"),
    Register("toy_count", 0x310, "ro", 0, 32, "edges run"),
    Register("toy_once", 0x314, "ro", 0, 8, "next number", read_effect=True),
)
DESIGN = Design(
    "toy",
    9,
    "a toy",
    (3, 40),
    1_000_000,
    SPECIFIC,
    {"toy_frame": "frame", "toy_cycle": "cycle"},
    50_000,
)


class Toy:
    """Counts edges, and takes what waits every 100 (frame) and 1000 (cycle) of them."""

    def __init__(self):
        self.registers = RegisterFile(DESIGN)
        self.clock = self.next = 0
        self.strobes = []
        self.registers.on_read |= {"toy_count": lambda: self.clock, "toy_once": self.once}
        self.registers.on_write["toy_strobe"] = self.strobes.append

    def once(self):
        self.next += 1
        return self.next

    def advance(self, clock):
        for when, every in (("frame", 100), ("cycle", 1000)):
            if (self.clock - 1) // every != (clock - 1) // every and clock > self.clock:
                self.registers.update(when)
        self.clock = max(clock, self.clock)

    def reset(self, clock):
        self.advance(clock)


def command(code, address, words, data=()):
    packet = bytes([code, words]) + (address // 4).to_bytes(4, "big")
    return packet + b"".join(value.to_bytes(4, "big") for value in data)


def ask(line, address, clock):
    """One word, asked for when the line is free."""
    clock = max(clock, line.system.clock + 100)
    return int.from_bytes(line.feed(command(2, address, 1), clock).data, "big")


def test_the_table_is_sound_and_its_head_stands_where_the_boards_does():
    assert faults(DESIGN.registers, DESIGN.memories, DESIGN.values) == []
    board = {entry.name: entry for entry in REGISTERS}
    for entry in HEAD:
        if entry.name != "ctrl_imager":
            assert entry.address == board[entry.name].address
            assert (entry.mode, entry.width) == (board[entry.name].mode, board[entry.name].width)
    assert "ctrl_imager" not in board
    assert 0x028 not in {entry.address for entry in REGISTERS}


@pytest.mark.parametrize(
    ("specific", "updates"),
    [
        ((SPECIFIC[0]._replace(address=0x2FC),), {}),
        (SPECIFIC, {"toy_count": "frame"}),
        (SPECIFIC, {"toy_none": "frame"}),
    ],
)
def test_a_design_that_cannot_be_is_refused(specific, updates):
    with pytest.raises(ValueError, match=r"must stand at|no register"):
        Design("toy", 9, "", (3, 40), 1_000_000, specific, updates)


def test_what_is_written_reads_back_at_once_and_works_when_it_is_taken():
    file = RegisterFile(DESIGN)
    for name in ("toy_now", "toy_frame", "toy_cycle"):
        file.write(name, 0xFFFF)
    file.write("toy_count", 3)
    assert [file.read(entry.name) for entry in SPECIFIC] == [0xFF, 0xFF, 0xFFF, 0, 0, 0]
    assert [file.active(n) for n in ("toy_now", "toy_frame", "toy_cycle")] == [0xFF, 6, 7]
    assert file.update("frame")
    assert not file.update("frame")
    assert (file.active("toy_frame"), file.active("toy_cycle")) == (0xFF, 7)
    assert file.update("cycle")
    assert file.active("toy_cycle") == 0xFFF
    file.set("toy_count", 1 << 40 | 8)
    assert file.read("toy_count") == 8
    file.reset()
    assert [file.active(n) for n in ("toy_now", "toy_frame", "toy_cycle")] == [5, 6, 7]
    with pytest.raises(KeyError):
        file.write("toy_none", 0)


def test_bytes_on_the_line_read_and_write_as_on_the_board():
    toy = Toy()
    line = line_of(toy, byte_clocks=10)
    reply = line.feed(command(2, 0x000, 2), 0)
    assert reply.data == IMAGER_MAGIC.to_bytes(4, "big") + (0x12345678).to_bytes(4, "big")
    # A write is strobed one clock after its last byte came; its first byte came at clock 1000.
    line.feed(command(1, 0x300, 3, (0x1AA, 0xBB, 0xCC)), 1000)
    last = 1000 + 17 * 10
    assert toy.registers.active("toy_now") == 0xAA
    assert toy.registers.active("toy_cycle") == 7
    line.wait(1101 + 100)  # edge 1200 takes what waits for a frame
    assert toy.registers.active("toy_frame") == 0xBB
    line.wait(2000)
    assert toy.registers.active("toy_cycle") == 7
    line.wait(2001)
    assert toy.registers.active("toy_cycle") == 0xCC
    assert last < 1200
    assert [ask(line, 0x314, 3000), ask(line, 0x314, 3000)] == [1, 2]
    assert ask(line, 0x310, 3500) == 3500 + 50 + 2  # two clocks after the request's last byte
    line.feed(command(3, 0x30C, 2, (1, 0x1F)), 4000)
    assert toy.strobes == [1, 0xF]


def test_a_write_at_the_very_edge_is_seen_by_later_edges_only():
    for late in (0, 1):
        toy = Toy()
        line = line_of(toy, byte_clocks=1)
        packet = command(1, 0x308, 1, (0xCC,))
        line.feed(packet, 2000 - 1 - len(packet) + late)  # strobed at edge 1999, or at 2000
        line.wait(2001)
        assert toy.registers.active("toy_cycle") == (7 if late else 0xCC)


def test_counters_of_the_line_and_of_the_bus():
    toy = Toy()
    line = line_of(toy, byte_clocks=1)
    line.feed(command(1, 0x004, 1, (0xDEADBEEF,)), 10)
    line.feed(command(1, 0x2FC, 1, (1,)), 100)  # no such register
    line.feed(command(2, 0x7FC, 1), 200)
    words = [ask(line, address, 300) for address in (0x020, 0x114, 0x100)]
    assert words == [2, 2, 10 + 10 + 6 + 18]
    line.feed(command(1, 0x01C, 1, (1,)), 1400)  # ctrl_reset
    words = [ask(line, address, 1500) for address in (0x004, 0x114, 0x020)]
    assert words == [0x12345678, 3, 0]
    line.feed(command(1, 0x124, 1, (1,)), 2600)  # uart_clear
    assert ask(line, 0x114, 2700) == 0
    assert ask(line, 0x024, 3000) == 3000 + 5 + 2


def test_random_bytes_change_nothing_beyond_what_they_say():
    """Garbage ends in counts; after 100 ms of silence the imager answers again."""
    rng = random.Random(5)
    toy = Toy()
    line = line_of(toy, byte_clocks=1)
    clock = 0
    for _ in range(200):
        data = rng.randbytes(rng.randrange(1, 40))
        line.feed(data, clock)
        clock = line.system.clock + rng.choice((1, 50, 110_000))
    clock = line.system.clock + 110_000
    line.wait(clock)
    reply = line.feed(command(2, 0x000, 1), clock)
    assert reply.data == IMAGER_MAGIC.to_bytes(4, "big")


def test_csr_csv_is_litex_form_and_names_the_imager():
    rows = list(csv.reader(io.StringIO(DESIGN.csr_csv())))
    assert {len(row) for row in rows} == {5}
    named = {row[1]: row for row in rows}
    assert named["toy_cycle"][2:] == ["0x00000308", "1", "rw"]
    assert named["identifier_mem"][:3] == ["csr_base", "identifier_mem", "0x00000800"]
    assert named["config_viform_imager"][2] == "toy"
    assert named["config_clock_frequency"][2] == "1000000"
    assert "toy_frame` | rw | 8 | 0x6 | taken with a frame; takes effect with the next frame" in (
        DESIGN.document()
    )


def imagers():
    from imagers.adaptive.device.imager import AdaptiveExposure
    from imagers.adaptive.pixels import AdaptivePixels
    from imagers.ebaps.device.imager import Ebaps
    from imagers.ebaps.pixels import EbapsPixels
    from imagers.emccd.device.imager import Emccd

    return {
        "adaptive": AdaptiveExposure(AdaptivePixels((4, 4))),
        "ebaps": Ebaps(EbapsPixels((8, 8))),
        "emccd": Emccd(),
    }


@pytest.mark.parametrize("kind", ["adaptive", "ebaps", "emccd"])
def test_every_imager_refuses_a_write_in_the_same_words(kind):
    """The first writable register and the first that is only read, by full and by short name."""
    imager = imagers()[kind]
    table = [entry for entry in entries(imager) if entry.name.startswith(kind)]
    wide = next(entry for entry in table if entry.mode == "rw")
    ro = next(entry for entry in table if entry.mode == "ro")
    most = (1 << wide.width) - 1
    for name in (wide.name, wide.name.removeprefix(f"{kind}_")):
        imager.write(name, most)
        assert imager.read(name) == most
        for value in (most + 1, -1):
            with pytest.raises(InputError) as told:
                imager.write(name, value)
            assert str(told.value) == (
                f"{name} must be 0 to {most}, not {value}; it has {wide.width} bits"
            )
    assert imager.read(wide.name) == most
    with pytest.raises(InputError) as told:
        imager.write(ro.name, 0)
    assert str(told.value) == (
        f"{ro.name} must be a register that is written, not one that is only read; write another"
    )
    for act in (lambda: imager.write("nothing", 0), lambda: imager.read("nothing")):
        with pytest.raises(InputError, match=r"one of .*, not 'nothing'; choose one"):
            act()


def entries(imager):
    for place in ("controller", "sequencer", "machine"):
        if hasattr(imager, place):
            return getattr(imager, place).registers.design.specific
    raise AssertionError(imager)


@pytest.mark.parametrize("kind", ["adaptive-exposure", "ebaps", "emccd"])
def test_the_line_cuts_what_does_not_fit(kind):
    """The same registers over the serial line, where nothing can be refused."""
    made = kind_of(kind).bus_target()
    own = made.registers.design.specific
    wide = next(entry for entry in own if entry.mode == "rw" and entry.width < 32)
    ro = next(entry for entry in own if entry.mode == "ro")
    line = line_of(made, byte_clocks=1)
    before = ask(line, ro.address, 100)
    line.feed(command(1, wide.address, 1, ((1 << wide.width) + 5,)), line.system.clock + 100)
    assert ask(line, wide.address, 0) == 5 & ((1 << wide.width) - 1)
    line.feed(command(1, ro.address, 1, (before + 1,)), line.system.clock + 100)
    assert ask(line, 0x020, 0) == 0  # no error of the bus
