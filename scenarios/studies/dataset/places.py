"""Where the files of a data set stand, so that the loaders of SpikeCV and Spike-Zoo read them.

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
from pathlib import Path
from typing import Final

import yaml

from cosim.files.config_yaml import CONFIG
from cosim.files.whole import whole
from scenarios.studies.dataset.order import Item
from scenarios.studies.dataset.reading import SUMS

PARTS: Final = ".parts"
"""Folder for items that are not finished."""
_TIME: Final = 946_684_800
"""Time of the first recording's file: the start of the year 2000, UTC. Each next is a second
later."""


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
    with whole(folder / CONFIG) as part:
        part.write_text(text, encoding="utf-8")
