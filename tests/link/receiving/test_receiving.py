"""A file through the small link, and what the receiver measures on the way."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.special import ndtr

from cosim import Viform
from cosim.run.progress import QuietProgress
from cosim.spikes.viform import unpack_planes
from link.layout import TAG_MODULES, TRAINING, Layout
from link.mode import Mode
from link.receiving import Received, Receiver
from link.receiving.diagnosis.failure import edge_blur
from link.receiving.tags import art_of
from link.sending import FileTransmission
from link.verdict import Cause
from tests.link.receiving.toy import CLOCK, MODE, Toy, corner_error, small

DATA = np.random.Generator(np.random.Philox(key=5)).bytes(6000)


class Told(QuietProgress):
    """What a receiver tells: its texts, and the ticks that are done."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.done: list[int] = []

    def advance(self, done: int) -> None:
        self.done.append(done)

    def tell(self, what: str) -> None:
        self.texts.append(what)


def receive(
    toy: Toy, planes: np.ndarray | None = None, block: int | None = None,
    progress: Told | None = None,
) -> Received:  # fmt: skip
    """What a receiver makes of a link's stream, in blocks of so many ticks."""
    shown = toy.planes() if planes is None else planes
    receiver = Receiver(shown.shape[1:], progress=progress)
    for first in range(0, len(shown), block or len(shown)):
        part = shown[first : first + (block or len(shown))]
        whole = Viform.from_planes(part, CLOCK)
        receiver.step(Viform(whole.words, whole.cycles, CLOCK, first))
    return receiver.finish()


@pytest.mark.parametrize(
    "given",
    [
        {},
        pytest.param({"ppm": 1000.0}, marks=pytest.mark.slow),
        pytest.param({"slope": -1.0, "first": 13.8}, marks=pytest.mark.slow),
        pytest.param({"turn": 90.0}, marks=pytest.mark.slow),
        pytest.param(
            {"turn": 217.0, "scale": 0.9, "margin": 60, "mode": Mode(256, 256, 3, 2, "8b10b", 32)},
            marks=pytest.mark.slow,
        ),
        {"begin": 60},
        {"shift": lambda t: (0.8 * np.sin(t / 60), 0.6 * np.cos(t / 47))},
    ],
    ids=["plain", "ppm", "slope", "quarter", "turned", "middle", "moving"],
)
def test_a_file_arrives_and_the_measurements_are_right(given: dict[str, object]) -> None:
    data = DATA * 4 if given.get("begin") else DATA
    toy, told = small(data, **given), Told()  # type: ignore[arg-type]
    got = receive(toy, progress=told)
    begin, go_on = told.texts[:2]
    assert begin.startswith("receiver: packed learns from ") and go_on == "receiver: packed"
    assert told.done and told.done == sorted(told.done) and told.done[-1] <= got.ticks
    assert got.verdict.whole, got.verdict
    assert got.delivered is not None and got.delivered[0] == data
    assert got.mode == toy.sent.mode
    middle = toy.cycles / 2 + toy.begin
    if given.get("shift"):
        found = [got.registration.shift(t) for t in (50.0, 110.0)]
        true = [toy.shift(t) for t in (50.0, 110.0)]
        moved = np.subtract(*found) - np.subtract(*true)
        assert np.abs(moved).max() < 0.1
    else:
        assert corner_error(got.registration.homography, toy.homography, toy.sent.mode) < 0.05
    # phase in the middle of rows and time; a stream without training knows it from pilots alone
    symbol = round((middle - toy.first) / toy.period)
    row = toy.shape[0] / 2
    true_start = toy.first + symbol * toy.period + toy.slope / 2 - toy.begin
    assert abs(float(got.timing.start(symbol, row)) - true_start) < (0.1 if toy.begin else 0.05)
    assert abs(got.on - toy.on) < 0.1
    assert abs(got.timing.period / toy.period - 1) * 1e6 < got.clock_error < 1000


def test_blocks_do_not_matter_and_symbols_can_be_looked_up() -> None:
    toy = small(DATA)
    planes = toy.planes()
    one, many = receive(toy, planes), receive(toy, planes, 50)
    assert one.delivered == many.delivered is not None
    assert one.timing == many.timing
    first, count = 48, 10
    wrong = one.decided(first, count) != toy.sent.bits(first, count)
    assert 0 < wrong.mean() < 0.1  # raw bits of a small panel have errors, which the code mends
    assert one.instants[0].tick == pytest.approx(13.37 + 58 * 2, abs=1.5)
    assert one.cell_quality.shape == toy.layout.shape
    assert one.cell_errors.sum() == one.bytes_corrected > 0
    sampled = 1 / (1 + np.exp(np.abs(one.soft.astype(np.float64))))
    assert 0.3 < one.promise / sampled.mean() < 3  # 2000 of them, of which few are in doubt
    assert one.promise == pytest.approx(many.promise, rel=1e-6)
    with pytest.raises(KeyError):
        one.decided(0, 1)


@pytest.mark.slow
def test_small_tags_are_registered_by_the_cells() -> None:
    mode = Mode(256, 256, 4, 2, "8b10b", 64)
    toy = small(DATA[:500], mode=mode, scale=0.5)
    got = receive(toy)
    assert got.verdict.whole
    assert corner_error(got.registration.homography, toy.homography, mode) < 0.15


def _noise(shape: tuple[int, ...], rate: float) -> np.ndarray:
    rng = np.random.Generator(np.random.Philox(key=9))
    return rng.random(shape) < rate


@pytest.mark.parametrize(
    ("planes", "cause"),
    [
        (_noise((200, 120, 130), 0.3), Cause.OUT_OF_VIEW),
        (np.zeros((100, 120, 130), np.bool_), Cause.DARK),
        (np.ones((100, 120, 130), np.bool_), Cause.SATURATED),
        (_noise((1, 40, 40), 0.3), Cause.TRUNCATED),
        (_noise((100, 1, 1), 0.3), Cause.OUT_OF_VIEW),
    ],
    ids=["noise", "dark", "ones", "one tick", "one pixel"],
)
def test_what_is_no_link_gets_a_verdict(planes: np.ndarray, cause: Cause) -> None:
    receiver = Receiver(planes.shape[1:])
    receiver.step(Viform.from_planes(planes, CLOCK))
    got = receiver.finish()
    assert got.verdict.cause is cause
    assert got.delivered is None


def test_nothing_at_all_gets_a_verdict() -> None:
    assert Receiver((10, 10)).finish().verdict.cause is Cause.TRUNCATED


@pytest.mark.slow
def test_each_fault_is_named() -> None:
    toy = small(DATA)
    planes = toy.planes()
    noisy = planes ^ _noise(planes.shape, 0.25)
    hole = planes.copy()
    hole[:, 100:180, 80:200] = False
    hidden = planes.copy()
    hidden[:, :, :100] = False
    for given, cause in (
        (planes[:110], Cause.TRUNCATED),
        (planes[:, :, 60:], Cause.OUT_OF_VIEW),
        (planes[:, 30:], Cause.OUT_OF_VIEW),  # cuts the margins and borders of two tags
        (noisy, Cause.NOISY),
        (hole, Cause.OCCLUDED),
        (hidden, Cause.OCCLUDED),
        (planes[:, :, ::-1], Cause.MIRRORED),
        (planes[:, ::-1], Cause.MIRRORED),
    ):
        got = receive(toy, np.ascontiguousarray(given))
        assert got.verdict.cause is cause, got.verdict
        assert got.delivered is None
        assert any(c.isdigit() for c in got.verdict.text)


@pytest.mark.parametrize(
    ("given", "cause"),
    [
        pytest.param({"blur": 8.0, "cycles": 100}, Cause.OUT_OF_FOCUS, marks=pytest.mark.slow),
        ({"on": 0.2}, Cause.DIM),
        ({"background": 1.3, "cycles": 100}, Cause.SATURATED),
        pytest.param({"ppm": 30000.0}, Cause.WRONG_CLOCK, marks=pytest.mark.slow),
    ],
    ids=["focus", "dim", "sun", "clock"],
)
def test_faults_of_light_and_clock_are_named(given: dict[str, object], cause: Cause) -> None:
    got = receive(small(DATA, **given))  # type: ignore[arg-type]
    assert got.verdict.cause is cause, got.verdict
    assert got.delivered is None


def tags_alone(mode: Mode, module: int, side: int) -> Viform:
    """64 ticks of the tags of a square panel in a square image, `module` camera pixels to their
    modules, and nothing else."""
    size = round(mode.width * module / Layout(mode).module)
    image, tag, low = np.zeros((side, side), np.bool_), TAG_MODULES * module, (side - size) // 2
    high = low + size - tag
    for number, top, left in zip(
        mode.tags, (low, low, high, high), (low, high, high, low), strict=True
    ):
        art = np.kron(art_of(number), np.ones((module, module), np.bool_))
        image[top : top + tag, left : left + tag] = art
    words = np.where(image, np.uint32(0xFFFFFFFF), np.uint32(0))
    return Viform(np.stack([words, words]), 64, CLOCK)


def test_tags_that_claim_cells_no_camera_could_see_are_refused_at_once() -> None:
    # 21 million cells, were they looked for: 1 GB.
    mode = Mode(4640, 4640, 1, 1, "none", 16)
    receiver = Receiver((520, 520))
    receiver.step(tags_alone(mode, 5, 520))
    tracemalloc.start()
    got = receiver.finish()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert got.verdict.cause is Cause.TOO_SMALL and got.delivered is None and got.mode == mode
    assert "4640 x 4640" in got.verdict.text and "0.1 camera pixels" in got.verdict.text
    assert most < 100e6


@pytest.mark.parametrize(("cell", "refused"), [(3, True), (4, False)])
def test_cells_of_half_a_pixel_are_looked_for(cell: int, refused: bool) -> None:
    mode = Mode(1920, 1920, cell, 2, "8b10b", 32)
    receiver = Receiver((320, 320))
    receiver.step(tags_alone(mode, 3, 320))  # 0.45 and 0.6 pixels to a cell's side
    got = receiver.finish()
    assert got.delivered is None
    assert (got.verdict.cause is Cause.TOO_SMALL and "step nearer" in got.verdict.text) == refused


@pytest.mark.slow
def test_a_wrong_interleaver_delivers_nothing() -> None:
    toy = small(DATA, mode=MODE)
    receiver = Receiver(toy.shape, interleave=False)
    receiver.step(toy.stream())
    got = receiver.finish()
    assert got.delivered is None and got.verdict.cause is Cause.NOISY


def _shown(data: bytes) -> np.ndarray:
    """A panel's own planes, all frames of which are needed."""
    sent = FileTransmission(MODE, data, "a.bin", overhead=0)
    return unpack_planes(sent.words(0, sent.planes), 0, sent.planes).astype(np.bool_)


def _receive_shown(planes: np.ndarray) -> Received:
    receiver = Receiver((MODE.height, MODE.width))
    receiver.step(Viform.from_planes(np.ascontiguousarray(planes), CLOCK))
    return receiver.finish()


@pytest.mark.slow
def test_a_transmission_of_too_few_frames_is_told_so_however_small_its_cells() -> None:
    """All of it arrives, in cells of a camera pixel."""
    mode = Mode(160, 160, 1, 2, "8b10b", 32)
    sent = FileTransmission(mode, DATA * 11, "a.bin", most_symbols=TRAINING + 20)
    planes = unpack_planes(sent.words(0, sent.planes), 0, sent.planes).astype(np.bool_)
    receiver = Receiver((mode.height, mode.width))
    dark = np.zeros((40, *planes.shape[1:]), np.bool_)
    receiver.step(Viform.from_planes(np.concatenate([planes, dark]), CLOCK))
    got = receiver.finish()
    assert got.codewords_wrong == 0 < got.frames_right == got.frames_read < (got.frames_needed or 0)
    assert got.verdict.cause is Cause.TRUNCATED, got.verdict


@pytest.mark.slow
def test_a_recording_that_begins_too_late_is_told_so() -> None:
    verdict = _receive_shown(_shown(DATA * 11)[110:]).verdict
    assert verdict.cause is Cause.TRUNCATED
    assert "begins after first light" in verdict.text


@pytest.mark.slow
@pytest.mark.parametrize("dark", [True, False], ids=["dark", "missing"])
def test_a_gap_is_no_noise(dark: bool) -> None:
    """Groups take 20 ticks after the 96 of the training. Without light the third and fourth are
    spoilt; ticks that are missing are put in, and the third alone is."""
    planes = _shown(DATA * 11)
    given = planes & (np.abs(np.arange(len(planes)) - 156) > 19)[:, None, None]
    if not dark:
        given = np.delete(planes, slice(140, 145), axis=0)
    got = _receive_shown(given)
    assert got.verdict.cause is Cause.INTERRUPTED, got.verdict
    if dark:
        assert "what ended by tick 136 is right" in got.verdict.text
        assert "what began after tick 176 too" in got.verdict.text
    else:
        assert "the pilots go on 5 ticks early" in got.verdict.text
        assert got.frames_right > 30
    assert got.delivered is None


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.84, 0.91])
def test_words_with_soft_decisions(rate: float) -> None:
    """A file arrives, and what was corrected is what was decided wrongly; what does not arrive has
    a cause."""
    mode = Mode(256, 256, 2, 2, "scrambled", None, rate)
    toy = small(DATA, mode=mode)
    planes = toy.planes()
    got = receive(toy, planes)
    assert got.delivered == (DATA, "a.bin"), got.verdict
    assert got.mode == mode and got.codewords_wrong == 0
    first, count = TRAINING, toy.sent.data_end - TRAINING
    wrong = got.decided(first, count) != toy.sent.bits(first, count)
    by_cell = np.zeros(toy.layout.shape, np.int64)
    by_cell.ravel()[toy.layout.data] = wrong.sum(axis=0)
    assert got.cell_errors is not None and (got.cell_errors <= by_cell).all()
    assert got.cell_errors.sum() > 0.8 * by_cell.sum() > 0
    assert got.rounds > got.codewords
    cut = receive(toy, planes[: len(planes) * 3 // 4])
    assert cut.delivered is None and cut.verdict.cause is Cause.TRUNCATED
    dim = receive(small(DATA, mode=mode, on=0.5))
    assert dim.delivered is None and dim.verdict.cause in (Cause.DIM, Cause.NOISY)


@pytest.mark.parametrize("line", ["8b10b", pytest.param("manchester", marks=pytest.mark.slow)])
@pytest.mark.parametrize("closed", [True, False])
def test_a_transmission_is_read_with_the_closing_and_without(line: str, closed: bool) -> None:
    """Recordings of before have none. Where groups are short the closing is no group of its own."""
    mode = Mode(256, 256, 4, 2, line, 32)
    toy = small(DATA[:900], mode=mode)
    end = toy.sent.data_end
    assert toy.sent.symbols == end + 1
    if not closed:
        toy.sent = FileTransmission(mode, DATA[:900], "a.bin", overhead=0.3, most_symbols=end)
    got = receive(toy)
    assert got.delivered == (DATA[:900], "a.bin"), got.verdict
    assert got.frames_read == got.frames_right == toy.sent.outbox.frames
    assert max(got.packed) == end - 1


@pytest.mark.parametrize("blur", [0.0, 2.0, 6.0, 12.0])
def test_the_blur_of_an_edge_is_measured(blur: float) -> None:
    """A turned square that reaches beyond the image, with the noise of random data, which makes
    wide edges look steeper."""
    rng, (y, x) = np.random.default_rng(2), np.mgrid[-100:100, -100:100].astype(np.float64)
    turn = np.deg2rad(15.0)
    across, down = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    inside = 1 - ndtr((np.maximum(abs(across), abs(down)) - 95) / max(blur, 1e-6))
    rates = (0.04 + 0.44 * inside + 0.03 * inside * rng.normal(size=x.shape)).astype(np.float32)
    assert edge_blur(rates) == pytest.approx(blur, abs=0.7 + 0.25 * blur)
    assert edge_blur(np.full((50, 50), 0.3, np.float32)) == np.inf
