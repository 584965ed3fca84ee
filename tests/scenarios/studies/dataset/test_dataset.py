"""Data sets: read by the rules of other loaders, made again bit for bit, resumed, and refused."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import importlib.util
import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

import viform as api
from cosim import InputError, Interrupted
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.run.result import dumps
from scenarios.run import run_scenario
from scenarios.scenes.objects.plate import CATEGORIES
from scenarios.studies.dataset import build, item
from scenarios.studies.dataset.build import order_of
from scenarios.studies.dataset.item import run_lengths, write_flo
from scenarios.studies.dataset.order import Order, Places, read_split
from tests.survival.forked import copied

ROOT = Path(api.__file__).parent
SMALL = ("duration=2.5 ms", "image.at=[25, 50, 80]")
CAMERA = 'chip = "spikeone"\nwidth = 56\nheight = 40\n'
VARY = ("scene.speed=2:20", "sensor.threshold=500 e:1500 e:log", "scene.illuminance=600:2000 lux")


@pytest.fixture(scope="module")
def cameras(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("cameras")
    (folder / "plain.toml").write_text(f'[sensor]\n{CAMERA}threshold = "1000 e"\n')
    (folder / "noisy.toml").write_text(
        f'[sensor]\n{CAMERA}threshold = "1000 e"\nthreshold_noise = "20 e"\n'
    )
    return [str(folder / "plain.toml"), str(folder / "noisy.toml")]


def order(cameras: list[str], *sources: str, vary: tuple[str, ...] = VARY, **options: Any) -> Order:
    given: dict[str, Any] = {"samples": 2, "split": ".5,0,.5", "seed": 3, "tolerance": 1e-2}
    given |= options
    return order_of(sources or ("objects",), cameras, vary, SMALL, **given)


def made(
    asked: Order, folder: Path, resume: bool = False, progress: Any = None, workers: int = 1
) -> dict[str, Any]:
    return build.build_dataset(
        asked, folder, device=None, workers=workers, scheduler=None, resume=resume,
        progress=progress or QuietProgress(),
    )  # fmt: skip


@pytest.fixture(scope="module")
def whole(cameras: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two scenes of objects through two cameras, one scene in each of train and test."""
    folder = tmp_path_factory.mktemp("made") / "set"
    document = made(order(cameras), folder)
    assert (document["items"], document["failed"]) == (4, 0)
    return folder


def documents(folder: Path) -> dict[str, dict[str, Any]]:
    return {path.stem: json.loads(path.read_text()) for path in (folder / "items").iterdir()}


def decoded(path: Path, width: int, height: int) -> np.ndarray:
    """A .dat as the loaders of SpikeCV (`get_spike_matrix`) and Spike-Zoo (`load_vidar_dat`) read
    it: pixel n of a frame is bit n mod 8 of byte n // 8, and rows are turned upside down."""
    data = np.fromfile(path, np.uint8)
    n = np.arange(len(data) // (width * height // 8) * width * height)
    bits = (data[n // 8] >> (n % 8)) & 1
    return bits.reshape(-1, height, width)[:, ::-1]


def test_spikecv_finds_recordings_and_labels_by_its_directory(whole: Path) -> None:
    """`data_parameter_dict` with the absolute path of a folder of recordings: config.yaml is sought
    upwards, recordings and labels are paired in the order of their times."""
    place = whole / "train" / "spike"
    config = next(p / "config.yaml" for p in place.parents if (p / "config.yaml").is_file())
    assert config.parent == whole
    said = yaml.safe_load(config.read_text())
    assert said["is_labeled"] and 1 in said["labeled_data_type"] and 0 in said["labeled_data_type"]
    pieces = [
        said["label_field_identifier"] if p == said["data_field_identifier"] else p
        for p in place.parts
    ]
    recordings = sorted(place.glob("*.dat"), key=os.path.getmtime)
    labels = sorted(Path(*pieces).glob(f"*.{said['labeled_data_suffix']}"), key=os.path.getmtime)
    assert [p.stem for p in recordings] == [p.stem for p in labels] and len(labels) == 2
    items = api.SpikeDataset(whole, "train")
    for number, path in enumerate(recordings):
        spikes = decoded(path, said["spike_w"], said["spike_h"])
        assert spikes.shape == (100, 40, 56) and spikes.mean() > 0.05
        assert np.array_equal(spikes, items[number]["spikes"])


def test_spike_zoo_finds_recordings_and_images_by_its_rules(whole: Path) -> None:
    """`BaseDataset.prepare_data`: ROOT/SPLIT/spike/**/*.dat and ROOT/SPLIT/gt/**/*.png, sorted; the
    image is that of the middle cycle, and the spike rate is `rate` times it."""
    for split in ("train", "test"):
        recordings = sorted((whole / split / "spike").glob("**/*.dat"))
        images = sorted((whole / split / "gt").glob("**/*.png"))
        assert [p.stem for p in recordings] == [p.stem for p in images] and recordings
        for recording, image in zip(recordings, images, strict=True):
            rate = documents(whole)[image.stem]["metrics"]["white_rate"]["value"]
            spikes = decoded(recording, 56, 40)
            middle = cv2.imread(str(image), cv2.IMREAD_UNCHANGED) / 255
            near = spikes[50 - 20 : 50 + 21].mean(0) / rate
            assert np.corrcoef(near.ravel(), middle.ravel())[0, 1] > 0.9
            assert abs(near.mean() - middle.mean()) < 0.03


def test_an_item_is_the_run_of_its_scenario(
    whole: Path, cameras: list[str], tmp_path: Path
) -> None:
    asked = order(cameras).items()[1]
    run_scenario(
        "again", asked.scenario, tmp_path / "run", options=Options(), began=time.perf_counter(),
        progress=QuietProgress(), report=lambda machine, run: [],
    )  # fmt: skip
    again = api.open(tmp_path / "run")
    assert np.array_equal(
        again.planes(), decoded(whole / asked.split / "spike" / f"{asked.name}.dat", 56, 40)
    )


def test_truth_is_that_of_the_scene(whole: Path, cameras: list[str]) -> None:
    for asked in order(cameras).items()[::3]:
        scene = asked.scenario.scene.closed_form((40, 56))
        found = documents(whole)[asked.name]
        folder = whole / found["truth_folder"]
        arrays = np.load(folder / "truth.npz")
        assert arrays["cycle"].tolist() == found["instants"] == [25, 50, 80]
        np.testing.assert_array_equal(arrays["time_ps"], (arrays["cycle"] * 2 + 1) * 12_500_000)
        for n, t in enumerate(arrays["time_ps"] / 1e12):
            np.testing.assert_array_equal(arrays["light"][n], scene.reflectance(float(t)))
        shown = cv2.imread(str(folder / "light-000025.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(shown, np.rint(arrays["light"][0] * 255))
        np.testing.assert_array_equal(
            cv2.readOpticalFlow(str(folder / "flow-000050-000080.flo")), arrays["flow"][1]
        )
        for name in ("mask-000080.png", "occlusion-000050-000080.png"):
            kept = arrays["mask"][2] if name[0] == "m" else arrays["occlusion"][1]
            image = cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED)
            np.testing.assert_array_equal(image, kept)
        assert set(np.unique(arrays["occlusion"])) <= {0, 128, 255}


def test_light_of_an_item_comes_together_by_its_flow(whole: Path) -> None:
    for items in (api.SpikeDataset(whole, split) for split in ("train", "test")):
        for found in (items[n] for n in range(len(items))):
            y, x = np.mgrid[0:40, 0:56].astype(np.float32)
            for n in range(2):
                u, v = found["flow"][n]
                brought = cv2.remap(found["light"][n + 1], x + u, y + v, cv2.INTER_LINEAR)
                free = found["occlusion"][n] == 0
                error = np.mean((brought - found["light"][n])[free] ** 2)
                assert free.mean() > 0.3 and -10 * np.log10(error) > 40


def unpacked(counts: list[int], size: list[int]) -> np.ndarray:
    flat = np.repeat(np.arange(len(counts)) % 2, counts)
    return flat.reshape(size, order="F").astype(bool)


def test_boxes_are_those_of_coco(whole: Path) -> None:
    text = (whole / "train" / "coco.json").read_text()
    coco = json.loads(text)
    assert text == dumps(coco)  # it is written annotation by annotation
    assert [each["name"] for each in coco["categories"]] == list(CATEGORIES)
    images = {each["id"]: each for each in coco["images"]}
    assert len(images) == 6 and all((whole / "train" / i["file_name"]).is_file()
                                    for i in images.values())  # fmt: skip
    assert len({each["id"] for each in coco["annotations"]}) == len(coco["annotations"]) > 20
    for each in coco["annotations"]:
        image = images[each["image_id"]]
        mask = unpacked(each["segmentation"]["counts"], each["segmentation"]["size"])
        name = image["file_name"].replace("light", "mask")
        labels = cv2.imread(str(whole / "train" / name), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(mask, labels == each["track_id"] % 100)
        rows, columns = np.nonzero(mask)
        x, y, width, height = each["bbox"]
        assert each["area"] == rows.size
        assert (x, x + width) == (columns.min(), columns.max() + 1)
        assert (y, y + height) == (rows.min(), rows.max() + 1)


def test_a_flow_file_is_the_middlebury_format(tmp_path: Path) -> None:
    flow = np.arange(12, dtype=np.float32).reshape(2, 3, 2)
    write_flo(tmp_path / "a.flo", flow)
    data = (tmp_path / "a.flo").read_bytes()
    assert data[:4] == b"PIEH" and np.frombuffer(data, "<i4", 2, 4).tolist() == [3, 2]
    assert np.frombuffer(data, "<f4", offset=12).tolist() == list(range(12))
    assert np.array_equal(cv2.readOpticalFlow(str(tmp_path / "a.flo")), flow)


def test_run_lengths_begin_with_zeros() -> None:
    for mask in ([[1, 0], [1, 1]], [[0, 0], [0, 0]], [[1, 1], [1, 1]], [[0, 1], [1, 0]]):
        array = np.array(mask, bool)
        assert np.array_equal(unpacked(run_lengths(array), [2, 2]), array)
    assert run_lengths(np.array([[1, 0], [1, 1]], bool)) == [0, 2, 1, 1]


def test_the_sums_are_those_of_all_files(whole: Path) -> None:
    lines = [line.split("  ") for line in (whole / "SHA256SUMS").read_text().splitlines()]
    there = {p.relative_to(whole).as_posix() for p in whole.rglob("*") if p.is_file()}
    assert {name for _, name in lines} == there - {"SHA256SUMS"}
    for digest, name in lines:
        assert hashlib.sha256((whole / name).read_bytes()).hexdigest() == digest


def test_the_card_says_what_was_drawn(whole: Path) -> None:
    text = (whole / "README.md").read_text()
    for said in (*(f"| {' | '.join(v.split('=', 1))} |" for v in VARY), "| train | 2 | 1 |",
                 "Seed of everything drawn: 3", "License: (state yours", "56 x 40"):  # fmt: skip
        assert said in text
    for found in documents(whole).values():
        assert 2 <= float(found["drawn"]["scene.speed"]) <= 20
        assert found["scenario"]["scene"]["speed"] == float(found["drawn"]["scene.speed"])
        assert str(ROOT) not in json.dumps(found) and "run_time_s" not in json.dumps(found)


def test_cameras_of_a_view_share_its_scene_and_its_split(cameras: list[str]) -> None:
    items = order(cameras, samples=5).items()
    for a, b in zip(items[::2], items[1::2], strict=True):
        assert a.scenario.scene == b.scenario.scene and a.split == b.split and a.view == b.view
        assert a.scenario.seed != b.scenario.seed
        assert a.values["sensor.threshold"] != b.values["sensor.threshold"]
    assert len({each.scenario.scene.layout for each in items}) == 5
    assert items == order(cameras, samples=5).items() != order(cameras, samples=5, seed=4).items()
    fixed = order_of(["objects"], cameras, [], ["scene.layout=7"], 2, "1,0", 1, None).items()
    assert {each.scenario.scene.layout for each in fixed} == {7}


def test_splits_are_apportioned_and_keep_clips_together(
    cameras: list[str], tmp_path: Path, make_clip: Callable[..., Path]
) -> None:
    for n in range(10):
        make_clip(tmp_path / f"{n}.mkv", np.zeros((2, 16, 16), np.uint8))
    items = order_of([str(tmp_path)], cameras, [], [], 3, ".7,.1,.2", 1, None).items()
    clips = {(each.source, each.split) for each in items}
    assert len(items) == 60 and len(clips) == 10
    assert sorted(split for _, split in clips) == ["test"] * 2 + ["train"] * 7 + ["val"]
    assert read_split(".9,.1") == (0.9, 0.0, 0.1)


@pytest.fixture
def stopping(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Any], None]]:
    """Makes the writing of the third recording fail once, with the exception that is given."""

    def stop_with(exception: Any) -> None:
        real, calls = item.write_stream, []

        def write(*arguments: Any) -> Any:
            calls.append(1)
            if len(calls) == 3:
                raise exception
            return real(*arguments)

        monkeypatch.setattr(item, "write_stream", write)

    yield stop_with


@pytest.mark.parametrize("how", ["interrupt", "disk"])
def test_what_was_stopped_goes_on_with_the_same_bits(
    how: str, whole: Path, cameras: list[str], tmp_path: Path, stopping: Callable[[Any], None]
) -> None:
    folder = tmp_path / "other"
    full = OSError(errno.ENOSPC, "No space left on device", "x")
    stopping(KeyboardInterrupt() if how == "interrupt" else full)
    says = "after 2 of 4 items; go on with" if how == "interrupt" else "where there is room"
    with pytest.raises((InputError, Interrupted), match=says) as found:
        made(order(cameras), folder)
    assert "--resume" in str(found.value) and str(folder) in str(found.value)
    assert not (folder / "SHA256SUMS").exists() and len(documents(folder)) == 2
    first = min((folder / "train" / "spike").iterdir(), default=None) or min(
        (folder / "test" / "spike").iterdir()
    )
    first.write_bytes(b"damaged")
    with pytest.raises(InputError, match="--resume must be the dataset that"):
        made(order(cameras, seed=4), folder, resume=True)
    made(order(cameras), folder, resume=True)
    assert (folder / "SHA256SUMS").read_text() == (whole / "SHA256SUMS").read_text()


@pytest.mark.slow
def test_a_killed_process_goes_on_with_the_same_bits(
    whole: Path, cameras: list[str], tmp_path: Path
) -> None:
    words = ["dataset", "objects", "--out", str(tmp_path / "d"), "--samples", "2", "--split",
             ".5,0,.5", "--seed", "3", "--tolerance", "1e-2"]  # fmt: skip
    words += [word for each in cameras for word in ("--camera", each)]
    words += [word for each in VARY for word in ("--vary", each)]
    words += [word for each in SMALL for word in ("--set", each)]
    command = [sys.executable, "-c", "from scenarios.cli import main; main()", *words]
    running = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
    while running.poll() is None and len([*(tmp_path / "d").glob("items/*.json")]) < 2:
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    running.wait()
    assert len(documents(tmp_path / "d")) < 4 and not (tmp_path / "d" / "SHA256SUMS").exists()
    done = subprocess.run([*command, "--resume", "--json"], cwd=ROOT, capture_output=True)
    assert done.returncode == 0 and json.loads(done.stdout)["failed"] == 0
    assert (tmp_path / "d" / "SHA256SUMS").read_text() == (whole / "SHA256SUMS").read_text()


class Told(QuietProgress):
    """A progress that keeps its texts."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def tell(self, what: str) -> None:
        self.texts.append(what)


def test_the_pace_is_told_in_items(cameras: list[str], tmp_path: Path) -> None:
    told = Told()
    made(order(cameras[:1], samples=6), tmp_path / "d", progress=told)
    assert told.texts and all(
        re.fullmatch(r"d: 6 items, [0-9.e+]+ a second", text) for text in told.texts
    )


def test_what_a_worker_is_sent_does_not_grow_with_the_data_set(cameras: list[str]) -> None:
    sizes = [
        len(pickle.dumps(Places(Path("d"), order(cameras, samples=n).items()))) for n in (1, 20)
    ]
    assert sizes[0] == sizes[1] < 1000


def spent(pid: int) -> dict[int, float]:
    """Memory of a process and of its children, MB by number."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")
    found = {}
    for each in (pid, *(int(child) for path in threads for child in path.read_text().split())):
        with contextlib.suppress(OSError):  # it has ended
            pages = int(Path(f"/proc/{each}/statm").read_text().split()[1])
            found[each] = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    return found


@pytest.mark.slow
def test_a_long_data_set_that_is_stopped_has_the_same_files_and_takes_no_more_memory(
    cameras: list[str], tmp_path: Path
) -> None:
    """Stopped by SIGTERM after 15 of 120 items, and a worker killed after 25, against one worker
    that nobody stops. Memory is that of each process over the last half of the items."""
    frames = np.random.default_rng(1).integers(0, 256, (4, 40, 56), dtype=np.uint8)
    np.save(tmp_path / "clip.npy", frames)
    words = ["--samples", "120", "--check", "0", "--split", ".5,0,.5", "--tolerance", "1e-2"]
    given = ("scene.frame_rate=1 kHz", "scene.illuminance=900 lux", *SMALL)
    words += [word for each in given for word in ("--set", each)]
    words += ["--vary", "sensor.threshold=500 e:1500 e", "--camera", cameras[0]]
    command = [sys.executable, "-c", "from scenarios.cli import main; main()", "dataset",
               str(tmp_path / "clip.npy"), *words, "--out"]  # fmt: skip
    once = subprocess.run([*command, str(tmp_path / "once")], cwd=ROOT, capture_output=True)
    assert once.returncode == 0, once.stderr
    folder = tmp_path / "often"
    command += [str(folder), "--workers", "2"]

    def count() -> int:
        return len([*folder.glob("items/*.json")])

    running = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE)
    while running.poll() is None and count() < 15:
        time.sleep(0.01)
    running.send_signal(signal.SIGTERM)
    said = running.communicate()[1]
    assert running.returncode == 130 and b"--resume" in said and count() < 120
    running = subprocess.Popen([*command, "--resume"], cwd=ROOT, stderr=subprocess.DEVNULL)
    killed, least, most = False, dict[int, float](), dict[int, float]()
    while running.poll() is None:
        memory, done = spent(running.pid), count()
        if done >= 25 and len(memory) == 3 and not killed:
            os.kill(max(memory), signal.SIGKILL)
            killed = True
        if done >= 60:
            for pid, size in memory.items():
                least.setdefault(pid, size)
                most[pid] = max(most.get(pid, 0.0), size)
        time.sleep(0.02)
    assert running.returncode == 0 and killed and len(most) == 3
    assert max(most[pid] - least[pid] for pid in most) < 24, (least, most)
    sums = [(place / "SHA256SUMS").read_text() for place in (tmp_path / "once", folder)]
    assert sums[0] == sums[1] and count() == 120


def test_a_clip_that_is_none_is_left_out_in_one_line(
    cameras: list[str], tmp_path: Path, make_clip: Callable[..., Path], viform: Callable[..., Any]
) -> None:
    clips = tmp_path / "clips"
    clips.mkdir()
    frames = np.random.default_rng(1).integers(0, 256, (4, 40, 56), dtype=np.uint8)
    make_clip(clips / "good.mkv", frames, rate=1000)
    (clips / "bad.mkv").write_text("no clip")
    words = [word for each in cameras for word in ("--camera", each)]
    words += [word for each in SMALL for word in ("--set", each)]
    words += ["--tolerance", "1e-2", "--split", "1,0", "--out", tmp_path / "d", "--json"]
    answer = viform("dataset", clips, *words)
    assert answer.code == 1
    assert answer.err.count("\n") == 1 and "bad.mkv" in answer.err
    document = json.loads(answer.out)
    assert (document["items"], document["failed"]) == (4, 2)
    assert "bad.mkv" in (tmp_path / "d" / "README.md").read_text()
    items = api.SpikeDataset(tmp_path / "d")
    assert len(items) == 2 and set(items[0]) == {"name", "spikes", "light", "instants"}
    assert documents(tmp_path / "d")["0001-good-plain"]["source_sha256"] == (
        hashlib.sha256((clips / "good.mkv").read_bytes()).hexdigest()
    )
    make_clip(clips / "bad.mkv", frames[::-1], rate=1000)
    assert viform("dataset", clips, *words, "--resume").code == 0
    assert len(api.SpikeDataset(tmp_path / "d")) == 4
    # Items of a clip that has changed since are made again.
    make_clip(clips / "good.mkv", frames[:, ::-1], rate=1000)
    assert viform("dataset", clips, *words, "--resume").code == 0
    again = documents(tmp_path / "d")["0001-good-plain"]
    assert again["source_sha256"] == hashlib.sha256((clips / "good.mkv").read_bytes()).hexdigest()


def test_several_sizes_have_a_folder_each(tmp_path: Path) -> None:
    for name, width in (("a", 48), ("b", 32)):
        (tmp_path / f"{name}.toml").write_text(
            f'[sensor]\nthreshold = "1000 e"\nwidth = {width}\nheight = 24\n'
        )
    document = api.dataset(
        "objects", out=tmp_path / "d", cameras=[tmp_path / "a.toml", tmp_path / "b.toml"],
        split="1,0", tolerance=1e-2, duration="2.5 ms", vary={"sensor.lens.f_number": "1.5:2.5"},
        **{"image.at": [50], "scene.objects": 3},
    )  # fmt: skip
    assert document["splits"]["train"] == ["0000-objects-a", "0000-objects-b"]
    for width in (48, 32):
        place = tmp_path / "d" / f"{width}x24"
        assert yaml.safe_load((place / "config.yaml").read_text())["spike_w"] == width
        assert len([*(place / "train" / "spike").glob("*.dat")]) == 1
    found = documents(tmp_path / "d")
    numbers = [float(each["drawn"]["sensor.lens.f_number"]) for each in found.values()]
    assert sorted(n < 2 for n in numbers) == [False, True]  # one in each half of the range
    assert [each["metrics"]["f_number"]["value"] for each in found.values()] == numbers
    assert "rate=-1" in (tmp_path / "d" / "README.md").read_text()  # Spike-Zoo: it varies
    one = api.SpikeDataset(tmp_path / "d", camera="b")
    assert one[0]["spikes"].shape == (100, 24, 32)
    assert one[0]["flow"].shape == (0, 2, 24, 32)  # one instant has no flow


def test_items_are_arrays_of_the_stated_shapes(whole: Path) -> None:
    items = api.SpikeDataset(whole, "train", cycles=31)
    assert len(items) == 2
    first = items[0]
    shapes = {key: (value.shape, value.dtype) for key, value in first.items() if key != "name"}
    assert shapes == {
        "spikes": ((31, 40, 56), np.uint8), "light": ((3, 40, 56), np.float32),
        "instants": ((3,), np.int64), "flow": ((2, 2, 40, 56), np.float32),
        "occlusion": ((2, 40, 56), np.uint8), "depth": ((3, 40, 56), np.float32),
        "mask": ((3, 40, 56), np.uint8), "boxes": ((3, 8, 4), np.float32),
    }  # fmt: skip
    assert np.array_equal(first["spikes"], api.SpikeDataset(whole)[0]["spikes"][34:65])
    assert first["instants"].tolist() == [-9, 16, 46]
    with pytest.raises(IndexError):
        items[2]
    for wrong, says in (
        ({"split": "tset"}, "split must be one of train"),
        ({"split": "val"}, "with items in this split"),
        ({"camera": "none"}, "test of noisy, test of plain, train of noisy"),
        ({"cycles": 101}, "cycles must be 1 to 100"),
    ):
        with pytest.raises(InputError, match=says):
            api.SpikeDataset(whole, **wrong)
    with pytest.raises(InputError, match="a folder of `viform dataset`"):
        api.SpikeDataset(whole / "items")


def test_an_unfinished_data_set_is_opened_on_request_alone(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    shutil.copytree(whole, folder)
    (folder / "SHA256SUMS").unlink()  # which is written last
    last = sorted((folder / "items").glob("*.json"))[-1]
    split = json.loads(last.read_text())["split"]
    last.unlink()
    with pytest.raises(InputError, match=r"^the data set must be finished, not .* with 3 of 4 "):
        api.SpikeDataset(folder, split)
    assert len(api.SpikeDataset(folder, split, unfinished=True)) == 1
    assert len(api.SpikeDataset(whole, split)) == 2


@pytest.mark.parametrize("given", [{"workers": 0}, {"scheduler": "nowhere"}])
def test_workers_that_are_none_are_refused_in_python(given: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        api.dataset("objects", out=tmp_path / "set", **given)
    said = str(raised.value)
    assert said.startswith(f"--{next(iter(given))} must be") and "\n" not in said
    assert "Error" not in said and not (tmp_path / "set" / "items").exists()


@pytest.mark.skipif(
    importlib.util.find_spec("torch") is None, reason="needs PyTorch, the extra torch"
)
def test_pytorch_loads_batches(whole: Path) -> None:
    import torch
    from torch.utils.data import DataLoader, Dataset

    items = api.torch_dataset(whole, "train", cycles=32)
    assert isinstance(items, Dataset)
    plain = api.SpikeDataset(whole, "train", cycles=32)
    for workers in (0, 2):
        batches = [*DataLoader(items, batch_size=2, num_workers=workers)]
        assert len(batches) == 1 and batches[0]["name"] == [plain[n]["name"] for n in (0, 1)]
        for key in ("spikes", "light", "flow", "occlusion", "depth", "mask", "boxes"):
            assert torch.equal(
                batches[0][key], torch.from_numpy(np.stack([plain[0][key], plain[1][key]]))
            )


def test_an_item_that_is_measured_has_the_files_of_one_that_is_not(
    cameras: list[str], tmp_path: Path
) -> None:
    found = []
    for check in (0, 1):
        asked = order(cameras[1:], samples=1, check=check)
        made(asked, tmp_path / f"{check}")
        found += documents(tmp_path / f"{check}").values()
    plain, measured = found
    assert plain["files"] == measured["files"] and len(plain["files"]) > 10
    assert plain["error"]["value"] is None and plain["error"]["bound"] > 0
    assert measured["error"]["value"] is not None and "bound" not in measured["error"]
    assert plain["plan"]["kept"] == measured["plan"]["kept"]
    for name in ("white_rate", "f_number", "spike_rate"):
        assert plain["metrics"][name] == measured["metrics"][name]
    with pytest.raises(InputError, match="--check must be 0 or more, not -1"):
        order(cameras, check=-1)


def test_items_are_read_in_a_forked_process(whole: Path) -> None:
    """The loader of PyTorch forks its workers by default."""
    items = api.SpikeDataset(whole, "train")

    def sums() -> list[int]:
        return [int(items[n]["spikes"].sum()) for n in range(len(items))]

    assert copied(sums) == str(sums())


def test_without_pytorch_one_line_says_so(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "scenarios.studies.dataset.tensors", raising=False)
    with pytest.raises(InputError, match=r"without it; pip install 'viform\[torch\]'"):
        api.torch_dataset(whole)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "SOURCE must be a scenario, a clip or a folder of clips, not absent"),
        (("nosuch",), "SOURCE must be one of"),
        (("objects", "objects"), "SOURCE must be named once"),
        (("light-link",), "one with a [scene] for `viform dataset`"),
        (("emccd-window",), "one of a spike camera"),
        (("objects", "--camera", "nosuch"), "--camera must be one of spiketwo"),
        (("objects", "--camera", "spikeone", "--camera", "spikeone"), "spikeone twice"),
        (("objects", "--split", ".8,.1"), "--split must be shares"),
        (("objects", "--split", "a"), "--split must be shares"),
        (("objects", "--samples", "0"), "--samples must be 1 to"),
        (("objects", "--workers", "0"), "--workers must be 1 to 1024"),
        (("objects", "--set", "seed=3"), "seed must be given by --seed"),
        (("objects", "--vary", "scene.speeed=1:2"), "scene.speeed"),
        (("objects", "star", "--vary", "scene.speed=1:2"), "scene.speed in star must be"),
        (("objects", "--vary", "scene.speed=1:2", "--vary", "scene.speed=1:3"), "a key once"),
        (("objects", "--set", "sensor.width=13"), "must be a multiple of 8"),
        (("objects", "--set", "sensor.pixel=asynchronous"), "must be latched"),
        (("objects", "--set", "scene.illuminance=1e-3 lux"), "scene.illuminance must be at least"),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_is_written(
    words: tuple[str, ...], says: str, tmp_path: Path, refused: Callable[..., str]
) -> None:
    said = refused("dataset", *words, "--out", tmp_path / "d")
    assert says in said
    assert not (tmp_path / "d").exists()


def test_an_error_names_its_camera(tmp_path: Path, refused: Callable[..., str]) -> None:
    (tmp_path / "mine.toml").write_text("[sensor]\nwidth = 96\nheight = 64\n")
    said = refused("dataset", "star", "--camera", tmp_path / "mine.toml", "--out", tmp_path / "d")
    assert f"sensor.threshold in star, camera {tmp_path / 'mine.toml'} must be given" in said


def test_the_example_of_the_documentation_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs/dataset.md").read_text(), re.DOTALL)
    assert len(examples) == 1
    monkeypatch.chdir(tmp_path)
    exec(compile(examples[0], "docs/dataset.md", "exec"), {})
