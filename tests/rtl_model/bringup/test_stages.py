"""The bring-up on boards of the cycle model: a good board passes, each fault fails its stage."""

import pytest

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.deadline import DeadlinePort, OutOfTime
from rtl_model.bringup.bench.stage import STAGES, Stage
from rtl_model.bringup.one_stage import Uptime
from rtl_model.bringup.report.page import junit_xml
from rtl_model.bringup.report.summary import stage_text
from rtl_model.bringup.run import CHECKS, BringUp, bring_up
from rtl_model.bringup.stages.identity import check_identity
from rtl_model.host import ReplayPort, Uartbone, default_map, read_csr
from rtl_model.verilated import build_crc
from tests.rtl_model.bringup.faulty_ports import SIZE, Changed, Console, Echo, EveryByte, Silent
from tests.rtl_model.bringup.model_port import ModelPort


def brought_up(port, note=lambda text: None, **more):
    return bring_up(port, BringUp(**{"simulated": True, "frames": 6} | more), note=note)


def changed(address, make):
    port = Changed(SIZE)
    port.changed = {address: make}
    return port


@pytest.fixture(scope="module")
def good():
    return brought_up(ModelPort(SIZE), simulated=False)


def test_a_good_board_passes_every_stage(good):
    assert good.ok and good.cause is None
    assert [stage.name for stage in good.stages] == list(STAGES)
    assert good.figure("patterns", "bits_wrong") == 0
    assert good.figure("patterns", "frames_compared") == 4 * 6
    assert good.figure("threshold", "settings") == 96
    assert good.figure("counters", "bytes_counted") == good.figure("counters", "bytes_sent")


def test_the_clock_is_measured_within_its_doubt(good):
    ppm, doubt = good.figure("timing", "clock_error_ppm"), good.figure("timing", "clock_doubt_ppm")
    assert abs(ppm) <= doubt < 1000  # the model's clock is the host's


def test_thresholds_are_swept_as_the_closed_form_says(good):
    rates = good.figure("threshold", "rates")
    hard = {r["level"]: r["rate"] for r in rates if r["clock"] == 0 and r["rule"] == "hard"}
    assert hard[0] == pytest.approx(1 / 2, abs=0.02)  # 200 + 200 reach 255
    assert all(r["rate"] == r["expected"] for r in rates)


@pytest.mark.slow
def test_a_simulated_board_is_reported_as_one():
    report = brought_up(ModelPort(SIZE))
    assert "simulated" in report.figure("timing", "note")
    assert report.figure("timing", "clock_error_ppm") is None


@pytest.mark.slow
@pytest.mark.parametrize("error", [4, -4])
def test_four_percent_of_baud_work(error):
    assert brought_up(ModelPort(SIZE, baud_error=error / 100)).ok


@pytest.mark.parametrize(("error", "rate", "side"), [(6, 122112, "above"), (-6, 108288, "below")])
def test_six_percent_of_baud_are_measured(error, rate, side, tmp_path):
    log = tmp_path / "line.jsonl"
    report = brought_up(ModelPort(SIZE, baud_error=error / 100), log=log)
    assert (report.failed_stage, report.failed.kind) == ("bytes", "baud")
    measured = report.failed.figures["baud_measured"]
    assert measured == pytest.approx(rate, rel=0.002)  # half a board clock of a bit's 417
    figures = report.failed.figures
    assert abs(figures["baud_error_percent"] - error) <= figures["baud_uncertainty_percent"] < 0.2
    assert f"{abs(figures['baud_error_percent']):.1f} % {side} 115 200 (+-" in report.cause
    assert f"--baud {measured}" in report.cause
    again = brought_up(ReplayPort(log))  # the search is in the log as well
    assert again.failed.figures == report.failed.figures


class Delayed(ModelPort):
    """Answers 200 ms late."""

    def answer(self, data, clocks):
        super().answer(data, [clock + SIZE.clock_hz // 5 for clock in clocks])


def test_a_long_bring_up_is_announced():
    notes = []
    brought_up(Delayed(SIZE), note=notes.append)
    assert notes[0].startswith("an answer takes 201 ms, so the bring-up takes about 8 minutes")
    notes.clear()
    brought_up(ModelPort(SIZE), note=notes.append)
    assert notes == []


@pytest.mark.parametrize("host", [9_600, 57_600, 230_400, 921_600])
def test_another_standard_rate_is_named(host):
    report = brought_up(ModelPort(SIZE, baud=host, baud_error=0.01), baud=host)
    assert (report.failed_stage, report.failed.kind) == ("bytes", "baud")
    rate = f"{host:,}".replace(",", " ")
    assert f"the board answers at 115 200 baud, and the host sends at {rate}" in report.cause
    assert report.cause.endswith("give --baud 115200")


@pytest.mark.parametrize(
    ("make", "stage", "kind", "says"),
    [
        (lambda: Silent(SIZE), "bytes", "silent", "nothing came back"),
        (lambda: Echo(SIZE), "bytes", "echo", "sent back the bytes of the request"),
        (lambda: Console(SIZE), "bytes", "text", "login:"),
        (lambda: changed(0, lambda v: 0xCAFE), "identity", "foreign", "another design"),
        (lambda: changed(8, lambda v: v + 0x10000), "identity", "version", "2.2"),
        (lambda: changed(0xC, lambda v: v ^ 1), "identity", "identifier", "4 x 41"),
        (lambda: changed(0x10, lambda v: 48), "identity", "geometry", "48 lanes"),
        (lambda: changed(0x324, lambda v: v | 8), "registers", "stuck-bit",
         "bit 3 of sensor_level is stuck at 1"),
        (lambda: changed(0x304, lambda v: v & 7), "registers", "stuck-bit",
         "bit 3 of sensor_threshold is stuck at 0"),
        (lambda: changed(0x204, lambda v: v ^ 1 << 9), "prbs", "from-board", "all in bit 9"),
        pytest.param(lambda: changed(0x338, lambda v: v + 160 * (v > 0)), "threshold", "rate",
                     "level 0, 40 kHz", marks=pytest.mark.slow),
        pytest.param(lambda: changed(0x330, lambda v: v + v % 7), "timing", "tick",
                     "clocks apart", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_fault_is_named_at_its_stage(make, stage, kind, says):
    report = brought_up(make())
    assert (report.failed_stage, report.failed.kind) == (stage, kind), report.cause
    assert says in report.cause
    assert "; " in report.cause  # what to do about it
    left = [s.name for s in report.stages if s.outcome == "left out"]
    assert left == list(STAGES[STAGES.index(stage) + 1 :])


@pytest.mark.parametrize("way", ["rx", "tx"])
@pytest.mark.parametrize("kind", ["drop", "flip", "extra"])
@pytest.mark.parametrize("n", [37, pytest.param(1009, marks=pytest.mark.slow)])
def test_a_line_that_spoils_bytes_never_passes(kind, way, n):
    report = brought_up(EveryByte(kind, way, n), allowed_s=20)
    repeats = [stage.figures.get("reads_repeated", 0) for stage in report.stages]
    assert not report.ok or any(repeats), "spoilt bytes were taken for good ones"
    if report.ok:  # reads were repeated; what was captured is right all the same
        assert report.figure("patterns", "bits_wrong") == 0


def test_a_stage_ends_at_its_time():
    report = brought_up(ModelPort(SIZE), allowed_s=1e-6)
    assert (report.failed_stage, report.failed.kind) == ("bytes", "out-of-time")


def test_what_follows_a_stage_that_ran_out_of_time_is_not_blamed_for_it(monkeypatch):
    def asks_too_late(bench):
        port = bench.port.inner
        read = port.read

        def over(count, deadline_s):
            port.read = read
            raise OutOfTime("the time allowed is over")

        port.read = over
        bench.read("ctrl_magic")

    monkeypatch.setitem(CHECKS, "registers", asks_too_late)
    report = brought_up(ModelPort(SIZE), stop_at_first=False)
    failed = [(stage.name, stage.kind) for stage in report.stages if stage.outcome != "ok"]
    assert failed == [("registers", "out-of-time")]


def test_a_count_of_bytes_may_run_over():
    """The first reading is near 2^32, the last beyond it."""
    place = default_map().register("uart_rx_bytes").address
    report = brought_up(changed(place, lambda v: v + 2**32 - 1500))
    assert report.ok, report.cause
    assert report.figure("counters", "bytes_counted") == report.figure("counters", "bytes_sent")


def test_no_port_is_a_stage_that_failed():
    report = bring_up("/dev/there-is-none")
    assert (report.failed_stage, report.failed.kind) == ("port", "no-port")
    assert len(report.stages) == len(STAGES)


def test_another_litex_design_is_named(tmp_path):
    path = tmp_path / "csr.csv"
    path.write_text("csr_base,identifier_mem,0x00000800,,\ncsr_register,ctrl_scratch,0x4,1,rw\n")
    report = brought_up(ModelPort(SIZE), csr=read_csr(path))
    assert (report.failed_stage, report.failed.kind) == ("identity", "foreign")
    assert "Viform spike board 4x40" in report.cause


@pytest.mark.slow
def test_stages_go_on_where_they_may():
    port = changed(0x204, lambda v: v ^ 1)
    report = brought_up(port, stop_at_first=False)
    assert [s.name for s in report.stages if s.outcome == "failed"] == ["prbs"]
    assert not report.ok and report.stages[-1].outcome == "ok"


def test_junit_counts_the_stages():
    import xml.etree.ElementTree as xml

    report = brought_up(Silent(SIZE))
    suite = xml.fromstring(junit_xml(report)).find("testsuite")
    assert suite.attrib["tests"] == "9" and suite.attrib["failures"] == "1"
    assert suite.attrib["skipped"] == "7"
    assert suite.find("testcase/failure").attrib["type"] == "silent"


def test_a_board_that_restarts_is_reported_as_such():
    port = changed(4, lambda v: 0x12345678)
    report = brought_up(port)
    assert (report.failed_stage, report.failed.kind) == ("counters", "restarted"), report.cause


class PowerLost(ModelPort):
    """Loses its power at the `at`-th byte, so early that the uptime exceeds its old value."""

    at = 0

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        before, self.at = self.at, self.at - len(data)
        if before > 0 >= self.at:
            self._power_on()
            return
        super().write(data, deadline_s)


@pytest.mark.parametrize(("at", "stage"), [(200, "identity"), (300, "identity")])
def test_a_restart_that_the_uptime_hides_shows_in_the_lines_counters(at, stage):
    port = PowerLost(SIZE)
    port.at = at
    report = brought_up(port)
    assert (report.failed_stage, report.failed.kind) == (stage, "restarted"), report.cause


@pytest.mark.parametrize(
    ("first", "last", "text"),
    [(50_000, 49_000, True), (50_000, 50_000, False), (2**32 - 9, 5, False)],
)
def test_an_uptime_that_fell_is_a_restart_unless_it_ran_over(first, last, text):
    values = iter([first, last, last])
    port = changed(0x24, lambda v: next(values))
    guarded = DeadlinePort(port)
    watch = Uptime(Bench(guarded, Uartbone(guarded, baud=115_200), default_map(), True, 115_200))
    fault = watch.restarted()
    assert (fault is not None) == text
    assert fault is None or (fault.kind, fault.figures["uptime_after"]) == ("restarted", last)


@pytest.mark.parametrize(("change", "matches"), [(0, True), (1, False), (None, None)])
def test_a_build_is_this_programs_verilog_or_not(change, matches):
    said = 0 if change is None else build_crc(SIZE) ^ change
    guarded = DeadlinePort(changed(0x18, lambda v: said))
    bench = Bench(guarded, Uartbone(guarded, baud=115_200), default_map(), True, 115_200)
    figures = check_identity(bench)
    assert figures["build_matches"] is matches
    text = stage_text(Stage("identity", "ok", None, figures, 0.0))
    said_so = {None: "", True: ", this program's Verilog", False: ", other Verilog"}
    assert text.partition(f"build {said:08x}")[2].startswith(said_so[matches])
    assert ("Verilog" in text) == (matches is not None)


def test_a_long_search_is_announced():
    text = []
    report = brought_up(ModelPort(SIZE, baud_error=0.06), note=text.append)
    assert report.failed.kind == "baud"
    assert len(text) == 1 and "looking for the board's baud" in text[0]
    assert brought_up(Console(SIZE), note=text.append).failed.kind == "text"
    assert len(text) == 1


def test_one_lost_byte_fails_the_stage_that_repeats_the_read():
    class Once(ModelPort):
        answers = 0

        def to_host(self, data: bytes) -> bytes:
            self.answers += bool(data)
            return data[1:] if self.answers == 14 else data

    report = brought_up(Once(SIZE))
    assert (report.failed_stage, report.failed.kind) == ("identity", "spoilt"), report.cause
    assert report.failed.figures["reads_repeated"] == 1


@pytest.mark.parametrize("good", [0.3, 0.7])
def test_a_noisy_line_is_not_taken_for_a_wrong_baud(good):
    class Noisy(ModelPort):
        asked = 0

        def to_host(self, data: bytes) -> bytes:
            if not data:
                return data
            self.asked += 1
            whole = self.asked > 1 and (self.asked * 0.618034) % 1 < good
            return data if whole else data[1:]

    report = brought_up(Noisy(SIZE))
    assert (report.failed_stage, report.failed.kind) == ("bytes", "short"), report.cause
    assert "were complete" in report.cause


def test_counters_that_fall_to_nothing_are_a_fault_and_no_division():
    """As after a restart between two readings of the threshold stage."""
    reached = []

    def frames(value):
        if value >= 48:
            reached.append(value)
        return 0 if len(reached) > 1 else value

    port = changed(0x32C, frames)
    port.changed[0x334] = lambda value: 0 if reached else value
    report = brought_up(port)
    assert not report.ok and report.stages[-1].outcome != "ok"
    assert "the frame counter fell to 0 after it had reached 48" in report.cause
