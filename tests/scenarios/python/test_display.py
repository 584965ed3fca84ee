"""The display that is called from Python: the bits of a run, its observers, and refusals."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios.assemble.behind.display.screen as screen
import viform
from scenarios.python.display import EYES

CLOCK = viform.Clock(40_000)
EVERY = ("still", "pursuing", "camera")
KINDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "emitter": {
        "drive": "hold", "rise": "2 us", "decay": "5 us", "pursuit": "900 px/s",
        "observer": "camera", "width": 50, "height": 30, "fit": "nearest", "row_scan": 0.5,
    },
    "pulse": {
        "drive": "impulse", "pulse": 0.4, "width": 40, "height": 60, "fit": "centre",
        "pursuit": "-3000 px/s", "luminance": "20 cd/m²",
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def spikes() -> viform.Viform:
    """Random spikes, more of them to the right; no whole number of words."""
    rate = np.linspace(0.05, 0.6, 64)
    return viform.Viform.from_planes(np.random.default_rng(2).random((233, 48, 64)) < rate, CLOCK)


@pytest.mark.parametrize("kind", KINDS)
def test_a_call_has_the_bits_of_a_run(
    kind: str, spikes: viform.Viform, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, Any] = {}

    def write(folder: Path, outcome: Any, *others: Any) -> list[str]:
        """The images of a run, before they are drawn with 8 bits."""
        drawn.update(outcome.images["spike"])
        return written(folder, outcome, *others)

    written = screen.write_observer_images
    monkeypatch.setattr(screen, "write_observer_images", write)
    monkeypatch.chdir(tmp_path)
    keys = {f"display.{key}": value for key, value in KINDS[kind].items()}
    run = viform.show(spikes, out="run", progress=False, **keys)
    assert isinstance(run, viform.Run) and "eye-spike" in run.images
    before = sorted(Path().rglob("*"))
    shown = viform.show(spikes, **keys)
    assert {EYES[eye] for eye in shown.images} == set(drawn) and len(drawn) == 2 + (
        KINDS[kind].get("observer") == "camera"
    )
    with viform.Display(**KINDS[kind]) as display:
        called = display.show(spikes, EVERY)
        from_file = display.show(str(Path("run.zarr")), EVERY)
        assert list(display.show(spikes).images) == [EVERY[2 if len(drawn) == 3 else 0]]
    for eye, images in shown.images.items():
        assert images.dtype == np.float32 and images.shape[0] == len(shown.instants) == 5
        assert images.mean() > 0.1
        for other in (drawn[EYES[eye]], called.images[eye], from_file.images[eye]):
            np.testing.assert_array_equal(images, other)
    assert run.metrics["shown_white_rate"] == pytest.approx(called.white_rate)
    assert sorted(Path().rglob("*")) == before  # nothing is written


def test_a_display_goes_to_another_process(spikes: viform.Viform) -> None:
    display = viform.Display("hold", luminance="20 cd/m²")
    again = pickle.loads(pickle.dumps(display))
    assert repr(again) == repr(display)
    seen = [each.show(spikes, "still").images["still"] for each in (display, again)]
    np.testing.assert_array_equal(*seen)
    for device in (0, ["a"], True):
        with pytest.raises(viform.InputError, match="device must be its number or part"):
            viform.Display(device=device)  # type: ignore[arg-type]


def test_the_film_of_a_camera_has_its_white() -> None:
    grey = np.full((40, 24, 32), 0.25, np.float32)
    camera = viform.Camera(width=32, height=24, threshold="1000 e", device="numba")
    seen = viform.Display().show(camera.film(grey, 2000, white_rate=0.5), "still", at=[780])
    assert seen.white_rate == pytest.approx(0.5)
    assert seen.images["still"][0, 12, 16] == pytest.approx(0.25, rel=0.1)
    assert viform.Display().show(camera.film(grey, 2000)[:], "still").white_rate < 0.25


def test_light_that_is_steady_is_seen_as_it_is() -> None:
    """A pixel that fires in every n-th cycle has 1 / n of the light of every cycle."""
    every = np.array([1, 2, 4, 5])
    planes = np.arange(4000)[:, None, None] % every[None, None] == 0
    steady = viform.Viform.from_planes(planes, CLOCK)
    for drive in ("impulse", "hold", "causal"):
        display = viform.Display(drive, exposure="10 ms", row_scan=0)
        seen = display.show(steady, EVERY, at=[2000, 1500], white_rate=1.0)
        assert seen.instants == (2000, 1500) and seen.white_rate == 1 and seen.luminance == 300
        for images in seen.images.values():
            np.testing.assert_allclose(images, np.broadcast_to(1 / every, (2, 1, 4)), rtol=6e-3)
        half = display.show(steady, "camera", at=[2000], white_rate=0.5).images["camera"]
        np.testing.assert_allclose(half[0], 2 * seen.images["camera"][0], rtol=1e-6)
    assert seen.error.bound <= 1e-5 and seen.error.left_out == {}


def test_a_display_may_be_called_by_several_threads(spikes: viform.Viform) -> None:
    display = viform.Display("hold")
    parts = [spikes, spikes[:100], spikes[:, 3:20, 5:40]]
    alone = [display.show(part).images["still"] for part in parts]
    with ThreadPoolExecutor(3) as pool:
        seen = list(pool.map(display.show, parts * 3))
    for n, each in enumerate(seen):
        np.testing.assert_array_equal(each.images["still"], alone[n % 3])
    text = repr(display)
    assert "hold" in text and "300 cd/m2" in text and "closed" not in text
    assert "still, 5 images of 64 x 48 pixels" in repr(seen[0])
    assert seen[0]._repr_png_().startswith(b"\x89PNG")
    assert any("white is" in note for note in seen[0].notes)
    assert any("shorter than" in note for note in seen[0].notes)


def test_white_is_that_of_the_run_of_a_file(spikes: viform.Viform, tmp_path: Path) -> None:
    viform.save(spikes, tmp_path / "stream.zarr")
    (tmp_path / "result.json").write_text('{"metrics": {"white_rate": {"value": 0.75}}}')
    display, opened = viform.Display(), viform.open(tmp_path)
    rates = [display.show(each).white_rate for each in (tmp_path, opened, opened[:], spikes)]
    assert rates[:2] == [0.75, 0.75] and rates[2] == rates[3] == pytest.approx(0.6, abs=0.05)
    first = viform.show(tmp_path, duration="1 ms", **{"image.at": [3, 39]})
    assert first.instants == (3, 39)
    again = display.show(opened[:40], at=[3, 39], white_rate=0.75)
    np.testing.assert_array_equal(first.images["still"], again.images["still"])


def test_what_cannot_be_shown_is_one_line(spikes: viform.Viform, tmp_path: Path) -> None:
    display, closed = viform.Display(), viform.Display()
    closed.close()
    calls = {
        "display.drive must be": lambda: viform.Display("hodl"),
        "display.lumniance must be a key that is known": lambda: viform.Display(lumniance=3),
        "display.luminance must be": lambda: viform.Display(luminance="3 m"),
        "a Display must be a simulated one": lambda: viform.Display(sink="serial:virtual"),
        "the OpenCL device must be": lambda: viform.Display(device="no such device"),
        "the display must be open, not closed": lambda: closed.show(spikes),
        "eye must be one or several of still, pursuing": lambda: display.show(spikes, "eye"),
        "eye must be one or several": lambda: display.show(spikes, []),
        "eye must be .* not 3": lambda: display.show(spikes, 3),
        "at must be cycles from 0 to 232": lambda: display.show(spikes, at=[233]),
        "at must be cycles .* not 7": lambda: display.show(spikes, at=7),
        "at must be cycles .* one or more": lambda: display.show(spikes, at=[]),
        "white_rate must be above 0": lambda: display.show(spikes, white_rate=0),
        "white_rate must be .* not '0.5'": lambda: display.show(spikes, white_rate="0.5"),
        "the stream must be a Viform": lambda: display.show(np.zeros((2, 3, 4), bool)),
        "the stream must be a Viform, .*, not NoneType": lambda: display.show(None),
        "the stream must be a cycle of a pixel": lambda: display.show(
            viform.Viform(np.zeros((1, 0, 4), np.uint32), 9, CLOCK)
        ),
        "no_such_file": lambda: display.show(tmp_path / "no_such_file.npz"),
        "display.width and display.height must be the stream's 64 x 48": lambda: viform.Display(
            width=8, height=8
        ).show(spikes),
        "keys of .sensor. must be white_rate alone": lambda: viform.show(
            spikes, **{"sensor.clock": "10 kHz"}
        ),
        "image.at must be cycles below 233": lambda: viform.show(spikes, **{"image.at": [233]}),
        "duration must be from one cycle": lambda: viform.show(spikes, duration="1 s"),
        "out must be given for what": lambda: viform.show(spikes, **{"camera.kind": "frames"}),
        "resume must be given with out": lambda: viform.show(spikes, resume=True),
        "the stream must be a Viform, .*, not int": lambda: viform.show(3),
    }  # fmt: skip
    for says, call in calls.items():
        with pytest.raises(viform.InputError, match=says) as raised:
            call()
        assert "\n" not in str(raised.value) and "--" not in str(raised.value), str(raised.value)
    assert "closed" in repr(closed)
