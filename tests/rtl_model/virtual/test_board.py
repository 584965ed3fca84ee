"""The virtual board as a host sees it: registers, time, faults, at every level."""

from __future__ import annotations

import os
import time
import zlib
from pathlib import Path

import pytest

from cosim import InputError
from rtl_model.virtual import Level, VirtualBoard
from rtl_model.virtual.design_faults import FOREIGN_MAGIC
from rtl_model.virtual.served import LINGER_S
from tests.rtl_model.virtual.hosts import (
    LEVELS,
    MAGIC_BYTES,
    PLANTED,
    SMALL,
    Host,
    board,
    needs_verilator,
    pass_time,
)


@pytest.mark.parametrize("level", LEVELS)
def test_registers_are_read_and_written(level: Level) -> None:
    with board(level) as (_, host):
        assert host.ask("ctrl_magic", 4)[:4] == MAGIC_BYTES
        host.write("ctrl_scratch", 0xCAFEF00D)
        assert host.read("ctrl_scratch") == 0xCAFEF00D
        assert host.read("ctrl_geometry") == SMALL.rows << 16 | SMALL.columns
        assert host.read("uart_writes_crc") == zlib.crc32(bytes.fromhex("cafef00d"))
        assert len(host.ask("ctrl_magic", 0, command=4)) == 1024  # length 0 is 256 words


@pytest.mark.parametrize("level", LEVELS)
def test_a_burst_is_over_while_the_host_waits(level: Level) -> None:
    """All pixels fire in each frame: level 0 is 255 electrons."""
    with board(level) as (_, host):
        for name, value in (("sensor_pattern", 1), ("sensor_level", 255), ("sensor_threshold", 0)):
            host.write(name, value)
        host.write("capture_arm", 3)
        host.write("sensor_run", 1)
        host.until("capture_state", 4)
        host.write("sensor_run", 0)
        assert host.read("capture_rows") == 3 * SMALL.rows
        words = [host.read("capture_data") for _ in range(SMALL.record_words)]
        assert words[2:4] == [0xFFFFFFFF, 0xFF]
        body = b"".join(word.to_bytes(4, "big") for word in words[:-1])
        assert words[-1] == zlib.crc32(body)


@pytest.mark.parametrize("level", LEVELS)
def test_half_a_request_is_cut_by_the_watchdog(level: Level) -> None:
    with board(level) as (made, host):
        host.send(2, 1, 0)
        pass_time(made, 0.2)
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        assert host.read("uart_watchdog_aborts") == 1


@pytest.mark.parametrize("level", LEVELS)
def test_a_lost_byte_is_silence_and_then_the_board_is_well(level: Level) -> None:
    with board(level, "drop:rx@8") as (made, host):
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        asked = made.clock
        assert host.ask("ctrl_magic", short=True) == b""
        pass_time(made, 0.2, since=asked)
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        assert host.read("uart_watchdog_aborts") == 1


@pytest.mark.parametrize("level", LEVELS)
def test_answers_lose_gain_and_turn_bytes(level: Level) -> None:
    with board(level, "drop:tx@2", "extra:tx@8", "flip:tx@10") as (_, host):
        assert host.ask("ctrl_magic", short=True) == MAGIC_BYTES[:1] + MAGIC_BYTES[2:]
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        assert host.answer(1) == MAGIC_BYTES[3:]  # the byte that came twice
        got = int.from_bytes(host.ask("ctrl_magic"), "big")
        wrong = got ^ int.from_bytes(MAGIC_BYTES, "big")
        assert wrong.bit_count() == 1
        assert wrong & 0x00FF0000


@pytest.mark.parametrize("level", LEVELS)
def test_a_cut_write_is_not_done(level: Level) -> None:
    with board(level, "cut@17") as (made, host):
        host.write("ctrl_scratch", 1)
        host.write("ctrl_scratch", 2)  # its seventh byte does not come
        pass_time(made, 0.25)
        assert host.read("ctrl_scratch") == 1
        assert host.read("uart_watchdog_aborts") == 1


@pytest.mark.parametrize("level", LEVELS)
def test_a_cut_answer_stops(level: Level) -> None:
    with board(level, "cut:tx@6") as (_, host):
        assert host.ask("ctrl_magic", 3, short=True) == (MAGIC_BYTES + b"\x12\x34\x56\x78")[:5]
        assert host.ask("ctrl_magic") == MAGIC_BYTES


@pytest.mark.parametrize("level", LEVELS)
def test_power_is_lost(level: Level) -> None:
    with board(level, "power-cycle@23") as (made, host):
        host.write("ctrl_scratch", 1)
        before = host.read("ctrl_scratch"), host.read("ctrl_uptime")
        assert host.ask("ctrl_scratch", short=True) == b""  # its first byte is the 23rd
        pass_time(made, 0.25, since=0)
        assert before[0] == 1
        assert host.read("ctrl_scratch") == 0x12345678
        assert host.read("uart_rx_bytes") == 12


@pytest.mark.parametrize("level", LEVELS)
def test_a_silent_board_and_a_slow_one(level: Level) -> None:
    with board(level, "silent") as (_, host):
        assert host.ask("ctrl_magic", short=True) == b""
    with board(level, "slow=50") as (_, host):
        begun = time.monotonic()
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        assert time.monotonic() - begun >= 0.05


@pytest.mark.parametrize("level", PLANTED)
def test_another_design_answers_with_another_word(level: Level) -> None:
    with board(level, "foreign") as (_, host):
        assert host.read("ctrl_magic") == FOREIGN_MAGIC
        assert host.read("ctrl_scratch") == 0x12345678


@pytest.mark.parametrize("level", PLANTED)
def test_stuck_pixels_show_and_are_counted(level: Level) -> None:
    """In the dark only the pixel stuck at 1 fires; in light all but the one stuck at 0."""
    with board(level, "stuck=3,33", "stuck=5,2,0") as (_, host):
        host.write("capture_arm", 1)
        host.write("sensor_run", 1)
        host.write("sensor_run", 0)
        host.until("capture_state", 4)
        # As many frames as there was time for: the board's clock goes on between two packets.
        frames = host.until_scanned()
        assert host.read("sensor_spikes") == frames >= 1
        host.write("capture_pointer", 3 * SMALL.record_words + 2)
        assert [host.read("capture_data") for _ in range(2)] == [0, 2]
        for name, value in (("sensor_pattern", 1), ("sensor_level", 255), ("sensor_threshold", 0)):
            host.write(name, value)
        host.write("sensor_clear", 1)
        host.write("capture_arm", 1)
        host.write("sensor_run", 1)
        host.write("sensor_run", 0)
        host.until("capture_state", 4)
        frames = host.until_scanned()
        assert host.read("sensor_spikes") == frames * (SMALL.rows * SMALL.columns - 1)
        host.write("capture_pointer", 5 * SMALL.record_words + 2)
        assert [host.read("capture_data") for _ in range(2)] == [0xFFFFFFFB, 0xFF]


def test_a_board_left_alone_rests_and_its_clock_goes_on() -> None:
    with board("model") as (_, host):
        first = host.read("ctrl_uptime")
        time.sleep(1.5 * LINGER_S)
        before = time.process_time()
        time.sleep(0.5)
        assert time.process_time() - before < 0.3  # processor time: at rest it takes a twentieth
        assert host.read("ctrl_uptime") > first + LINGER_S * SMALL.clock_hz


def test_the_link_is_made_and_removed(tmp_path: Path) -> None:
    link = tmp_path / "tty"
    with VirtualBoard(SMALL, level="model", link=link) as made:
        assert made.port == str(link)
        host = Host(made.port, 57_600, 2.0)  # bytes know no baud
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        host.close()
        host = Host(made.port, 57_600, 2.0)  # a host may come back
        assert host.ask("ctrl_magic") == MAGIC_BYTES
        with pytest.raises(InputError, match="which exists"):
            VirtualBoard(SMALL, level="model", link=link).start()
    assert not os.path.lexists(link)
    link.symlink_to("/dev/pts/no-such")  # an ended board's
    with VirtualBoard(SMALL, level="model", link=link):
        assert os.readlink(link) != "/dev/pts/no-such"
    link.write_text("mine")
    with pytest.raises(InputError, match="which exists"):
        VirtualBoard(SMALL, level="model", link=link).start()
    assert link.read_text() == "mine"


def test_a_byte_level_board_has_no_baud_to_be_wrong() -> None:
    with pytest.raises(InputError, match="level pins"):
        VirtualBoard(SMALL, level="model", faults=["baud=6"])


@needs_verilator
@pytest.mark.parametrize("error", [0.0, 4.0, -4.0, 6.0, -6.0])
def test_four_percent_of_baud_are_well_and_six_are_not(error: float) -> None:
    """The last data bit is sampled 8.5 bits after the start of its byte, where 4 % are a third of a
    bit, and 6 % more than half a bit."""
    with board("pins", f"baud={error}") as (_, host):
        host.write("ctrl_scratch", 0x5AA5C33C)
        answers = [host.ask(name, short=True) for name in ("ctrl_magic", "ctrl_scratch")]
    well = [MAGIC_BYTES, bytes.fromhex("5aa5c33c")]
    assert (answers == well) == (abs(error) < 5)


@needs_verilator
def test_the_baud_is_the_one_the_host_has_set() -> None:
    for error, well in ((1.0, True), (1.035, True), (0.965, True), (1.08, False)):
        baud = round(SMALL.baud * error)
        with board("pins", baud=baud) as (_, host):
            assert (host.ask("ctrl_magic", short=True) == MAGIC_BYTES) == well


@needs_verilator
def test_six_percent_garble_the_answer_as_well() -> None:
    """A host with an error of 4 % sends the request. An answer is right at 4 %, and wrong at 6 % if
    the last bits of a byte are 1 and 0. Both directions of the line behave alike."""
    with board("pins", "baud=4") as (made, host):
        host.write("ctrl_scratch", 0x40404040)
        assert host.ask("ctrl_scratch") == b"@@@@"
        host.speak_at(round(SMALL.baud * 1.06 / 1.04))
        host.send(2, 1, 0, 0, 0, 1)
        assert host.answer(4, short=True) != b"@@@@"
        assert made.alive


@needs_verilator
def test_noise_is_seen_and_survived() -> None:
    with board("pins", "noise=0.002") as (made, host):
        wanted = MAGIC_BYTES + b"\x12\x34\x56\x78"
        right = []
        for _ in range(12):
            right.append(host.ask("ctrl_magic", 2, short=True) == wanted)
            if not right[-1]:  # silence brings both ends together again
                pass_time(made, 0.15)
                host.forget()
    assert any(right)
    assert not all(right)
