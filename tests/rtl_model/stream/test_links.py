"""Rates of links: the arithmetic of their packets."""

import itertools

import pytest

from rtl_model.stream.links import LINKS, raw_rate


def test_the_raw_rate_of_a_megapixel_is_forty_gigabit():
    assert raw_rate(1000, 1000, 40e3) == 40e9


def test_links_stand_from_the_slowest_to_the_fastest():
    assert all(a.rate < b.rate for a, b in itertools.pairwise(LINKS))
    assert all(link.rate <= link.line_rate for link in LINKS)


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("UART, 12 Mbaud", 9.6e6),
        # A frame of 1500 bytes takes 1538 bytes of line.
        ("Ethernet, 1 Gbit/s", 1e9 * 1472 / 1538),
        ("USB 3.0, FT601", 8 * 400e6),
        ("PCIe 3.0 x8", 64e9 * 128 / 130 * 256 / 280),
    ],
)
def test_a_rate_is_what_its_packets_leave(name, rate):
    assert next(link for link in LINKS if link.name == name).rate == pytest.approx(rate)
