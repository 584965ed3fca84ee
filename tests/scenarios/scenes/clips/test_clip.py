"""Pictures and clips as users have them: of other shapes and depths, and damaged ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cosim import InputError
from scenarios.scenes.clips.clip import Clip

SHAPE = (50, 80)
RAMP = np.linspace(0, 65535, 140 * 80).reshape(140, 80).astype(np.uint16)


def test_a_portrait_picture_is_cropped_and_says_so(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "tall.png"), (RAMP >> 8).astype(np.uint8))
    clip = Clip(tmp_path / "tall.png", SHAPE)
    assert clip.notes == [
        "tall.png: 36% of the picture is filmed, cropped at the centre to the sensor's 80 x 50"
    ]
    cv2.imwrite(str(tmp_path / "wide.png"), (RAMP[45:95] >> 8).astype(np.uint8))
    assert Clip(tmp_path / "wide.png", SHAPE).notes == []


def test_a_picture_of_16_bits_keeps_them(tmp_path: Path) -> None:
    picture = np.arange(50 * 80).reshape(SHAPE).astype(np.uint16) + 30_000
    cv2.imwrite(str(tmp_path / "deep.png"), picture)
    plane = Clip(tmp_path / "deep.png", SHAPE).frame(0)
    assert plane is not None and len(np.unique(plane)) == picture.size


def test_a_picture_that_is_cut_off_is_filmed_as_far_as_it_goes(tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.jpg", tmp_path / "cut.jpg"
    noise = np.random.default_rng(1).integers(0, 256, SHAPE, np.uint8)
    cv2.imwrite(str(whole), noise)
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert Clip(whole, SHAPE).notes == []
    clip = Clip(cut, SHAPE)
    assert clip.notes == ["cut.jpg is damaged: only a part of it can be decoded"]
    first, other = clip.frame(0), Clip(whole, SHAPE).frame(0)
    assert first is not None and other is not None
    assert np.array_equal(first[:16], other[:16]) and not np.array_equal(first[40:], other[40:])


@pytest.mark.parametrize("content", [b"", b"hello", b"\xff\xd8\xff\xe0"])
def test_what_is_no_picture_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "none.jpg").write_bytes(content)
    with pytest.raises(InputError, match=r"scene\.path must be a clip or image"):
        Clip(tmp_path / "none.jpg", SHAPE)
