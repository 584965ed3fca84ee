"""Check values of the CRC RevEng catalogue."""

import pytest

from link.coding.crc import crc32c, crc64_xz


@pytest.mark.parametrize(
    ("crc", "value"),
    [
        (crc32c, 0xE3069283),
        (crc64_xz, 0x995DC9BBDF1939FA),
    ],
)
def test_the_check_value(crc, value):
    assert crc(b"123456789") == value
    assert crc(b"123456788") != value
