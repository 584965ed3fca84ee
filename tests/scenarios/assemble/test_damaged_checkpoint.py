"""Interrupted runs whose checkpoint was rewritten with other arrays: one line, and nothing runs."""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cosim import InputError, Interrupted
from cosim.archive import load_arrays
from cosim.files import Recorder
from scenarios.assemble.source.latched.bands import BandedCamera
from tests.scenarios.assemble.source.latched.test_bands import SMALL as BANDS
from tests.scenarios.assemble.source.latched.test_bands import left, ran
from tests.scenarios.assemble.test_stepped import CASES, SINKS, SMALL

KINDS = {
    "film": ("film", (*SMALL, "image.at=[40]")),
    "glass": ("glass", (*SMALL, "image.at=[40]", "display.renderer=numpy", "display.beside=[]")),
    "asynchronous": ("film", (*SMALL, *CASES["asynchronous"])),
    "continuous": ("film", (*SMALL, *CASES["continuous"])),
}


@pytest.fixture
def stop() -> Callable[..., None]:
    """Interrupts this process at its first call."""
    calls = [signal.SIGINT]
    return lambda *_: os.kill(os.getpid(), calls.pop()) if calls else None


@pytest.mark.parametrize("kind", KINDS)
def test_no_run_goes_on_from_arrays_that_were_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: Callable[..., None], kind: str
) -> None:
    """Some arrays, one after another: each is cut, gone, or has a flipped bit."""
    name, sets = KINDS[kind]
    folder, sink = tmp_path / "run", Recorder
    if kind in CASES:
        sink = SINKS[kind]
    step = sink.step
    monkeypatch.setattr(sink, "step", lambda *given: stop() or step(*given))
    with pytest.raises(Interrupted):
        ran(name, sets, folder)
    monkeypatch.undo()
    path = folder / "checkpoint.npz"
    arrays = load_arrays(path)
    rng = random.Random(kind)
    for number, key in enumerate(rng.sample(sorted(arrays), 3)):
        array = arrays[key]
        data = bytearray(array.tobytes())
        others = {n: a for n, a in arrays.items() if n != key}
        if number % 3 == 0 and data and array.dtype.kind != "U":
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            others[key] = np.frombuffer(bytes(data), array.dtype).reshape(array.shape)
        elif number % 3 == 1 and array.size:
            others[key] = array.reshape(-1)[: array.size // 2]
        np.savez(path, **others)
        with pytest.raises(InputError, match="the checkpoint must be one that this run wrote"):
            ran(name, sets, folder, resume=True)
    assert not (folder / "result.json").exists()


@pytest.mark.parametrize("damage", ["flip", "cut", "empty"])
def test_a_damaged_band_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: Callable[..., None], damage: str
) -> None:
    whole = ran("film", BANDS, tmp_path / "whole", workers=1)
    folder = tmp_path / "run"
    monkeypatch.setattr(BandedCamera, "step", stop)
    with pytest.raises(Interrupted):
        ran("film", BANDS, folder, workers=1)
    monkeypatch.undo()
    (band,) = (folder / "bands").glob("*.npy")
    data = bytearray(band.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 4
    band.write_bytes(data if damage == "flip" else data[:-100] if damage == "cut" else b"")
    (folder / "checkpoint.npz").unlink(missing_ok=True)
    again = ran("film", BANDS, folder, workers=1, resume=True)
    np.testing.assert_array_equal(left(again)[0], left(whole)[0])
