"""The EMCCD's sequencer: frame time in closed form, the sequence, the trace and a model that goes
clock by clock all say the same."""

import random

import numpy as np
import pytest

from cosim import InputError
from imagers.common.trace import write_trace
from imagers.emccd.device.controller import EmccdSequencer
from imagers.emccd.device.sequencer import SIGNALS, CounterSequencer, Cycle, signal_changes
from imagers.emccd.device.timing import (
    EXPOSURE_STEPS,
    SIZES,
    Settings,
    Timing,
    after_printed,
    exposure_range,
    frame_clocks,
    frame_rate,
    frame_seconds,
    window_table,
)
from tests.imagers.emccd.trace_counts import counted

SMALL = Timing(1_000_000, 12, 7, 2, 10, 3, 4, 2, 3)
WRITABLE = {
    "emccd_exposure": "steps",
    "emccd_gain": "gain_step",
    "emccd_first_row": "first",
    "emccd_rows": "rows",
    "emccd_sync": "external",
}


def course(changes, names, start, end):
    """{signal: values of every clock from `start` to `end`} from changes in order."""
    steps = {name: {start: 0} for name in names}
    for edge, name, value in changes:
        steps[name][edge] = value
    return {
        name: np.repeat([*found.values()], np.diff([*found, end])) for name, found in steps.items()
    }


def windows():
    rng = random.Random(2)
    yield Settings(1, 0, 1)
    yield Settings(4096, 511, 1)
    yield Settings(200, 0, 512)
    yield Settings(200, 0, 256)  # the document's first window
    yield Settings(200, 100, 128)  # its second, rows 101 to 228
    for _ in range(12):
        first = rng.randrange(512)
        yield Settings(rng.randrange(1, 4097), first, rng.randrange(1, 513 - first))


@pytest.mark.parametrize("settings", list(windows()))
def test_frame_time_is_the_sequences_and_the_traces(settings):
    timing = Timing()
    cycle = Cycle(0, 1234, timing, settings)
    found = counted(cycle)
    names = [signal.name for signal in SIGNALS]
    values = course(signal_changes(cycle), names, cycle.start, cycle.end + 1)
    busy = np.flatnonzero(values["phase"])
    assert busy[-1] - busy[0] + 1 == (values["phase"] > 0).sum() == found.clocks
    assert found.clocks == cycle.end - cycle.start == frame_clocks(timing, settings)
    assert found.exposure == settings.steps * 100 == (values["phase"] == 2).sum()
    assert found.image_shifts == 2 * 528
    assert found.store_shifts == 2 * 528 + 528  # every row leaves the store once
    assert found.rows == settings.rows
    assert found.pixel_clocks == 552 * settings.rows == values["register_clock"].sum()
    assert found.columns == 536 * settings.rows == values["line_sync"].sum()
    assert (found.before, found.after) == (cycle.before, cycle.after)
    assert found.before + settings.rows + found.after == 528


def test_frame_time_by_hand():
    """528 us a transfer, 1 us a clear or a dumped row, 56.2 us a row that is read."""
    assert frame_seconds(Timing(), Settings(200, 0, 512)) == pytest.approx(
        2 * 528e-6 + 2e-3 + 1e-6 + 16e-6 + 512 * 56.2e-6, rel=1e-12
    )
    assert frame_seconds(Timing(), Settings(1, 0, 1)) == pytest.approx(
        2 * 528e-6 + 1e-5 + 1e-6 + 527e-6 + 56.2e-6, rel=1e-12
    )


def test_the_window_table_falls_with_size_and_is_the_machines_own_rate():
    table = window_table()
    assert [rows for rows, _ in table] == list(SIZES)
    rates = [rate for _, rate in table]
    assert rates == sorted(rates)
    for rows, rate in table[2:]:
        begun = []
        machine = EmccdSequencer(begun=begun.append)
        machine.registers.write("emccd_first_row", (512 - rows) // 2)
        machine.registers.write("emccd_rows", rows)
        machine.advance(4 * frame_clocks(Timing(), Settings(200, 0, rows)))
        assert len(begun) == 4
        assert machine.timing.clock_hz / (begun[2].start - begun[1].start) == rate
    assert frame_rate(Timing(), Settings(200, 0, 256)) > 1.7 * rates[0]


def test_the_documents_count_of_rows_leaves_one_standing():
    for first, rows in ((0, 256), (100, 128), (511, 1)):
        cycle = Cycle(0, 0, Timing(), Settings(1, first, rows))
        assert cycle.after - after_printed(cycle.before, rows) == 1


def test_the_shortest_exposure_is_10_us_in_the_trace():
    """From the last shift of the first transfer to the first of the second: a shift's 10 clocks
    and the exposure's 100."""
    cycle = Cycle(0, 0, Timing(), Settings(1, 0, 1))
    rises = [e for e, name, value in signal_changes(cycle) if name == "image_clock" and value]
    gaps = np.diff(rises)
    assert sorted(set(gaps)) == [10, 110]
    assert np.flatnonzero(gaps == 110).tolist() == [527]
    assert counted(cycle).exposure / cycle.timing.clock_hz == 10e-6
    assert exposure_range() == (10e-6, 40.96e-3, 10e-6)
    assert EXPOSURE_STEPS * exposure_range()[2] == exposure_range()[1]


@pytest.mark.parametrize("seed", range(6))
def test_event_by_event_is_clock_by_clock(seed):
    """Random parameters written at random edges, random pulses: every signal of every clock, and
    every counter, as the plain sequencer has it."""
    rng = random.Random(seed)
    timing = SMALL if seed % 2 else Timing(2_000_000, 9, 5, rng.choice((0, 1)), 5, 2, 2, 3, 1)
    clocks = 12_000
    writes = {}
    for _ in range(60):
        name = rng.choice(list(WRITABLE))
        most = {"emccd_exposure": 6, "emccd_gain": 255, "emccd_sync": 1}.get(name, 14)
        writes[rng.randrange(clocks)] = (name, rng.randint(0, most))
    writes[clocks * 2 // 3] = ("emccd_sync", 0)
    pulses = {rng.randrange(clocks) for _ in range(rng.choice((5, 80)))}
    writes[clocks // 2 + 7] = ("emccd_trigger", 1)
    cycles = []
    machine = EmccdSequencer(timing, pulses, cycles.append)
    plain = CounterSequencer(timing)
    machine.registers.set("emccd_exposure", 1)
    held = {"steps": 1}
    plain.written = Settings(**held)
    got, state = [], []
    trigger = False
    for edge in range(clocks):
        got.append(plain.tick(edge in pulses or trigger))
        trigger = False
        state.append((plain.cycles, plain.frames, plain.lost))
        if edge in writes:
            name, value = writes[edge]
            machine.advance(edge + 1)
            assert (
                machine.registers.read("emccd_cycles"),
                machine.registers.read("emccd_frames"),
                machine.registers.read("emccd_pulses_lost"),
                machine.registers.read("emccd_state"),
            ) == (*state[-1], plain.phase)
            machine.registers.write(name, value)
            if name == "emccd_trigger":
                trigger = True
            else:
                held[WRITABLE[name]] = bool(value) if name == "emccd_sync" else value
                plain.written = Settings(**held)
    machine.advance(clocks)
    assert len(cycles) == plain.cycles > 5
    names = [signal.name for signal in SIGNALS]
    changes = [change for cycle in cycles for change in signal_changes(cycle)]
    last = max(cycles[-1].end + 1, clocks)
    values = course(changes, names, 0, last)
    for name in names:
        wanted = np.array([signals[name] for signals in got])
        assert np.array_equal(values[name][:clocks], wanted), name


def test_a_waiting_camera_takes_the_pulse_at_its_edge_and_loses_the_others():
    cycles = []
    machine = EmccdSequencer(SMALL, [5, 40, 5000, 5001], cycles.append)
    machine.registers.write("emccd_sync", 1)
    machine.advance(6000)
    assert [cycle.start for cycle in cycles] == [5, 5000]
    assert cycles[0].end > 40
    assert machine.registers.read("emccd_pulses_lost") == 2
    assert machine.registers.read("emccd_state") in range(8)
    machine.registers.write("emccd_sync", 0)  # frees it
    machine.advance(20_000)
    assert len(cycles) > 3


def test_settings_that_leave_the_camera_are_cut():
    timing = Timing()
    assert Settings(0, 600, 900).within(timing) == Settings(1, 511, 1)
    assert Settings(5000, 500, 100).within(timing) == Settings(4096, 500, 12)
    assert Settings(7, 0, 0).within(timing).rows == 1


@pytest.mark.parametrize(
    "given", [{"clock_hz": 150_000}, {"clock_hz": 0}, {"transfer": 1}, {"line": 500}, {"rows": 16}]
)
def test_a_timing_that_cannot_be_is_one_line(given):
    with pytest.raises(InputError) as caught:
        Timing(**given)
    assert "\n" not in str(caught.value)


def test_rows_wait_in_the_order_in_which_they_leave():
    cycle = Cycle(0, 0, Timing(), Settings(1, 100, 128))
    leaving = cycle.leaving()
    assert (np.diff(leaving) > 0).all()
    assert leaving[0] == cycle.dump_begin
    assert leaving[108] == cycle.read_begin + 10
    assert (np.diff(leaving[108:236]) == 562).all()
    assert leaving[236] == cycle.ready
    assert cycle.waiting()[108] == pytest.approx(528e-6 + 1e-6 + 108e-6 + 1e-6)


def test_the_trace_file_holds_the_sequence(tmp_path):
    cycle = Cycle(0, 0, Timing(), Settings(1, 200, 4))
    clock = cycle.timing.clock
    path = tmp_path / "cycle.vcd"
    changes = ((clock.edge(edge), name, value) for edge, name, value in signal_changes(cycle))
    write_trace(path, SIGNALS, changes, top="emccd")
    text = path.read_text()
    assert text.count("$var wire") == len(SIGNALS)
    assert text.rstrip().rsplit("#", 1)[1].split()[0] == str(clock.edge(cycle.end))
