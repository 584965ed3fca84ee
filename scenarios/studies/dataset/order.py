"""What is asked for: the items of a data set, with their scenarios, drawn from one seed; and where
their files stand, so that the loaders of SpikeCV and Spike-Zoo read them.

    [SIZE/]config.yaml           SpikeCV's description of the recordings
    [SIZE/]SPLIT/spike/NAME.dat  the recording
    [SIZE/]SPLIT/gt/NAME.png     true light in its middle
    [SIZE/]SPLIT/truth/NAME/     truth at the instants
    [SIZE/]SPLIT/coco.json       boxes and masks
    items/NAME.json              what the item is, with the SHA-256 of its files; written last

Both loaders know one size in a folder, so that several sizes have a folder each. Spike-Zoo
(`BaseDataset`) pairs the sorted .dat of ROOT/SPLIT/spike with the sorted images of ROOT/SPLIT/gt.
SpikeCV (`data_parameter_dict`) looks for config.yaml upwards from the folder of the recordings,
replaces the folder `spike` of their path by `gt`, and pairs both by the time of the last change.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import yaml

from cosim import InputError
from cosim.files.atomic import atomic_write
from cosim.files.config_yaml import CONFIG
from cosim.files.dat import HEAD_SIZE
from scenarios.assemble.schema.loading import filmed, load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.studies.batch.axes import MOST, Axis, check_axes, latin_hypercube
from scenarios.studies.dataset.inputs import CameraChoice, SourceChoice
from scenarios.studies.dataset.reading import SPLITS, SUMS

CHECK: Final = 100
"""One item of so many is measured against full physics."""
_SHARED: Final = ("duration", "image.at")
"""Keys that a view has in common for all cameras, besides those of [scene]."""
_LAYOUT, _NOISE, _VIEWS, _ITEMS, _SPLIT = range(5)
"""Numbers of the streams of random numbers."""
PARTS: Final = ".parts"
"""Folder for items that are not finished."""
_TIME: Final = 946_684_800
"""Time of the first recording's file: the start of the year 2000, UTC. Each next is a second
later."""


@dataclass(frozen=True)
class Item:
    """One recording of the data set.

    Attributes:
        name: name of the item's files.
        view: number of the scene that it shows; all cameras see the same one.
        source: source as the user named it.
        camera: label of the camera.
        split: train, val or test.
        values: keys that were drawn, with their values.
        scenario: the checked scenario.
    """

    name: str
    view: int
    source: str
    camera: str
    split: str
    values: dict[str, str]
    scenario: Scenario


def read_split(text: str) -> tuple[float, ...]:
    """Shares of train, val and test; of two numbers, those of train and test.

    Raises:
        InputError: the text is no two or three shares that sum to 1.
    """
    try:
        shares = [float(each) for each in text.split(",")]
    except ValueError:
        shares = []
    if len(shares) == 2:
        shares.insert(1, 0.0)
    if len(shares) != 3 or min(shares) < 0 or not abs(sum(shares) - 1) < 1e-6:
        raise InputError(
            "--split", "shares of train, val and test that sum to 1", repr(text),
            "write --split .8,.1,.1, or two shares for train and test",
        )  # fmt: skip
    return tuple(shares)


@dataclass(frozen=True)
class Order:
    """A data set as it was asked for.

    Attributes:
        sources, cameras: every source is filmed by every camera.
        axes: keys that vary. Those of [scene] are drawn for each view, the others for each item.
        assignments: assignments of --set.
        samples: views of each source.
        split: shares of train, val and test.
        seed: seed of everything that is drawn, and of the noise.
        tolerance: tolerance of each run; that of the scenario if None.
        check: an item of so many is measured against full physics; 0 for none.
    """

    sources: tuple[SourceChoice, ...]
    cameras: tuple[CameraChoice, ...]
    axes: tuple[Axis, ...] = ()
    assignments: tuple[str, ...] = ()
    samples: int = 1
    split: tuple[float, ...] = (0.8, 0.1, 0.1)
    seed: int = 1
    tolerance: float | None = None
    check: int = CHECK

    def __post_init__(self) -> None:
        check_axes(self.axes, self.assignments)
        count = len(self.sources) * len(self.cameras)
        most = MOST // max(count, 1)
        if not 1 <= self.samples <= most:
            raise InputError(
                "--samples", f"1 to {most}", f"{self.samples}",
                f"write {1 if self.samples < 1 else most}",
            )  # fmt: skip
        if self.check < 0:
            raise InputError("--check", "0 or more", f"{self.check}", f"write --check {CHECK}")
        if not 0 <= self.seed < 2**32:
            raise InputError("--seed", "0 to 4294967295", f"{self.seed}", "write one of these")
        reserved = {"seed": "--seed", "tolerance": "--tolerance"}
        for key in (*(axis.key for axis in self.axes), *map(_key, self.assignments)):
            if key in reserved:
                raise InputError(
                    key,
                    f"given by {reserved[key]}",
                    "by another",
                    f"leave it out, and give {reserved[key]}",
                )

    def _number(self, stream: int, n: int) -> int:
        """A number below 2^32 of a stream of random numbers."""
        return int(np.random.SeedSequence([self.seed, stream, n]).generate_state(1)[0])

    def _drawn(self, stream: int, axes: Sequence[Axis], count: int) -> list[dict[str, str]]:
        if not axes:
            return [{} for _ in range(count)]
        points = latin_hypercube(axes, count, self._number(stream, 0))
        return [dict(zip((axis.key for axis in axes), point, strict=True)) for point in points]

    def items(self) -> list[Item]:
        """All items, those of a view one after another. Raises InputError for a key or a value that
        no scenario has."""
        views = [source for source in self.sources for _ in range(self.samples)]
        splits = self._splits(views)
        shared = [axis for axis in self.axes if _is_shared(axis.key)]
        own = [axis for axis in self.axes if not _is_shared(axis.key)]
        of_views = self._drawn(_VIEWS, shared, len(views))
        of_items = self._drawn(_ITEMS, own, len(views) * len(self.cameras))
        found: list[Item] = []
        for view, source in enumerate(views):
            for camera in self.cameras:
                number = len(found)
                values = of_views[view] | of_items[number]
                scenario = self._scenario(source, camera, values, view, number)
                label = camera.label
                if camera.chip is None and camera.section is None:
                    label = scenario.sensor.chip
                name = f"{view:04}-{source.label}-{label}"
                found.append(Item(name, view, source.given, label, splits[view], values, scenario))
        return found

    def _scenario(
        self, source: SourceChoice, camera: CameraChoice, values: dict[str, str], view: int,
        number: int,
    ) -> Scenario:  # fmt: skip
        given = [*self.assignments, *(f"{key}={value}" for key, value in values.items())]
        if source.clip is not None:
            given.insert(0, f"scene.path={source.clip}")
        if camera.chip is not None:
            given.insert(0, f"sensor.chip={camera.chip}")
        sections = None if camera.section is None else {"sensor": camera.section}
        try:
            _, scenario = load(
                source.scenario, given, tolerance=self.tolerance,
                seed=self._number(_NOISE, number), sections=sections,
            )  # fmt: skip
        except InputError as exc:
            place = f"{source.given}, camera {camera.given}" if camera.given else source.given
            what = f"{exc.what} in {place}"
            raise InputError(what, exc.must, exc.actual, exc.remedy) from exc
        latched = _latched(filmed(scenario, "dataset"), source.given)
        if "layout" in type(latched.scene).model_fields and not any(
            key == "scene.layout" for key in (*map(_key, given),)
        ):
            drawn = latched.scene.model_copy(update={"layout": self._number(_LAYOUT, view)})
            latched = latched.model_copy(update={"scene": drawn})
            values["scene.layout"] = str(self._number(_LAYOUT, view))
        return latched

    def _splits(self, views: Sequence[SourceChoice]) -> list[str]:
        """The split of each view. All views of a clip are in one, so that no scene is in two."""
        groups = [
            source.given if source.clip is not None else f"{source.given}:{n}"
            for n, source in enumerate(views)
        ]
        names = list(dict.fromkeys(groups))
        random = np.random.Generator(np.random.Philox(key=self._number(_SPLIT, 0)))
        order = random.permutation(len(names))
        counts = _apportion(len(names), self.split)
        of_rank = [split for split, count in zip(SPLITS, counts, strict=True) for _ in range(count)]
        chosen = {names[n]: of_rank[rank] for rank, n in enumerate(order)}
        return [chosen[group] for group in groups]


def _apportion(total: int, shares: Sequence[float]) -> list[int]:
    """Whole numbers that sum to `total`, by the largest remainder."""
    exact = [total * share for share in shares]
    counts = [int(each + 1e-9) for each in exact]
    rest = sorted(range(len(shares)), key=lambda n: counts[n] - exact[n])
    for n in rest[: total - sum(counts)]:
        counts[n] += 1
    return counts


def _key(assignment: str) -> str:
    return assignment.partition("=")[0].strip()


def _is_shared(key: str) -> bool:
    return key.startswith("scene.") or key in _SHARED


def _latched(scenario: Scenario, source: str) -> Scenario:
    """The scenario up to its stream. Raises InputError for one without spike planes of a simulated
    chip."""
    sensor = scenario.sensor
    if sensor.pixel != "latched" or sensor.source is not None:
        given = sensor.pixel if sensor.source is None else "a board"
        raise InputError(
            "sensor.pixel", "latched, of a simulated chip, for `viform dataset`",
            f"{given} in {source}", "name another scenario",
        )  # fmt: skip
    if scenario.link is not None:
        raise InputError(
            "link", "absent for `viform dataset`", f"in {source}", "name another scenario"
        )
    width, height = sensor.own_chip.width, sensor.own_chip.height
    if width * height % 8 or (width, height) == HEAD_SIZE:
        raise InputError(
            "the pixels of a camera", "a multiple of 8, for .dat files, and not 416 x 250",
            f"{width} x {height}", "change sensor.width or sensor.height",
        )  # fmt: skip
    return scenario.model_copy(update={"display": None, "camera": None, "code": None})


class Places:
    """Paths of a data set, relative to its folder.

    Args:
        folder: folder of the data set.
        items: all items.
    """

    def __init__(self, folder: Path, items: Sequence[Item]) -> None:
        self.folder = folder  # and nothing of all items: each worker is sent this with each item
        self._several = len({self.size(item) for item in items}) > 1

    def root(self, item: Item) -> str:
        """Folder of the items of one size, with a slash behind it; "" for that of the data set."""
        return "{}x{}/".format(*self.size(item)) if self._several else ""

    def size(self, item: Item) -> tuple[int, int]:
        """Width and height of an item."""
        chip = item.scenario.sensor.own_chip
        return chip.width, chip.height

    def recording(self, item: Item) -> str:
        return f"{self.root(item)}{item.split}/spike/{item.name}.dat"

    def image(self, item: Item) -> str:
        return f"{self.root(item)}{item.split}/gt/{item.name}.png"

    def truth(self, item: Item) -> str:
        return f"{self.root(item)}{item.split}/truth/{item.name}"

    def coco(self, item: Item) -> str:
        return f"{self.root(item)}{item.split}/coco.json"

    def document(self, item: Item) -> Path:
        return self.folder / "items" / f"{item.name}.json"

    def set_times(self, items: Sequence[Item]) -> None:
        """Gives recordings and images times of change in the order of their names."""
        for n, item in enumerate(sorted(items, key=lambda each: each.name)):
            for place in (self.recording(item), self.image(item)):
                os.utime(self.folder / place, (_TIME + n, _TIME + n))

    def files(self) -> Iterator[str]:
        """All files but the list of their sums, sorted."""
        for path in sorted(self.folder.rglob("*")):
            name = path.relative_to(self.folder).as_posix()
            if path.is_file() and name != SUMS and not name.startswith(PARTS):
                yield name


def digest_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_config(folder: Path, size: tuple[int, int]) -> None:
    """Writes SpikeCV's config.yaml: recordings with an image each (types 0, raw, and 1,
    reconstruction)."""
    text = yaml.safe_dump(
        {
            "filename": "dataset",  # public sets name the whole set
             "spike_w": size[0], "spike_h": size[1], "is_labeled": True,
            "labeled_data_type": [0, 1], "labeled_data_suffix": "png",
            "data_field_identifier": "spike", "label_field_identifier": "gt",
        },
        sort_keys=False, default_flow_style=None, allow_unicode=True,
    )  # fmt: skip
    with atomic_write(folder / CONFIG) as part:
        part.write_text(text, encoding="utf-8")
