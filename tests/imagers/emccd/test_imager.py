"""The whole EMCCD: frames at their clocks, parameters that wait for the next cycle, sync, serial
line, trace."""

import random

import numpy as np
import pytest

from cosim import InputError
from cosim.clock import PS
from imagers.common.registers import line_of
from imagers.common.scenery import Course, Still
from imagers.emccd.device.controller import DESIGN, PARAMETERS, EmccdSequencer
from imagers.emccd.device.cooling import Cooler, run_cooling
from imagers.emccd.device.imager import Emccd
from imagers.emccd.device.timing import Settings, Timing, frame_clocks
from imagers.emccd.pixels import HighVoltage
from rtl_model.host import Board, Uartbone
from rtl_model.host.csr import device_map
from tests.imagers.vcd import read_vcd
from tests.rtl_model.host.conftest import ModelPort
from tests.rtl_model.registers.checks import faults

NONE = frozenset()
SMALL = Timing(1_000_000, 12, 7, 2, 10, 3, 4, 2, 3)


def still(lux=1.0, course=None):
    return Still(np.full((528, 536), lux), course or Course())


def filmed(camera, until, scene=None, kept=NONE, **more):
    return list(camera.film(scene or still(), until, seed=1, kept=kept, **more))


def small_window(camera, rows=4, steps=1):
    camera.write("rows", rows)
    camera.write("exposure", steps)


def test_frames_come_at_the_sequencers_clocks():
    camera = Emccd()
    small_window(camera)
    frames = filmed(camera, 12 * PS // 1000)
    period = frame_clocks(Timing(), Settings(1, 0, 4)) * 100_000
    assert len(frames) == int(12e9 // period) == 6
    # The writes before power-on's first edge count for the first cycle.
    for n, frame in enumerate(frames):
        assert frame.values.shape == (4, 536)
        assert frame.begin.tolist() == [n * period + 528_000_000] * 4
        assert frame.exposure == 10_000_000
        assert frame.number == n
        assert frame.ready == n * period + (2 * 528 + 10 + 1 + 8) * 1_000_000 + 4 * 56_200_000
    assert camera.read("frames") == 6
    assert camera.now == 12 * PS // 1000


def test_light_of_the_exposure_alone_is_what_a_pixel_counts():
    """Closed form: DN = offset + lux seconds x responsivity x gain / step, without noise; light
    during the readout is cleared by the first transfer."""
    period = frame_clocks(Timing(), Settings(100, 0, 8)) * 100_000
    begin = 528_000_000
    course = Course(
        ((begin, 0.0), (begin, 1.0), (begin + 10**9, 3.0), (begin + 10**9, 0.0),
         (begin + period - 10**9, 50.0), (begin + period - 10**8, 0.0),
         (begin + period, 0.0), (begin + period, 2.0))
    )  # fmt: skip
    camera = Emccd()
    small_window(camera, 8, 100)
    frames = filmed(camera, 2 * period, still(20.0, course))
    pixels = camera.pixels
    gain = HighVoltage().gain(0)
    for frame, factor in zip(frames, (2.0, 2.0), strict=True):
        electrons = 20.0 * factor * 1e-3 * pixels.responsivity * gain
        wanted = pixels.offset + electrons / pixels.step
        assert np.abs(frame.values[:, 12:524] - wanted).max() <= 0.5 + 1e-6
        assert np.abs(frame.values[:, :12] - pixels.offset).max() <= 0.5
        assert wanted > pixels.offset + 1000


@pytest.mark.parametrize("seed", range(3))
def test_a_parameter_written_in_a_frame_changes_nothing_before_the_next_cycle(seed):
    """Random instants and parameters: cycle after cycle has the settings that the registers held
    when it began, so the one that ran was not touched; before and after, times follow from it."""
    rng = random.Random(seed)
    cycles = []
    machine = EmccdSequencer(SMALL, (), cycles.append)
    writes = sorted(
        (rng.randrange(20_000), rng.choice(PARAMETERS[:4]), rng.randrange(1, 12))
        for _ in range(150)
    )
    held = {name: [(-1, machine.registers.read(name))] for name in PARAMETERS}
    machine.registers.set("emccd_exposure", 1)
    held["emccd_exposure"] = [(-1, 1)]
    for edge, name, value in writes:
        machine.advance(edge + 1)
        before = machine.cycle
        work = [machine.registers.read(f"emccd_work_{n}") for n in ("exposure", "rows")]
        machine.registers.write(name, value)
        assert machine.cycle is before
        assert work == [machine.registers.read(f"emccd_work_{n}") for n in ("exposure", "rows")]
        held[name].append((edge, value))
    machine.advance(20_000)
    assert len(cycles) > 20
    changed = 0
    for cycle, later in zip(cycles, [*cycles[1:], None], strict=True):
        at = {n: [v for edge, v in held[n] if edge < cycle.start][-1] for n in PARAMETERS}
        wanted = Settings(
            at["emccd_exposure"], at["emccd_first_row"], at["emccd_rows"], at["emccd_gain"]
        ).within(SMALL)
        assert cycle.settings == wanted
        assert cycle.end - cycle.start == frame_clocks(SMALL, wanted)
        if later is not None:
            assert later.start == cycle.end
            changed += later.settings != cycle.settings
    assert changed > 10


def test_frames_up_to_the_write_are_the_very_same():
    """A light that changes, a parameter at a random instant of frame 1: frames 0 and 1 have the
    pixels and times that they have without it, frame 2 has not."""
    rng = random.Random(8)
    scene = still(30.0, Course(((0, 1.0), (10**10, 2.0))))
    period = frame_clocks(Timing(), Settings(1, 0, 4)) * 100_000

    def camera():
        made = Emccd()
        small_window(made)
        return made

    plain = filmed(camera(), 3 * period, scene)
    for register, value in (("exposure", 9), ("rows", 3), ("first_row", 7), ("gain", 80)):
        other = camera()
        other.write(register, value, at=rng.randrange(period + 1, 2 * period - 100_000))
        frames = filmed(other, 4 * period, scene)
        for a, b in zip(plain[:2], frames[:2], strict=True):
            assert np.array_equal(a.values, b.values)
            assert (a.ready, a.exposure, a.state) == (b.ready, b.exposure, b.state)
        assert frames[2].state != plain[2].state


def command(address, value):
    return bytes([1, 1]) + (address // 4).to_bytes(4, "big") + value.to_bytes(4, "big")


@pytest.mark.parametrize("late", [-2, -1, 0, 1])
def test_over_the_line_the_last_byte_decides(late):
    """The word is strobed a clock after its last byte came whole: at the very edge at which the
    next cycle begins it is too late, one clock sooner it is not."""
    cycles = []
    line = line_of(EmccdSequencer(SMALL, (), cycles.append), byte_clocks=3)
    line.system.target.registers.set("emccd_exposure", 1)
    line.wait(1)
    edge = cycles[0].end
    packet = command(0x300, 5)
    first = edge + late - 3 * (len(packet) - 1)  # so that the last byte comes at edge + late
    line.feed(packet[:-1], first)
    assert line.system.target.registers.read("emccd_exposure") == 1
    line.feed(packet[-1:], edge + late)
    line.wait(3 * edge)
    assert cycles[0].settings.steps == 1
    assert cycles[1].start == edge
    assert cycles[1].settings.steps == (5 if late + 1 < 0 else 1)
    assert cycles[2].settings.steps == 5


def test_the_host_reads_and_writes_it_like_a_board():
    """`rtl_model.host` over the imager's own csr.csv and table; writes are verified."""
    machine = EmccdSequencer()
    port = ModelPort(DESIGN.geometry, bridge=line_of(machine))
    board = Board(Uartbone(port, baud=DESIGN.baud), device_map(DESIGN))
    assert board.identifier() == "Viform emccd 528x536"
    board.write("emccd_exposure", 100)
    board.write("emccd_rows", 64)
    assert board.read("emccd_exposure") == 100
    assert board.read("emccd_work_rows") in (64, 512)
    bone_clock = machine.clock
    port.bridge.wait(bone_clock + 1_000_000)
    port.clock = bone_clock + 1_000_000
    assert board.read("emccd_work_rows") == 64
    assert board.read("emccd_frame_clocks") == frame_clocks(Timing(), Settings(100, 0, 64))
    assert board.read("emccd_frames") > 0
    assert board.read("ctrl_bus_errors") == 0
    with pytest.raises(InputError, match="rw or wo"):
        board.write("emccd_frames", 1)
    with pytest.raises(InputError, match="0x1fff"):
        board.write("emccd_exposure", 1 << 13)


def test_the_table_is_sound():
    assert faults(DESIGN.registers, DESIGN.memories, DESIGN.values) == []


def test_pulses_begin_cycles_and_each_exposure_is_as_long_after_its_pulse():
    pulses = [3 * 10**9 + 7, 10 * 10**9, 10 * 10**9 + 1000, 17 * 10**9 + 99_999]
    camera = Emccd(pulses=pulses)
    camera.write("sync", 1)
    small_window(camera)
    frames = filmed(camera, 25 * 10**9)
    assert [int(frame.begin[0]) // 1000 for frame in frames] == [
        (3 * 10**9 + 100_000 + 528_000_000) // 1000,
        (10 * 10**9 + 528_000_000) // 1000,
        (17 * 10**9 + 100_000 + 528_000_000) // 1000,
    ]
    assert camera.read("pulses_lost") == 1
    assert [frame.state["external"] for frame in frames] == [1.0] * 3


def test_gain_and_temperature_are_the_frames():
    cooler = Cooler()
    run_cooling(cooler, 300.0)
    camera = Emccd(cooler=cooler)
    small_window(camera)
    camera.write("gain", 200)
    camera.write("gain", 100, at=2 * 10**9)
    frames = filmed(camera, 6 * 10**9)
    steps = [frame.state["gain_step"] for frame in frames]
    assert steps[0] == 200.0
    assert steps[-1] == 100.0
    voltage = HighVoltage()
    for frame in frames:
        kelvin = frame.state["kelvin"]
        assert kelvin == pytest.approx(263.15, abs=0.5)
        assert frame.state["gain"] == voltage.gain(int(frame.state["gain_step"]), kelvin)


def test_cut_filming_is_the_same_film():
    scene = still(5.0)
    kept = frozenset({"shot noise", "read noise"})

    def camera():
        made = Emccd()
        small_window(made, 3)
        made.write("gain", 90, at=10**9)
        return made

    whole = filmed(camera(), 5 * 10**9, scene, kept)
    parts, one = [], camera()
    for until in (10**6, 2 * 10**9, 2 * 10**9 + 1, 5 * 10**9):
        parts += filmed(one, until, scene, kept)
    assert len(whole) == len(parts) == 3
    for a, b in zip(whole, parts, strict=True):
        assert np.array_equal(a.values, b.values)
        assert (a.ready, a.number, a.state) == (b.ready, b.number, b.state)


def test_the_trace_of_a_film_is_its_sequence(tmp_path):
    path = tmp_path / "a.vcd"
    camera = Emccd(pulses=[10**9])
    small_window(camera)
    camera.write("sync", 1)
    (frame,) = filmed(camera, 6 * 10**9, trace=path)
    found = read_vcd(path.read_text())
    phase = {value: ps for ps, value in found["phase"][1] if value}
    assert phase[2] == frame.begin[0]
    assert phase[3] == frame.end[0]
    assert [ps for ps, value in found["frame_sync"][1] if not value][-1] == frame.ready
    assert sum(value for _, value in found["line_sync"][1]) == 4
    assert [ps for ps, value in found["sync_in"][1] if value] == [10**9]


@pytest.mark.parametrize(
    ("register", "value", "at", "says"),
    [
        ("none", 1, None, "one of exposure, gain"),
        ("frames", 1, None, "is written"),
        ("rows", 1024, None, "10 bits"),
        ("rows", -1, None, "10 bits"),
        ("rows", 1, 5, "time does not go back"),
    ],
)
def test_a_write_that_cannot_be_is_one_line(register, value, at, says):
    camera = Emccd()
    filmed(camera, 1000)
    with pytest.raises(InputError, match=says) as caught:
        camera.write(register, value, at)
    assert "\n" not in str(caught.value)


def test_a_scene_or_timing_of_another_size_is_refused():
    with pytest.raises(ValueError, match="scene must be"):
        filmed(Emccd(), 1, Still(np.zeros((4, 4))))
    with pytest.raises(ValueError, match="timing must be"):
        Emccd(timing=SMALL)
