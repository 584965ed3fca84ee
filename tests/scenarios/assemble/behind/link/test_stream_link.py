"""A camera's stream over a link to a display: the same bits in any order of work; its limits."""

from __future__ import annotations

import math
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim import Clock, InputError, Interrupted, Viform
from cosim.files import ZarrStream
from cosim.run.chain import STREAM
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from scenarios.assemble.behind.link.rates import RATES, code_rates
from scenarios.assemble.behind.link.stream_link import LINK_STREAM, RECEIVED
from scenarios.assemble.behind.machine import ChainMachine
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.loading import load
from scenarios.run import run_scenario
from sensor.codec.packets.section import CodeSection

TINY = (
    "sensor.width=96", "sensor.height=64", "duration=8 ms", "image.at=[160]",
    "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
    "code.cycles=64", "code.tile=32",
)  # fmt: skip
"""A chip of 96 x 64 pixels, and a panel that carries its stream without loss."""
GIVEN = (
    "link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b", "link.modem.parity=16",
)  # fmt: skip
"""A mode of a line code and Reed-Solomon, in the place of the one that the pilots choose."""
BOTH = pytest.mark.parametrize("mode", [(), GIVEN], ids=["chosen", "given"])


def machine_of(*sets: str, drop: tuple[str, ...] = ("display",)) -> ChainMachine:
    name, scenario = load("glass-over-light", [*TINY, *sets])
    scenario = scenario.model_copy(update=dict.fromkeys(drop))
    made = assemble(name, scenario, Options(), SilentProgress())
    assert isinstance(made, ChainMachine)
    return made


def run(folder: Path, *sets: str, parallel: bool = True, **given: Any) -> Any:
    """Runs the chain alone; returns it."""
    folder.mkdir(exist_ok=True)
    made = machine_of(*sets, **given)
    chain = made.chain(folder)
    chain.parallel = parallel
    chain.load(SilentProgress())
    chain.run(SilentProgress())
    made.close()
    return chain


def words(folder: Path, name: str) -> np.ndarray:
    stream = ZarrStream(folder / name)
    return stream.read_words(0, 1 << 20)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("whole")
    return folder, run(folder)


def test_a_stream_that_fits_arrives_bit_for_bit(whole: tuple[Path, Any]) -> None:
    folder, chain = whole
    sent = words(folder, STREAM)
    assert np.bitwise_count(sent).sum() > 100_000
    assert np.array_equal(sent, words(folder, RECEIVED))
    far, near = chain.stages["receiver"], chain.stages["code"]
    assert near.sender.counts.dropped == far.late == far.missing == 0
    assert far.receiver.frames_lost == 0


def test_a_chip_without_a_display_has_its_images_and_those_that_arrived(tmp_path: Path) -> None:
    name, scenario = load("glass-over-light", TINY)
    scenario = scenario.model_copy(update={"display": None})
    options = Options()
    done = run_scenario(
        name, scenario, tmp_path / "run", options=options, progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    assert done.result.outcome == "ok" and list((tmp_path / "run" / "images").iterdir())


def test_stages_one_after_another_give_the_same_bits(
    whole: tuple[Path, Any], tmp_path: Path
) -> None:
    chain = run(tmp_path, parallel=False)
    for name in (STREAM, "link.zarr", RECEIVED):
        assert np.array_equal(words(whole[0], name), words(tmp_path, name)), name
    assert chain.stages["receiver"].arrivals == whole[1].stages["receiver"].arrivals


@pytest.mark.parametrize("at", [pytest.param(at, marks=pytest.mark.slow) for at in (64, 192, 384)])
def test_an_interrupted_chain_goes_on_to_the_same_bits(
    whole: tuple[Path, Any], tmp_path: Path, at: int
) -> None:
    class Stopping(SilentProgress):
        def advance(self, done: int) -> None:
            if done == at:
                signal.raise_signal(signal.SIGINT)

    made = machine_of()
    chain = made.chain(tmp_path)
    with pytest.raises(Interrupted):
        chain.run(Stopping())
    made.close()
    assert chain.checkpoint.exists()
    again = run(tmp_path)
    assert again.begin >= at
    for name in (STREAM, "link.zarr", RECEIVED):
        assert np.array_equal(words(whole[0], name), words(tmp_path, name)), name


def test_a_link_that_carries_too_little_loses_layers_and_never_stalls(tmp_path: Path) -> None:
    chain = run(tmp_path, "code.rate=2 Mbit/s")
    near, far = chain.stages["code"], chain.stages["receiver"]
    count = near.sender.counts
    assert count.dropped > 0 and far.late == far.missing == 0
    seconds = 320 / 40e3
    assert 0.5 * 2e6 * seconds / 8 < count.sent_bytes <= 2e6 * (seconds + 3.2e-3) / 8
    assert count.peak_bytes <= 2e6 * 3.2e-3 / 8
    sent, shown = words(tmp_path, STREAM), words(tmp_path, RECEIVED)
    assert not np.array_equal(sent, shown)
    mean = np.bitwise_count(shown).sum() / np.bitwise_count(sent).sum()
    assert 0.95 < mean < 1.05  # spikes that are not sent are spread, not lost


@BOTH
@pytest.mark.slow
@pytest.mark.parametrize("aim", ["picture", "delay"])
def test_no_packet_is_late_over_a_link_that_is_always_full(
    tmp_path: Path, mode: tuple[str, ...], aim: str
) -> None:
    """The hold is the cycles of a packet, the buffer, and the delay of a block that was missed."""
    big = "sensor.width=320", "sensor.height=256", "code.cycles=auto", f"code.aim={aim}"
    chain = run(tmp_path, *big, *mode)
    near, far = chain.stages["code"], chain.stages["receiver"]
    count = near.sender.counts
    assert count.dropped > 0 and count.peak_bytes > 0
    assert far.late == far.missing == far.receiver.frames_lost == 0


@BOTH
def test_a_blocked_link_comes_back_by_itself(tmp_path: Path, mode: tuple[str, ...]) -> None:
    """The tiles keep their last rate; one group after the light is back all is right."""
    chain = run(tmp_path, "duration=16 ms", 'link.aim.blocked=[["4 ms", "7 ms"]]', *mode)
    far = chain.stages["receiver"]
    ((low, high),) = far.receiver.interruptions
    # The blocks that the span touches are lost, but for one that ends within its first tick.
    made = machine_of("duration=16 ms", 'link.aim.blocked=[["4 ms", "7 ms"]]', *mode)
    lead, most = made.behind.lead, math.ceil(made.behind.link.setup.block_cycles) + 1
    made.close()
    assert -1 <= lead + 160 - low <= most and 0 <= high - lead - 280 <= most
    assert far.missing == 0 and far.receiver.frames_lost > 0
    begun, ended = far.gaps[0][0], far.gaps[-1][0] + 64
    assert 64 <= begun <= 192 and ended <= 280 + 64
    sent, shown = words(tmp_path, STREAM), words(tmp_path, RECEIVED)
    same = (sent == shown).all(axis=(1, 2))
    # Of the groups at both ends some layers have arrived: no tile keeps its rate there.
    assert same[: begun // 32 - 2].all() and same[ended // 32 + 2 :].all() and not same.all()
    dark = shown[begun // 32 : ended // 32]
    assert (
        np.bitwise_count(dark).sum() > 0.5 * np.bitwise_count(sent[begun // 32 : ended // 32]).sum()
    )


@BOTH
@pytest.mark.slow
def test_a_receiver_that_joins_late_shows_the_rest(tmp_path: Path, mode: tuple[str, ...]) -> None:
    chain = run(tmp_path, "duration=20 ms", "link.join=5 ms", *mode)
    far = chain.stages["receiver"]
    assert far.missing > 0 and far.gaps[-1][0] < 200 + 128
    sent, shown = words(tmp_path, STREAM), words(tmp_path, RECEIVED)
    same = (sent == shown).all(axis=(1, 2))
    assert same[-12:].all() and not shown[:2].any()


@BOTH
@pytest.mark.slow
@pytest.mark.parametrize("clock", [-50, 20, 100, 400])
def test_clocks_apart_without_a_lock_do_no_harm(
    tmp_path: Path, clock: int, mode: tuple[str, ...]
) -> None:
    """A mode that is chosen works at every phase that the clocks drift through."""
    chain = run(tmp_path, f"link.panel.clock_offset={clock}", "duration=40 ms", *mode)
    assert chain.stages["receiver"].receiver.frames_lost == 0
    assert np.array_equal(words(tmp_path, STREAM), words(tmp_path, RECEIVED))


@BOTH
@pytest.mark.slow
def test_a_hidden_edge_does_no_harm(tmp_path: Path, mode: tuple[str, ...]) -> None:
    """A mode that is chosen has parity for the cells that the pilots miss."""
    run(tmp_path, "link.aim.occluded=0.01", *mode)
    assert np.array_equal(words(tmp_path, STREAM), words(tmp_path, RECEIVED))


@BOTH
@pytest.mark.slow
def test_half_a_panel_hidden_is_named(tmp_path: Path, mode: tuple[str, ...]) -> None:
    """No code can mend half of the bits."""
    chain = run(tmp_path, "link.aim.occluded=0.5", *mode)
    far = chain.stages["receiver"]
    assert far.missing == far.tiles and far.receiver.received.verdict.text


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (("link.file=a.bin",), "link.file must be absent in a link that carries a stream, not"),
        (("link.size=5",), "link.size must be absent in a link that carries a stream, not 5"),
        (("link.sensor.clock=20 kHz",), "link.sensor.clock must be the stream's, 40000 Hz"),
        (("link.sensor.pixel=continuous",), "link.sensor.pixel must be latched"),
        (
            (
                "link.sensor.chip=spiketwo",
                "link.sensor.reset=residual",
                "link.sensor.clock_steering=true",
            ),
            "link.sensor.clock_steering must be true only with a hard reset",
        ),
        (("code.cycles=40",), "code.cycles must be a multiple of 32"),
    ],
)
def test_what_cannot_be_sent_is_refused_in_one_line(sets: tuple[str, ...], text: str) -> None:
    with pytest.raises(InputError) as caught:
        machine_of(*sets)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


STEERED = (
    "link.sensor.chip=spiketwo", "link.sensor.width=220", "link.sensor.height=220",
    "link.panel.phase=0.6", "duration=4 ms", "image.at=[80]",
)  # fmt: skip
"""A second chip whose ticks follow the panel's."""


@pytest.mark.slow
def test_the_order_of_work_does_not_change_the_bits_behind_a_locked_clock(tmp_path: Path) -> None:
    made = machine_of(*STEERED)
    setup = made.behind.link.setup
    made.close()
    assert setup.lock is not None and setup.lock.most < 0.1
    assert setup.setting.camera.clock_moves.ps.any()
    run(tmp_path / "beside", *STEERED)
    run(tmp_path / "after", *STEERED, parallel=False)
    for name in (LINK_STREAM, RECEIVED):
        assert np.array_equal(words(tmp_path / "beside", name), words(tmp_path / "after", name))
    run(tmp_path / "free", *STEERED, "link.sensor.clock_steering=false")
    free, locked = (words(tmp_path / part, LINK_STREAM) for part in ("free", "after"))
    assert free.shape != locked.shape or (free != locked).any()


def test_a_code_without_a_link_is_refused() -> None:
    with pytest.raises(InputError, match=r"code must be given with a \[link\]"):
        load("glass", ["code.kind=raw"])
    with pytest.raises(InputError, match=r"link.sensor must be absent without a \[scene\]"):
        load("light-link", ["link.sensor.chip=spikeone", "link.sensor.threshold=1000 e"])


@BOTH
def test_the_parts_of_the_format_take_all_cells_of_the_panel(mode: tuple[str, ...]) -> None:
    made = machine_of(*mode)
    setup = made.behind.link.setup
    made.close()
    spent, used = setup.spent(), setup.mode
    cells = used.width * used.height / used.cell**2
    symbols = setup.setting.panel.clock.hz / setup.setting.camera.clock.hz / used.ticks
    assert sum(spent.values()) + setup.rate == pytest.approx(cells * symbols)
    assert min(spent.values()) >= 0
    data = setup.form.layout.cells * symbols
    line = 1 / 5 if used.line == "8b10b" else 0
    assert spent[f"line code {used.line}"] == pytest.approx(data * line, rel=1e-3, abs=1e-9)
    words = data * (1 - line) - spent["cells that fill no frame"]
    parity = spent[f"parity of {used.word_code}"]
    kept = setup.form.data_bytes / setup.form.word_bytes
    assert parity == pytest.approx(words * (1 - kept), rel=1e-3)


@pytest.mark.parametrize(("cycles", "cycle"), [(120, 108), (32, 0), (647, 646)])
def test_codes_are_compared_at_any_instant_of_a_stream(cycles: int, cycle: int) -> None:
    """Also at one that lies behind the last whole word."""
    planes = np.random.default_rng(1).random((cycles, 8, 8)) < 0.3
    shot: Any = SimpleNamespace(cycle=cycle, truth=np.full((8, 8), 0.5))
    section = CodeSection(cycles=32, tile=8)
    stream = Viform.from_planes(planes, Clock(40_000))
    rates = code_rates(stream, shot, section, 1000.0, 0.0, 41, 0.6)
    assert {point.rate for point in rates} == set(RATES)
    assert all(np.isfinite(point.psnr) for point in rates)
