"""Cycles of a packet and send buffer that follow what a link leaves: closed forms and runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosim import Clock, Viform
from scenarios.assemble.behind.link.coding import Sender
from scenarios.assemble.behind.link.hold import PHASES, Stretch, choose_hold, need_of
from sensor.codec.packets.section import CYCLES, CodeSection
from tests.sensor.codec.packets.streams import steady

SHAPE, LENGTH = (128, 192), 640
CLOCK = Clock(40_000)


@pytest.fixture(scope="module")
def stream() -> Viform:
    rng = np.random.default_rng(4)
    words = steady(0.6 * rng.random(SHAPE), rng.random(SHAPE), LENGTH, 0.15)
    return Viform(words, LENGTH, CLOCK)


def stretch(stream: Viform) -> Stretch:
    return Stretch(
        SHAPE, LENGTH, CLOCK, 1000.0, 0.0,
        lambda first, cycles: stream.words[first // 32 : -(-(first + cycles) // 32)],
    )  # fmt: skip


def sender(section: CodeSection, stream: Viform, carried: float) -> tuple[Any, Viform]:
    """The rate control after the stream, and what it has let through."""
    control = section.control(CLOCK.hz, carried * CLOCK.hz)
    code = section.code(1000.0, 0.0, PHASES)
    return control, Sender(code, SHAPE, LENGTH, control).through(stream)


@pytest.mark.parametrize("load", [0.3, 0.9])
def test_the_need_of_a_queue_is_its_closed_form(load: float) -> None:
    cycles, carried = 64, 1000.0
    even = need_of(np.full(8, load * carried * cycles / 8), cycles, carried)
    assert even.load == pytest.approx(load) and even.excess == 0
    assert even.wait == pytest.approx(load * cycles / 8)
    burst = np.zeros(8)
    burst[3] = load * carried * cycles
    all_at_once = need_of(burst, cycles, carried)
    assert all_at_once.wait == pytest.approx(load * cycles)
    assert all_at_once.excess == pytest.approx(load * cycles - cycles / 8)


def bits_of(stream: Viform, cycles: int) -> float:
    """Bits a cycle of all packets."""
    section = CodeSection(cycles=cycles, tile=32, buffer="1 s")
    control, _ = sender(section, stream, 1e9)
    return 8 * control.statistics["sent_bytes"] / LENGTH


@pytest.mark.parametrize("cycles", [32, 64, 128])
def test_the_shortest_packets_and_the_smallest_buffer_in_which_all_fits_are_taken(
    stream: Viform, cycles: int
) -> None:
    carried = bits_of(stream, cycles) / 0.95
    section, note = choose_hold(CodeSection(tile=32), stretch(stream), carried)
    assert section.cycles == cycles and f"packets of {cycles} cycles: the shortest" in note
    control, left = sender(section, stream, carried)
    assert control.statistics["dropped_packets"] == 0
    assert np.array_equal(left.words, stream.words)
    assert section.buffer is not None and section.buffer * CLOCK.hz < 0.3 * cycles
    step = cycles // PHASES  # what has left is counted when the next packets come
    assert control.buffer.longest <= section.buffer * CLOCK.hz + step
    for less in ({"buffer": section.buffer / 2}, {"cycles": cycles // 2} if cycles > 32 else {}):
        if less:
            control, _ = sender(section.model_copy(update=less), stream, carried)
            assert control.statistics["dropped_packets"] > 0


def test_the_aim_says_what_gives_way(stream: Viform) -> None:
    carried = 0.5 * bits_of(stream, 128)
    found = {}
    for aim in ("picture", "delay"):
        section, note = choose_hold(CodeSection(tile=32, aim=aim), stretch(stream), carried)
        control, left = sender(section, stream, carried)
        assert control.statistics["dropped_packets"] > 0 and "gives way" in note
        wrong = float(np.bitwise_count(left.words ^ stream.words).sum())
        assert section.cycles is not None and section.buffer is not None
        found[aim] = section.cycles + section.buffer * CLOCK.hz, wrong
    assert found["delay"][0] == 40 and found["picture"][0] == 256 + 128
    assert found["picture"][1] < found["delay"][1]


def test_what_is_given_is_kept_and_what_is_unknown_is_not_guessed(stream: Viform) -> None:
    given = CodeSection(cycles=96, buffer="2 ms", tile=32)
    assert choose_hold(given, stretch(stream), 1.0) == (given, "")
    one, note = choose_hold(CodeSection(cycles=96, tile=32), stretch(stream), 1e9)
    assert "packets of 96 cycles, as given: all fits" in note and "shortest" not in note
    assert one.cycles == 96 and one.buffer is not None and one.buffer < 1e-3
    two, _ = choose_hold(CodeSection(buffer="2 ms", tile=32), stretch(stream), 1e9)
    assert (two.cycles, two.buffer) == (32, 2e-3)
    unknown = replace(stretch(stream), sample=lambda first, cycles: None)
    section, _ = choose_hold(CodeSection(), unknown, 1e9)
    assert section.cycles == CYCLES and section.buffer == CYCLES / 2 / CLOCK.hz
    slow, _ = choose_hold(CodeSection(rate="1 Mbit/s", tile=32), stretch(stream), 1e9)
    assert slow.cycles == CYCLES  # the rate of the section holds as well


def test_a_stream_shorter_than_packets_has_some(stream: Viform) -> None:
    short = replace(stretch(stream), cycles=20)
    section, _ = choose_hold(CodeSection(tile=32), short, 1e9)
    assert section.cycles == 32
