"""Light of floats, folders of pictures, and arrays of NumPy as scenes."""

from __future__ import annotations

import struct
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
import pytest

from cosim import Clock, InputError
from cosim.light.survey import survey
from cosim.run.inputs import digest
from scenarios.scenes.charts.target import target_plane
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.pictures import Pictures, array_clip, open_clip

SHAPE = (50, 80)
LIGHT = np.linspace(0, 20, SHAPE[0] * SHAPE[1], dtype=np.float32).reshape(SHAPE)
COLOUR = np.stack([LIGHT, LIGHT / 2, np.full_like(LIGHT, 0.25)], axis=2)
LUMINANCE = COLOUR @ np.array([0.2126, 0.7152, 0.0722], np.float32)
ABOVE = "light above white (1) is filmed as it is"


def only(path: Path, **given: object) -> np.ndarray:
    plane = open_clip(path, SHAPE, **given).frame(0)  # type: ignore[arg-type]
    assert plane is not None
    return plane


@pytest.mark.parametrize("name", ["a.hdr", "a.pfm", "a.tiff"])
def test_light_above_white_is_filmed(tmp_path: Path, name: str) -> None:
    cv2.imwrite(str(tmp_path / name), COLOUR[..., ::-1])
    clip = open_clip(tmp_path / name, SHAPE)
    # Radiance cuts after eight bits of the brightest colour, here below 32 (Ward 1991)
    tolerance = 32 / 256 if name == "a.hdr" else 1e-5
    np.testing.assert_allclose(clip.frame(0), LUMINANCE, atol=tolerance)
    assert clip.notes == [f"{name}: {ABOVE}"]


@pytest.mark.parametrize("name", ["grey.pfm", "grey.tif"])
def test_floats_of_one_colour(tmp_path: Path, name: str) -> None:
    cv2.imwrite(str(tmp_path / name), LIGHT)
    np.testing.assert_allclose(only(tmp_path / name), LIGHT, rtol=1e-6)


def exr(path: Path, planes: dict[str, np.ndarray]) -> None:
    """Writes the smallest OpenEXR: channels of half or float by their names in alphabetic order,
    lines without compression (OpenEXR file layout, openexr.com)."""
    first_plane = next(iter(planes.values()))
    height, width = first_plane.shape
    kind = 1 if first_plane.dtype == np.float16 else 2
    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name in planes
    )
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    entries = [
        ("channels", "chlist", channels + b"\0"),
        ("compression", "compression", b"\0"), ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box), ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]  # fmt: skip
    head = struct.pack("<2i", 20000630, 2)
    for name, kind, value in entries:
        head += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value))
        head += value
    head += b"\0"
    rows = [b"".join(plane[y].tobytes() for plane in planes.values()) for y in range(height)]
    lines = [struct.pack("<2i", y, len(row)) + row for y, row in enumerate(rows)]
    first = len(head) + 8 * height
    offsets = [first + y * len(lines[0]) for y in range(height)]
    path.write_bytes(head + struct.pack(f"<{height}Q", *offsets) + b"".join(lines))


@pytest.mark.parametrize(("kind", "tolerance"), [(np.float32, 1e-5), (np.float16, 1e-3)])
def test_openexr(tmp_path: Path, kind: type, tolerance: float) -> None:
    exr(tmp_path / "grey.exr", {"Y": LIGHT.astype(kind)})
    np.testing.assert_allclose(only(tmp_path / "grey.exr"), LIGHT, rtol=tolerance)
    red, green, blue = (COLOUR[..., n].astype(kind) for n in range(3))
    exr(tmp_path / "rgb.exr", {"B": blue, "G": green, "R": red})
    np.testing.assert_allclose(only(tmp_path / "rgb.exr"), LUMINANCE, rtol=tolerance)
    exr(tmp_path / "rgba.exr", {"A": np.ones_like(red), "B": blue, "G": green, "R": red})
    np.testing.assert_allclose(only(tmp_path / "rgba.exr"), LUMINANCE, rtol=tolerance)


def test_values_that_are_no_light(tmp_path: Path) -> None:
    np.save(tmp_path / "low.npy", LIGHT - 1)
    clip = open_clip(tmp_path / "low.npy", SHAPE)
    assert clip.notes == ["low.npy: values below 0 are black", f"low.npy: {ABOVE}"]
    assert clip.frame(0).min() == 0  # type: ignore[union-attr]
    np.save(tmp_path / "nan.npy", np.where(LIGHT > 19, np.nan, LIGHT))
    with pytest.raises(InputError, match="a value that is no finite number"):
        open_clip(tmp_path / "nan.npy", SHAPE)


def test_an_array_has_frames_at_the_given_rate(tmp_path: Path) -> None:
    frames = np.stack([LIGHT / 20, LIGHT / 40, LIGHT / 80])
    np.save(tmp_path / "a.npy", frames)
    source = FilmSource(tmp_path / "a.npy", SHAPE, 700, Clock(40_000), 100, rate=1000.0)
    np.testing.assert_allclose(source.truth(0), frames[0], rtol=1e-6)
    np.testing.assert_allclose(source.truth(500_000_000), frames[:2].mean(axis=0), rtol=1e-6)
    assert source.truth(2_500_000_000).max() == pytest.approx(0.25)  # the last frame is held
    assert source.notes == [
        "a.npy: 1000 frames/s, light interpolated linearly in time between frames"
    ]
    with pytest.raises(InputError, match=r"scene\.frame_rate must be given for .*3 frames"):
        open_clip(tmp_path / "a.npy", SHAPE)


def test_codes_of_an_array_are_those_of_a_picture(tmp_path: Path) -> None:
    codes = (LIGHT * 12.75).astype(np.uint8)
    np.save(tmp_path / "codes.npy", codes)
    cv2.imwrite(str(tmp_path / "codes.png"), codes)
    np.testing.assert_allclose(
        only(tmp_path / "codes.npy"), only(tmp_path / "codes.png"), atol=1e-6
    )


@pytest.mark.parametrize("dtype", ["u2", "f4", "f8"])
def test_the_order_of_an_arrays_bytes_does_not_matter(tmp_path, dtype):
    """Files of other programs have the big end first."""
    values = (LIGHT / 20 * (60_000 if dtype == "u2" else 1)).astype(dtype)
    np.save(tmp_path / "little.npy", values.astype(f"<{dtype}"))
    np.save(tmp_path / "big.npy", values.astype(f">{dtype}"))
    np.testing.assert_array_equal(only(tmp_path / "big.npy"), only(tmp_path / "little.npy"))


def test_pictures_of_a_folder_are_frames_in_natural_order(tmp_path: Path) -> None:
    for n in (1, 2, 9, 10, 11):
        cv2.imwrite(str(tmp_path / f"f{n}.pfm"), np.full(SHAPE, n / 8, np.float32))
    (tmp_path / ".hidden").write_text("no picture")
    clip = open_clip(tmp_path, SHAPE, rate=240.0)
    levels = [float(clip.frame(n).mean()) * 8 for n in range(5)]  # type: ignore[union-attr]
    assert levels == pytest.approx([1, 2, 9, 10, 11])
    assert clip.frame(5) is None and clip.ended and clip.last().mean() == pytest.approx(11 / 8)
    assert clip.rate == 240 and clip.notes == [f"{tmp_path.name}: {ABOVE}"]
    assert clip.frame(0).mean() == pytest.approx(1 / 8)  # type: ignore[union-attr]


def test_arrays_of_a_folder_are_frames(tmp_path: Path) -> None:
    np.save(tmp_path / "0.npy", COLOUR / 20)
    np.save(tmp_path / "1.npy", LIGHT / 20)
    clip = open_clip(tmp_path, SHAPE, rate=240.0)
    np.testing.assert_allclose(clip.frame(0), LUMINANCE / 20, rtol=1e-5)
    np.testing.assert_allclose(clip.frame(1), LIGHT / 20, rtol=1e-5)


def test_what_does_not_belong_into_a_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder without files"):
        open_clip(tmp_path, SHAPE, rate=240.0)
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros(SHAPE, np.uint8))
    cv2.imwrite(str(tmp_path / "1.png"), np.zeros((40, 80), np.uint8))
    with pytest.raises(InputError, match="40 x 80 pixels where the first picture of its folder"):
        open_clip(tmp_path, SHAPE, rate=240.0).frame(1)
    (tmp_path / "1.png").write_text("notes of the day")
    with pytest.raises(InputError, match=r"1\.png \("):
        open_clip(tmp_path, SHAPE, rate=240.0).frame(1)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((2, 2, 2, 2)), r"shape \(2, 2, 2, 2\)"),
        (np.zeros((0, 5, 5)), "no values in its shape"),
        (np.zeros((5, 5), complex), "values of complex128"),
        (np.array([{}]), "not a .npy file of numbers"),
    ],
)
def test_arrays_that_are_no_frames(tmp_path: Path, values: np.ndarray, message: str) -> None:
    np.save(tmp_path / "a.npy", values, allow_pickle=True)
    with pytest.raises(InputError, match=message):
        open_clip(tmp_path / "a.npy", SHAPE, rate=240.0)


@pytest.mark.parametrize("size", [0, 10, 70, 128, 300])
def test_an_array_cut_off(tmp_path: Path, size: int) -> None:
    np.save(tmp_path / "a.npy", LIGHT)
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:size])
    with pytest.raises(InputError, match=r"not a \.npy file of numbers"):
        open_clip(tmp_path / "a.npy", SHAPE)


def test_a_chart_reflects_no_more_than_white(tmp_path: Path) -> None:
    class Chart:
        illuminance, chart, contrast, course = 700.0, "night", 1.0, ()
        path = str(tmp_path / "a.npy")

    np.save(tmp_path / "a.npy", LIGHT)
    with pytest.raises(InputError, match=r"reflectances up to 1 .* \(up to 20\)"):
        target_plane(Chart(), SHAPE)
    np.save(tmp_path / "a.npy", np.stack([LIGHT, LIGHT]))
    with pytest.raises(InputError, match=r"a picture in a scene of kind target, not .*which moves"):
        target_plane(Chart(), SHAPE)


def test_a_changed_folder_has_another_digest(tmp_path: Path) -> None:
    np.save(tmp_path / "0.npy", LIGHT)
    before = digest(tmp_path)
    assert before == digest(tmp_path) and before is not None
    (tmp_path / "1.npy").write_bytes((tmp_path / "0.npy").read_bytes())
    assert digest(tmp_path) != before


def test_frames_are_read_in_any_order() -> None:
    read: list[int] = []

    def each(n: int) -> np.ndarray:
        read.append(n)
        return np.full(SHAPE, n, np.float32)

    pictures = Pictures(Path("a"), each, 5, SHAPE, 10.0, [])
    for n in (4, 0, 1, 4):
        assert pictures.frame(n).max() == n  # type: ignore[union-attr]
    assert read == [0, 4, 1]  # kept, as long as few are asked for


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_frames_times_a_factor_are_rounded_as_products(kind: type) -> None:
    codes = np.random.default_rng(1).integers(0, 256, (5, *SHAPE), dtype=np.uint8)
    codes = codes if kind == np.uint8 else codes.astype(kind) / 255
    clip = array_clip(codes, SHAPE, None, 10.0)
    assert clip.given is codes and array_clip(codes, (2, 2), None, 10.0).given is None
    for n in (3, 0, 4):
        expected = clip.frame(n) * np.float32(700.3)  # type: ignore[operator]
        assert np.array_equal(clip.times(n, np.float32(700.3)), expected)  # type: ignore[arg-type]
    assert clip.times(5, np.float32(1)) is None and clip.ended


@pytest.mark.parametrize(
    ("count", "rate", "cycles"),
    [(20, 2000, 400), (20, 2000, 100), (3, 2000, 400), (1, 1000, 7), (30, 100_000, 40),
     (5, 39_999.5, 9), (12, 3333.3, 130)],
)  # fmt: skip
@pytest.mark.parametrize("gain", [None, np.float32(0.0123)])
@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_a_survey_of_frames_is_that_of_their_pieces_of_light(count, rate, cycles, gain, kind):
    """Clips that end within the run, and frames shorter than a cycle, too."""
    frames = np.random.default_rng(1).integers(0, 256, (count, 20, 37), dtype=np.uint8)
    if kind == np.float32:
        frames = frames.astype(np.float32)[:, :, ::-1] / np.float32(255)
    clock = Clock(40_000)

    class Plain(FilmSource):
        def frames(self, cycles):
            return None

    one, two = (
        survey(
            source(Path("frames"), (20, 37), 700.0, clock, cycles, rate=rate, gain=gain,
                 clip=array_clip(frames, (20, 37), None, rate)),
            clock, cycles,
        )
        for source in (FilmSource, Plain)
    )  # fmt: skip
    for each in fields(one):
        assert np.array_equal(getattr(one, each.name), getattr(two, each.name)), each.name
