"""Planes that come: the order of their bits, waiting for them, and those that are late."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Block, Clock, InputError
from cosim.files import open_stream, write_stream
from cosim.files.dat import DatStream
from cosim.files.plane_order import PlaneOrder
from scenarios.assemble.source.recording.live import Lateness, LivePlanes

KHZ = Clock(1000)
MS = 10**9
"""Picoseconds in a millisecond, a cycle of KHZ."""


def stored(planes, order):
    """The bytes of planes by another way than the reader's: pixel by pixel."""
    flips = {"vertical": (1,), "horizontal": (2,), "both": (1, 2), "none": ()}
    flat = np.flip(planes, flips[order.flip]).reshape(len(planes), -1)
    frames = np.zeros((len(planes), flat.shape[1] // 8), np.uint8)
    size = 1 if order.words == "little" else int(order.words[4:]) // 8
    for pixel in range(flat.shape[1]):
        byte, bit = divmod(pixel, 8)
        word, within = divmod(byte, size)
        frames[:, word * size + (within if size == 1 else size - 1 - within)] |= (
            flat[:, pixel] << (bit if order.bits == "little" else 7 - bit)
        ).astype(np.uint8)
    return frames.tobytes()


@given(
    bits=st.sampled_from(["little", "big"]),
    words=st.sampled_from(["little", "big-16", "big-32", "big-64"]),
    flip=st.sampled_from(["vertical", "none", "horizontal", "both"]),
    seed=st.integers(0, 99),
)
def test_any_order_of_bits_bytes_and_rows_is_read(bits, words, flip, seed):
    order = PlaneOrder(bits, words, flip)
    planes = np.random.default_rng(seed).integers(0, 2, (3, 4, 16), np.uint8)
    frames = np.frombuffer(stored(planes, order), np.uint8).reshape(3, -1)
    np.testing.assert_array_equal(order.planes(frames, (4, 16), 16), planes)


def test_an_order_is_of_a_dat_and_of_whole_words(tmp_path):
    planes = np.random.default_rng(1).integers(0, 2, (40, 3, 8), np.uint8)
    order = PlaneOrder("big", "little", "none")
    (tmp_path / "a.dat").write_bytes(stored(planes, order))
    read = open_stream(tmp_path / "a.dat", (8, 3), order)
    words = read.read_words(0, 2)
    got = [(words[t // 32] >> np.uint32(t % 32)) & np.uint32(1) for t in range(40)]
    np.testing.assert_array_equal(got, planes)
    with pytest.raises(InputError, match="a multiple of 2, as its words are big-16, not 3; corr"):
        DatStream(tmp_path / "a.dat", (8, 3), order=PlaneOrder(words="big-16"))
    write_stream(read, tmp_path / "a.npz")
    with pytest.raises(InputError, match=r"must be given with a \.dat, not given with"):
        open_stream(tmp_path / "a.npz", None, order)


class Parts:
    """A source that gives its parts one by one."""

    name = "parts"

    def __init__(self, *parts):
        self.whole = b"".join(parts)
        self.parts, self.end, self.asked = list(parts), "", []

    def fetch(self, most, wait_s):
        self.asked.append(most)
        if not self.parts:
            self.end = "no more"
            return b""
        data, self.parts[0] = self.parts[0][:most], self.parts[0][most:]
        if not self.parts[0]:
            self.parts.pop(0)
        return data

    def skip(self, count):
        self.parts = [self.whole[count:]]

    def sample(self, count):
        return self.whole[:count]

    def close(self): ...


def coming(origin, cycles=None, now=lambda: 0):
    return LivePlanes(origin, (8, 2), PlaneOrder(flip="none"), KHZ, cycles, 5 * MS, now)


def test_planes_are_whole_whatever_the_pieces_and_no_more_is_taken_than_asked_for():
    data = bytes(range(1, 41))  # 20 planes of two bytes
    origin = Parts(data[:3], b"", data[3:7], data[7:])
    planes = coming(origin, 20)
    planes.first(lambda: None)
    assert planes.came == 1 and not planes.end
    assert planes.wait(6) and planes.came == 6 and max(origin.asked) <= 12
    got = planes.step(None, Block(0, 6))
    assert planes.wait(20) and planes.end == "the planes asked for are there"
    rest = planes.step(None, Block(6, 14))
    shown = np.concatenate([got.planes(), rest.planes()])
    packed = np.packbits(shown.reshape(20, -1), axis=1, bitorder="little")
    assert packed.tobytes() == data and (rest.start, planes.incomplete) == (6, 0)


def test_the_end_leaves_whole_planes_and_counts_the_incomplete_one():
    planes = coming(Parts(bytes(7)))
    assert not planes.wait(64)
    assert (planes.came, planes.waiting, planes.incomplete, planes.end) == (3, 3, 1, "no more")


def test_a_wait_ends_when_the_user_asks_to_stop():
    planes = coming(Parts(bytes(2), *[b""] * 50))
    planes.start()
    assert not planes.wait(64, lambda: True)
    assert (planes.came, planes.end) == (1, "")


def test_a_source_without_a_plane_is_refused():
    with pytest.raises(InputError) as caught:
        coming(Parts(b"a")).first(lambda: None)
    assert str(caught.value) == (
        "sensor.source must be a stream of at least one plane, of 2 bytes, not one of 1 bytes: "
        "no more; start its writer, or check sensor.width and sensor.height"
    )


def test_a_run_that_goes_on_reads_from_the_first_plane_that_no_block_has_taken():
    data = bytes(range(40))
    first = coming(Parts(data))
    first.wait(8)
    first.step(None, Block(0, 4))
    later = coming(Parts(data))
    later.first(lambda: None)
    later.restore(first.state())
    assert later.came == 4 and later.wait(20)
    got = later.step(None, Block(4, 16)).planes()
    assert np.packbits(got.reshape(16, -1), axis=1, bitorder="little").tobytes() == data[8:]


def test_late_planes_are_counted_exactly():
    """The first plane is there at 100 ms. Processing of planes 0 to 9 begins at 108 ms, 5 ms after
    the times of planes before 3; planes 10 to 19 at 115 ms are in time, 20 to 29 at 140 ms late up
    to plane 34."""
    now = [100.0]
    planes = coming(Parts(bytes(200)), None, lambda: int(now[0] * 1e6))
    planes.start()
    assert planes.wait(10)
    counts = []
    for start, at in ((0, 108.0), (10, 115.0), (20, 140.0), (30, 140.0), (40, 140.0)):
        assert planes.wait(start + 10)
        now[0] = at
        planes.step(None, Block(start, 10))
        counts.append(planes.lateness.late)
    assert counts == [3, 3, 13, 18, 18]
    assert planes.lateness.worst == 20 * MS
    again = coming(Parts(bytes(200)))
    again.restore(planes.state())
    assert (again.lateness.late, again.lateness.worst) == (18, 20 * MS)


def test_planes_that_fill_no_block_are_not_late_for_the_wait_for_more():
    """Plane 0 is there at 100 ms, all at 104 ms. The source is known to have ended 2 s later."""
    now = [100.0]
    planes = coming(Parts(bytes(14)), None, lambda: int(now[0] * 1e6))
    planes.first(lambda: None)
    planes.start()
    now[0] = 104.0
    assert planes.wait(7)
    assert not planes.wait(64)
    now[0] = 2104.0
    got, block = planes.rest()
    assert (block, got.cycles, planes.waiting) == (Block(0, 7), 7, 0)
    assert (planes.lateness.late, planes.lateness.worst) == (0, 4 * MS)


def test_planes_that_fill_no_block_are_late_after_a_late_block():
    now = [0.0]
    planes = coming(Parts(bytes(14)), None, lambda: int(now[0] * 1e6))
    planes.start()
    assert planes.wait(4) and not planes.wait(8)
    now[0] = 50.0
    planes.step(None, Block(0, 4))
    planes.rest()
    assert (planes.lateness.late, planes.lateness.worst) == (7, 50 * MS)


@given(
    first=st.integers(0, 1000), start=st.integers(0, 100), count=st.integers(1, 64),
    begin=st.integers(0, 10**9), after=st.integers(-(10**8), 10**9), bound=st.integers(0, 10**10),
    hz=st.sampled_from([Clock(1000), Clock(40_000), Clock(3, 7), Clock(10**6, 3)]),
)  # fmt: skip
def test_the_count_is_that_of_the_definition(first, start, count, begin, after, bound, hz):
    found = Lateness(hz, bound)
    found.came(first, begin)
    planes = range(first + start, first + start + count)
    found.begun(planes.start, planes.stop, begin + after)
    delays = [after * 1000 - hz.edge(n - first) for n in planes]
    assert found.late == sum(delay > bound for delay in delays)
    assert found.worst == max(delays)
