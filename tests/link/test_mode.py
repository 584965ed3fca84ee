"""Modes and the tags that carry them."""

from itertools import product

import pytest

from link.mode import LINE_CODES, PARITIES, RATES, Mode, codes_of

OLD = {
    ("none", 16): 0, ("none", 128): 3, ("manchester", 32): 5, ("4b6b", 64): 10, ("8b10b", 16): 12,
    ("scrambled", 16): 16, ("scrambled", 128): 19,
}  # fmt: skip
"""Line code and parity -> the fourth digit of tags in recordings from before there were rates."""


def test_old_tags_mean_what_they_did() -> None:
    for (line, parity), digit in OLD.items():
        tags = 4 * 30, 4 * 30 + 1, 4 * 9 + 2, 4 * digit + 3
        mode = Mode.from_tags(tags)
        assert mode == Mode(960, 960, 2, 2, line, parity) and mode.tags == tags


def test_every_mode_has_tags_of_its_own() -> None:
    modes = [
        Mode(960, 640, cell, ticks, line, parity, rate)
        for cell, ticks, line in product((1, 16), (1, 16), LINE_CODES)
        for parity, rate in codes_of(line)
    ]
    modes += [
        Mode(960, 640, cell, ticks, "scrambled", None, adaptive=True)
        for cell, ticks in product((1, 16), (1, 16))
    ]
    assert len({mode.tags for mode in modes}) == len(modes)
    assert len(modes) == 4 * (len(LINE_CODES) * len(PARITIES) + len(RATES) + 1)
    for mode in modes:
        assert Mode.from_tags(mode.tags) == mode
        assert max(mode.tags) < 587
        assert 0.4 < mode.word_rate < 1 and mode.word_code.startswith(("Reed-Solomon", "LDPC"))


def test_what_is_no_mode() -> None:
    with pytest.raises(ValueError, match="not None, None and False"):
        Mode(960, 960, 2, 1, "scrambled", None)
    with pytest.raises(ValueError, match=r"not 16, 0\.8 and False"):
        Mode(960, 960, 2, 1, "scrambled", 16, 0.8)
    with pytest.raises(ValueError, match=r"rate must be one of 0\.75, .*, not 0\.9"):
        Mode(960, 960, 2, 1, "scrambled", None, 0.9)
    with pytest.raises(ValueError, match=r"not None, 0\.8 and True"):
        Mode(960, 960, 2, 1, "scrambled", None, 0.8, adaptive=True)
    with pytest.raises(ValueError, match="line must be scrambled with a rate, not 8b10b"):
        Mode(960, 960, 2, 1, "8b10b", None, adaptive=True)
    with pytest.raises(ValueError, match="line must be scrambled with a rate, not 8b10b"):
        Mode(960, 960, 2, 1, "8b10b", None, 0.8)
    for digit in (20, 63, 64 + len(RATES), 95, 97, 145):
        with pytest.raises(ValueError, match="tags must be those of a mode"):
            Mode.from_tags((120, 121, 38, 4 * digit + 3))
