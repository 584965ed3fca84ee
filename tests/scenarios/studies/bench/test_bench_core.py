"""The rows of the link that is called, and the plain way beside them."""

from __future__ import annotations

import pytest

from cosim.compute.opencl import Device
from scenarios.studies.bench.core import plain_send, send_rows


def test_the_plain_way_sends_bytes() -> None:
    data = bytes(range(256)) * 9
    for camera in ((250, 250), (100, 120)):
        assert plain_send(data, 6, (240, 240), camera, 4) == data
    one_short = plain_send(data, 6, (240, 240), (50, 250), 4)  # rows between the cells
    assert one_short != data


@pytest.mark.slow
def test_rows_of_a_link(device: Device) -> None:
    keys = {
        "panel.width": 160, "panel.height": 160, "modem.cell": 2, "modem.ticks": 2,
        "modem.rate": 0.75, "sensor.chip": "spikeone", "sensor.width": 200, "sensor.height": 200,
    }  # fmt: skip
    setup, first, later = send_rows(device, 200, **keys)
    assert setup.name == "core.send-setup" and setup.unit == "s" and setup.value > 0
    for row, which in ((first, "first call"), (later, "later calls")):
        assert row.name == "core.send" and row.unit == "bit/s" and row.tier == f"fast, {which}"
        assert row.value > 0 and row.plain_ratio is not None and row.realtime is not None
    assert later.value > first.value
