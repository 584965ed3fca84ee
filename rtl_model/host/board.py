"""A board's registers by name. The counters of a Viform board check the writes to it."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host.bone import Bone
from rtl_model.host.csr import CsrMap, CsrRegister, default_map, device_map
from rtl_model.host.faults import Cause, LineFault
from rtl_model.registers import MAGIC, VERSION
from rtl_model.registers.design import (
    HEAD,
    IMAGER_MAGIC,
    IMAGER_VERSION,
    NO_DEVICES,
    Device,
    Devices,
)

_HEAD = {register.name: register.address for register in HEAD}
_IDENTIFIER_WORDS = 256  # longest identifier of LiteX
_IDENTIFIER_BLOCK = 16
_CLAMPED = {"capture_pointer"}  # reads less than written if that lies beyond the end
_WORD = 0xFFFFFFFF


class BoardInfo(NamedTuple):
    """Size and build of a Viform board, from its registers.

    Attributes:
        rows, columns, lanes: rows, columns and lanes of the pixel array.
        clock_hz: nominal clock, Hz.
        version: version of the register map.
        build: CRC-32 of Verilog and parameters, 0 if unknown.
        capture_words, sink_words: sizes of the memories, words.
        baud: `clock_hz` divided by the clocks of a bit.
    """

    rows: int
    columns: int
    lanes: int
    clock_hz: int
    version: int
    build: int
    capture_words: int
    sink_words: int
    baud: int

    @property
    def geometry(self) -> Geometry:
        """The parameters of the build."""
        return Geometry(
            self.rows, self.columns, self.lanes, self.clock_hz, self.baud, self.capture_words,
            self.sink_words,
        )  # fmt: skip

    @property
    def build_matches(self) -> bool | None:
        """Whether the CRC-32 is that of this program's Verilog; None if the build has none."""
        from rtl_model.verilated import build_crc  # imports the cycle model, which few hosts need

        return self.build == build_crc(self.geometry) if self.build else None


class ImagerInfo(NamedTuple):
    """Size and build of a conventional imager of this project, from its registers.

    Attributes:
        imager: its name.
        rows, columns: pixels.
        clock_hz: nominal clock, Hz.
        version: version of the register map.
        build: `ctrl_build`.
        baud: `clock_hz` divided by the clocks of a bit.
    """

    imager: str
    rows: int
    columns: int
    clock_hz: int
    version: int
    build: int
    baud: int


def _numbered(devices: Devices, number: int) -> Device | None:
    """The device with this value of `ctrl_imager`."""
    return next((device for device in devices.values() if device.number == number), None)


def recognised(bone: Bone, devices: Devices = NO_DEVICES) -> CsrMap:
    """The register map of the device that the first register names; else the Viform board's.

    Args:
        bone: the host's side of the protocol.
        devices: devices that are recognised.

    Raises LineFault NOT_OURS for another device.
    """
    if bone.read_twice(_HEAD["ctrl_magic"])[0] != IMAGER_MAGIC:
        return default_map()
    number = bone.read_twice(_HEAD["ctrl_imager"])[0]
    device = _numbered(devices, number)
    if device is None:
        raise LineFault(
            Cause.NOT_OURS, f"the board is imager {number}, which this program does not know"
        )
    return device_map(device.design())


class Board:
    """Registers of a board by name.

    Attributes:
        bone: the host's side of the protocol.
        csr: register map of the design; the Viform board's if the argument is None.
        devices: devices that a message names if one of them answers instead.
        verify: whether writes are checked, by the board's counters or by the line's confirmation;
            by default if the design is of this project.
    """

    def __init__(
        self, bone: Bone, csr: CsrMap | None = None, *, verify: bool | None = None,
        devices: Devices = NO_DEVICES,
    ) -> None:  # fmt: skip
        self.bone = bone
        self.devices = devices
        self.csr = default_map() if csr is None else csr
        self.verify = bool(self.csr.table) if verify is None else verify
        self._written: tuple[int, int] | None = None  # count and CRC-32 of words written

    def read(self, name: str) -> int:
        """Reads a register once.

        After a fault the read is repeated only if it has no side effect, which is known for the
        designs of this project only.
        """
        register = self.csr.register(name)
        known = self.csr.table.get(name)
        harmless = known is not None and not known.read_effect
        return self._join(self._words(register, harmless))

    def read_twice(self, name: str) -> int:
        """Reads a register until two consecutive readings agree.

        Raises InputError for a register that changes when it is read.
        """
        register = self.csr.register(name)
        known = self.csr.table.get(name)
        if known is not None and known.read_effect:
            raise InputError(
                "a register that is read twice", "one without a read effect", name, "read it once"
            )
        stride, places = self.csr.stride, range(register.words)
        if stride == 4:
            return self._join(self.bone.read_twice(register.address, register.words))
        return self._join([self.bone.read_twice(register.address + stride * n)[0] for n in places])

    def write(self, name: str, value: int) -> None:
        """Writes a register. A write to a Viform board is checked and, if possible, read again.

        Over a line that confirms writes, that confirmation is the check.

        Raises InputError for a read-only register or a value that is too large; LineFault as
        `verified_write`.
        """
        register = self.csr.register(name)
        known = self.csr.table.get(name)
        width = known.width if known is not None else register.words * self.csr.data_width
        mode = known.mode if known is not None else register.mode
        if mode == "ro":
            raise InputError(
                "a written register", "rw or wo", f"{name}, which is ro", "write another"
            )
        if not 0 <= value < 1 << width:
            raise InputError(name, f"0 to {(1 << width) - 1:#x}", f"{value:#x}", "give less")
        words = self._split(value, register.words)
        if not self.verify:
            self._plain_write(register, words)
        elif name == "uart_clear" and value & 1:
            self._plain_write(register, words)
            if not self.bone.confirms:
                self._expect((0, 0), (0, 0), 0)
        else:
            readable = mode == "rw" and name not in _CLAMPED
            self.verified_write(register.address, words, readback=readable)

    def verified_write(
        self,
        address: int,
        values: Sequence[int],
        *,
        fixed: bool = False,
        readback: bool = False,
    ) -> None:
        """Writes words and checks the board's count and CRC-32 of the written words.

        Raises LineFault SHORT, GARBLED, RESTARTED or MISPLACED. Nothing is written twice.

        Args:
            address: address of the first word, bytes.
            values: words, 32 bits each.
            fixed: whether all are written to the same address.
            readback: whether the words are read again, which also checks the address.
        """
        values = [value & _WORD for value in values]
        if self.bone.confirms:
            self.bone.write(address, values, fixed=fixed)
        else:
            self._counted_write(address, values, fixed)
        if not readback:
            return
        got = self.bone.read(address, len(values))
        if got != values:
            stored = self.bone.read_twice(address, len(values))
            if stored == values:
                self.bone.other_answer(address, got, stored)
            else:
                wrong = sum(one != other for one, other in zip(stored, values, strict=True))
                raise LineFault(
                    Cause.MISPLACED,
                    f"{len(values)} words arrived, but {wrong} of them are not at {address:#x}",
                )

    def _counted_write(self, address: int, values: list[int], fixed: bool) -> None:
        """Writes words, whose count and CRC-32 must then be the board's."""
        if self._written is None:
            self._written = self._counters()
        count, crc = before = self._written
        self._written = None  # unknown until the check
        self.bone.write(address, values, fixed=fixed)
        data = b"".join(value.to_bytes(4, "big") for value in values)
        after = (count + len(values) & _WORD, zlib.crc32(data, crc))
        self._expect(after, before, len(values))

    def forget_counters(self) -> None:
        """Reads the count of written words again before the next checked write.

        Must be called after words were written without this object.
        """
        self._written = None

    def identifier(self) -> str:
        """The design's identifier, one character a word up to the NUL; `?` for characters that are
        not printable ASCII."""
        base, text = self.csr.base("identifier_mem"), ""
        while len(text) < _IDENTIFIER_WORDS:
            # A Viform board counts a bus error beyond the NUL, so it is read word by word.
            block = 1 if text and self.csr.table else _IDENTIFIER_BLOCK
            for value in self.bone.read_twice(base + 4 * len(text), block):
                if value & 0xFF == 0:
                    return text
                text += chr(value & 0xFF) if 32 <= value & 0xFF < 127 else "?"
        return text

    def confirm(self) -> None:
        """Checks the first register of a Viform board or imager before anything is written.

        A design that only its csr.csv describes has no such register and passes. Raises LineFault
        NOT_OURS.
        """
        if not (self.csr.is_viform_board or self.csr.imager):
            return
        expected = IMAGER_MAGIC if self.csr.imager else MAGIC
        magic = self.read_twice("ctrl_magic")
        if magic != expected:
            raise LineFault(
                Cause.NOT_OURS,
                f"the board's first register is {magic:#010x}, not {expected:#010x}: another "
                "design answers, and nothing was written to it",
            )

    def info(self) -> BoardInfo:
        """Size and build of a Viform board.

        Raises LineFault NOT_OURS if another design or another version is loaded.
        """
        magic = self.read_twice("ctrl_magic") if "ctrl_magic" in self.csr.registers else 0
        if magic != MAGIC or not self.csr.is_viform_board:
            raise LineFault(
                Cause.NOT_OURS, f"the board's first register is {magic:#010x}, not {MAGIC:#010x}"
            )
        version = self.read_twice("ctrl_version")
        if version >> 16 != VERSION >> 16:
            raise LineFault(
                Cause.NOT_OURS,
                f"the board's register map is version {version >> 16}.{version & 0xFFFF}, "
                f"this program's is {VERSION >> 16}",
            )
        rows, columns, clock_hz, baud = self._head()
        return BoardInfo(
            rows=rows,
            columns=columns,
            lanes=self.read_twice("ctrl_lanes"),
            clock_hz=clock_hz,
            version=version,
            build=self.read_twice("ctrl_build"),
            capture_words=self.read_twice("capture_size"),
            sink_words=self.read_twice("sink_size"),
            baud=baud,
        )

    def imager_info(self) -> ImagerInfo:
        """Size and build of the imager whose register map this board has.

        Raises LineFault NOT_OURS if another design or another version answers.
        """
        magic, version = self.read_twice("ctrl_magic"), self.read_twice("ctrl_version")
        number = self.read_twice("ctrl_imager") if magic == IMAGER_MAGIC else None
        imager = self.csr.imager
        if (
            imager is None or number is None or number != self.csr.number
            or version >> 16 != IMAGER_VERSION >> 16
        ):  # fmt: skip
            answers = None if number is None else _numbered(self.devices, number)
            raise LineFault(
                Cause.NOT_OURS,
                f"the design is {answers.name if answers else f'{magic:#010x}'}, version "
                f"{version >> 16}, not {imager}, version {IMAGER_VERSION >> 16}",
            )
        rows, columns, clock_hz, baud = self._head()
        build = self.read_twice("ctrl_build")
        return ImagerInfo(imager, rows, columns, clock_hz, version, build, baud)

    def _head(self) -> tuple[int, int, int, int]:
        """Rows, columns, clock (Hz) and nominal baud."""
        size = self.read_twice("ctrl_geometry")
        clock_hz = self.read_twice("ctrl_clock_hz")
        bit = max(1, self.read_twice("uart_bit_clocks"))
        return size >> 16, size & 0xFFFF, clock_hz, (clock_hz + bit // 2) // bit

    def _words(self, register: CsrRegister, harmless: bool) -> list[int]:
        if self.csr.stride == 4:
            return self.bone.read(register.address, register.words, retry=harmless)
        places = [register.address + self.csr.stride * n for n in range(register.words)]
        return [self.bone.read(place, retry=harmless)[0] for place in places]

    def _plain_write(self, register: CsrRegister, words: list[int]) -> None:
        if self.csr.stride == 4:
            self.bone.write(register.address, words)
            return
        for n, word in enumerate(words):
            self.bone.write(register.address + self.csr.stride * n, word)

    def _counters(self) -> tuple[int, int]:
        count, crc = self.bone.read_twice(self.csr.register("uart_writes").address, 2)
        return count, crc

    def _expect(self, after: tuple[int, int], before: tuple[int, int], sent: int) -> None:
        """Compares the counters with their expected values.

        One matching reading is sufficient, because a changed one does not match.
        """
        place = self.csr.register("uart_writes").address
        count, crc = first = self.bone.read(place, 2)
        if (count, crc) != after:
            count, crc = self._counters()
        self._written = (count, crc)
        if (count, crc) == after:
            if first != [count, crc]:
                self.bone.other_answer(place, first, [count, crc])
            return
        arrived = count - before[0] & _WORD
        if count < before[0] and after[0] >= before[0]:
            cause, what = Cause.RESTARTED, f"its count of words fell from {before[0]} to {count}"
        elif arrived < sent:
            cause, what = Cause.SHORT, f"{arrived} of {sent} words arrived at the board"
        elif arrived > sent:
            cause, what = Cause.GARBLED, f"{arrived} words arrived at the board, {sent} were sent"
        else:
            cause, what = Cause.GARBLED, f"the {sent} words arrived at the board are not those sent"
        raise LineFault(cause, f"a write failed: {what}")

    def _join(self, words: Sequence[int]) -> int:
        value, width = 0, self.csr.data_width
        for word in words:
            value = value << width | word & ((1 << width) - 1)
        return value

    def _split(self, value: int, words: int) -> list[int]:
        width = self.csr.data_width
        mask = (1 << width) - 1
        return [value >> width * n & mask for n in reversed(range(words))]
