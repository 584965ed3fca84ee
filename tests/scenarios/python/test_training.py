"""Clips that are filmed while a network trains: draws, workers, forks, and refusals."""

from __future__ import annotations

import importlib
import pickle
import sys
from functools import partial
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import viform
from cosim import InputError
from cosim.compute.opencl import Device
from scenarios.python import training
from tests.survival.forked import copied

SMALL = {"width": 32, "height": 24, "threshold": "100 e", "device": "numba"}
CLIPS = np.random.default_rng(1).integers(100, 250, (5, 3, 24, 32), dtype=np.uint8)


def stream(clips: object = CLIPS, **options: object) -> viform.SpikeStream:
    return viform.SpikeStream(clips, viform.Camera(**SMALL), 2000, **options)  # type: ignore


def test_clips_have_draws_of_their_own_in_each_epoch() -> None:
    given = stream(instants=[0, 59])
    items = list(given)
    assert [item["number"] for item in items] == [0, 1, 2, 3, 4]
    seen, light, at = viform.Camera(**SMALL).film_with_truth(CLIPS[3], 2000, call=3)
    assert np.array_equal(items[3]["spikes"], seen.planes()) and at == (30,)
    assert items[3]["light"].shape == (2, 24, 32) and light.shape == (1, 24, 32)
    assert items[3]["instants"].tolist() == [0, 59]
    again = next(iter(given))  # the next epoch
    given.set_epoch(1)
    assert np.array_equal(next(iter(given))["spikes"], again["spikes"])
    assert (again["spikes"] != items[0]["spikes"]).any()
    assert np.array_equal(again["light"], items[0]["light"])


class Loader(ModuleType):
    """As much of PyTorch as a stream needs."""

    class IterableDataset:
        pass

    worker: SimpleNamespace | None = None


@pytest.mark.parametrize("clips", [CLIPS, (clip for clip in CLIPS)], ids=["items", "iterable"])
def test_workers_share_the_clips(clips: object, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = [item["spikes"] for item in stream()]
    torch, utils, data = ModuleType("torch"), ModuleType("torch.utils"), Loader("data")
    torch.from_numpy = lambda array: array  # type: ignore[attr-defined]
    data.get_worker_info = lambda: data.worker  # type: ignore[attr-defined]
    for module in (torch, utils, data):
        name = {"data": "torch.utils.data"}.get(module.__name__, module.__name__)
        monkeypatch.setitem(sys.modules, name, module)
    try:
        taken = importlib.reload(training).SpikeStream(clips, viform.Camera(**SMALL), 2000)
        assert isinstance(taken, Loader.IterableDataset)
        data.worker = SimpleNamespace(id=1, num_workers=2)
        items = list(taken)
    finally:
        monkeypatch.undo()
        importlib.reload(training)
    assert [item["number"] for item in items] == [1, 3]
    assert all(np.array_equal(item["spikes"], whole[item["number"]]) for item in items)


def test_a_camera_goes_to_another_process() -> None:
    camera = viform.Camera(**SMALL, seed=5)
    again = pickle.loads(pickle.dumps(camera))
    assert again.film(CLIPS[0], 2000) == camera.film(CLIPS[0], 2000)
    assert repr(again) == repr(camera)


def test_a_worker_is_forked_before_anything_is_filmed() -> None:
    """In a process of its own: this one has filmed."""
    code = (
        "import os, sys, numpy as np, viform\n"
        "camera = viform.Camera(width=32, height=24, threshold='100 e')\n"
        "stream = viform.SpikeStream(np.full((2, 3, 24, 32), 200, np.uint8), camera, 2000)\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    sys.stdout.write(str([int(item['spikes'].sum()) > 0 for item in stream]))\n"
        "    sys.stdout.flush()\n"
        "    os._exit(0)\n"
        "os._exit(os.waitpid(child, 0)[1])\n"
    )
    import subprocess

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "[True, True]"), done.stderr


def test_a_fork_after_a_film_says_how_to_start_workers(device: Device) -> None:
    before = {}
    for name in ("numba", None):  # threads of compiled functions are begun anew, not OpenCL's
        camera = viform.Camera(**SMALL | {"device": name})
        before[name] = camera, camera.film(CLIPS[0], 2000, call=0).words

    def again(name: str | None) -> str:
        camera, words = before[name]
        try:
            return str((camera.film(CLIPS[0], 2000, call=0).words == words).all())
        except InputError as exc:
            return str(exc)

    assert copied(partial(again, "numba")) == "True"
    assert 'multiprocessing_context="spawn"' in copied(partial(again, None))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"clips": 3}, "clips must be frames of several clips"),
        ({"camera": 3}, "camera must be a viform.Camera"),
        ({"frame_rate": 0}, "frame_rate must be"),
        ({"frame_rate": True}, "frame_rate must be"),
        ({"clips": {0: CLIPS[0]}}, "clips must be frames of several clips"),
        ({"white_rate": 7}, "white_rate must be above 0"),
        ({"instants": 5}, "instants must be numbers of cycles"),
        ({"instants": [True]}, "instants must be numbers of cycles"),
    ],
)
def test_what_cannot_be_streamed(given: dict, said: str) -> None:
    arguments = {"clips": CLIPS, "camera": viform.Camera(**SMALL), "frame_rate": 2000} | given
    with pytest.raises(InputError, match=said):
        viform.SpikeStream(**arguments)
    with pytest.raises(InputError, match="epoch must be"):
        stream().set_epoch(-1)
