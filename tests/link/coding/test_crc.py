"""Check values of the CRC RevEng catalogue."""

import pytest

from link.coding import crc16_ibm_3740, crc16_kermit, crc32_iso_hdlc, crc32c, crc64_xz


@pytest.mark.parametrize(
    ("crc", "value"),
    [
        (crc32c, 0xE3069283),
        (crc32_iso_hdlc, 0xCBF43926),
        (crc16_ibm_3740, 0x29B1),
        (crc16_kermit, 0x2189),
        (crc64_xz, 0x995DC9BBDF1939FA),
    ],
)
def test_the_check_value(crc, value):
    assert crc(b"123456789") == value
    assert crc(b"123456788") != value
