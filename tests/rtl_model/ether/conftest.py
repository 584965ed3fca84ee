"""A virtual board over UDP, small enough for a quick bring-up."""

import pytest

from rtl_model.geometry import Geometry
from rtl_model.host import opened_bone
from rtl_model.virtual.ethernet import EthernetBoard

SIZE = Geometry(rows=4, columns=40, lanes=32, clock_hz=460_800, capture_words=512, sink_words=64)


@pytest.fixture(scope="module")
def board():
    """The cycle model behind a UDP address of this machine."""
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="model") as served:
        yield served


@pytest.fixture
def bone(board):
    """A host of that board."""
    with opened_bone(board.port, 1, simulated=True) as (opened, _):
        yield opened
