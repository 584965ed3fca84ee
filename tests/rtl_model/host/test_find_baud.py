"""How far a board's baud is off, on a line that answers only near the board's own rate."""

import pytest

from rtl_model.host import find_baud


class Off:
    """A port that is silent where the host's rate is more than 4.5 % off the board's."""

    def __init__(self, port, real):
        self.port, self.real, self.name, self.baud = port, real, "off", 50_000
        self.now, self.drain, self.read = port.now, port.drain, port.read

    def set_baud(self, baud):
        self.baud = baud

    def write(self, data, deadline_s=1.0):
        self.port.dead = abs(self.baud / self.real - 1) > 0.045
        self.port.write(data, deadline_s)


@pytest.mark.parametrize("percent", [-12, -6, -4, 0, 4, 6, 12])
def test_the_deviation_is_found_within_a_step(port, percent):
    report = find_baud(Off(port, 50_000 * (1 + percent / 100)), 50_000)
    assert report.tolerable == (abs(percent) <= 4)
    assert abs(report.error_percent - percent) <= 1.0
    assert not report.by_pulse  # the model has no pins
    assert report.baud == (50_000 if report.tolerable else report.measured)
