"""A dropped, changed or added byte at any position of a transaction neither hangs the host nor
passes as right data. All tests use the cycle model in simulated time."""

import numpy as np
import pytest

from rtl_model.cycle import Settings, planes
from rtl_model.host import Board, Cause, LineFault, Uartbone, capture, pattern, prbs
from rtl_model.registers import VERSION

KINDS = ("drop", "flip", "extra")


def attempts(make_port, act, prepare=lambda board: None, step=1):
    """Yields (fault, port, board, result or LineFault) of `act` with a fault at every `step`-th
    byte that it sends or receives without faults."""
    clean = make_port()
    board = Board(Uartbone(clean))
    prepare(board)
    board.forget_counters()
    first = dict(clean.count)
    act(board)
    for way, kind in ((way, kind) for way in first for kind in KINDS):
        for place in range(first[way] + KINDS.index(kind), clean.count[way], step):
            port = make_port()
            board = Board(Uartbone(port))
            prepare(board)
            board.forget_counters()
            assert port.count == first
            port.faults[way, place] = kind
            port.clock_before = port.now()
            try:
                result = act(board)
            except LineFault as fault:
                result = fault
            assert not port.faults, "the fault was met"
            assert port.now() - port.clock_before < 10
            yield (way, kind, place - first[way]), port, board, result


def test_a_register_that_stands_still_is_never_read_wrong(make_port):
    for fault, _, board, result in attempts(
        make_port, lambda board: board.read_twice("ctrl_magic")
    ):
        assert result == 0x53504B32, fault
        assert board.bone.read(0) == [0x53504B32]


def test_a_plain_read_of_a_block_with_lost_or_added_bytes_is_told_and_mended(make_port):
    """Faults of an answer. Only a second reading detects a changed bit."""
    good = [0x53504B32, 0x12345678, VERSION]
    for fault, _, board, result in attempts(make_port, lambda board: board.bone.read(0, 3)):
        way, kind, _ = fault
        if way == "tx" and kind != "flip":
            assert result == good and board.bone.retried == 1, fault
        assert board.bone.read(0, 3) == good, fault


def test_a_checked_write_holds_or_says_so(make_port):
    """If nothing is raised, the register has the value and no other has changed."""

    def act(board):
        board.write("sensor_level", 0xA5)

    raised = 0
    for fault, _, board, result in attempts(make_port, act, step=3):
        assert board.bone.read(0) == [0x53504B32]
        if isinstance(result, LineFault):
            raised += 1
            assert result.cause in (Cause.SHORT, Cause.GARBLED, Cause.MISPLACED, Cause.RESTARTED), (
                fault
            )
            continue
        assert board.read_twice("sensor_level") == 0xA5, fault
        assert board.read_twice("sensor_threshold") == 7
    assert raised >= 6  # every byte of the write itself


def test_a_fifo_is_never_read_again_after_a_fault(make_port):
    source = 0x204
    for _, port, _, result in attempts(
        make_port, lambda board: board.bone.read(source, 4, fixed=True)
    ):
        assert sum(packet[0] == 4 for packet in port.sent) == 1
        assert isinstance(result, LineFault | list)


@pytest.mark.parametrize(
    "step", [211, pytest.param(13, marks=pytest.mark.slow)], ids=["some bytes", "many bytes"]
)
def test_a_capture_is_right_or_refused(make_port, step):
    """Faults at bytes from arming to the last reading; planes are compared with the model."""
    image = np.random.default_rng(7).integers(0, 256, (3, 40))
    wanted = planes(make_port().geometry, Settings(threshold=0), image, 2)

    def prepare(board):
        pattern.upload(board, image)
        board.write("sensor_threshold", 0)

    def act(board):
        return capture.burst(board, 2, clear=True)

    right = refused = 0
    for fault, _, _, result in attempts(make_port, act, prepare, step):
        if isinstance(result, LineFault):
            refused += 1
            continue
        right += 1
        assert np.array_equal(result.planes, wanted), fault
        assert result.lost == 0 and result.sequence.tolist() == list(range(6))
    assert right > refused
    print(f"\n{right} captures right, {refused} refused")


def test_prbs_counts_what_was_wrong_or_raises(make_port):
    for fault, _, _, result in attempts(make_port, lambda board: prbs.check(board, 7, 20), step=13):
        if isinstance(result, LineFault):
            assert result.cause in (Cause.SHORT, Cause.GARBLED, Cause.SILENT, Cause.MISPLACED)
        elif result.clean:
            continue  # the fault hit a reading that was mended
        else:
            assert (
                result.faults
                or result.bits_wrong_from_board
                or (result.bits_wrong_to_board or result.words_lost_to_board)
            ), fault


@pytest.mark.parametrize("kind", KINDS)
def test_a_drained_word_gone_wrong_is_fetched_again_by_the_pointer(make_port, kind):
    port = make_port()
    board = Board(Uartbone(port))
    board.write("sensor_pattern", 2)
    plain_write = port.write

    def write(data, deadline_s=1.0):
        if data[0] == 4 and not port.faults and not bent:
            bent.append(data)
            port.faults["tx", port.count["tx"] + 41] = kind
        plain_write(data, deadline_s)

    bent = []
    port.write = write
    got = capture.burst(board, 8, clear=True)
    assert bent and not port.faults
    wanted = planes(port.geometry, Settings(pattern=2), None, 8)
    assert np.array_equal(got.planes, wanted)
    assert got.frames.tolist() == list(range(8))
    assert got.retries == 1
