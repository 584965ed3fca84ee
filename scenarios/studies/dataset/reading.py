"""The items of a data set as numpy arrays."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import InputError
from cosim.archive import load_arrays
from cosim.files.dat import DatStream
from cosim.spikes.viform import part_of

SPLITS: Final = ("train", "val", "test")
SUMS: Final = "SHA256SUMS"
"""The file that is written last: a data set without it is not finished."""


class SpikeDataset:
    """The items of one split, in the order of their names: a map-style data set of PyTorch, without
    PyTorch.

    Args:
        folder: folder of the data set.
        split: train, val or test.
        camera: label of the only camera to take; all if None. Cameras of several sizes do not fit
            into one batch.
        cycles: cycles from the middle of each recording; all if None.
        unfinished: whether a data set that was interrupted is opened, with the items that it has.

    An item is a dictionary of

    - `name`: of the item;
    - `spikes`: (cycles, H, W) uint8 of 0 and 1;
    - `light`: (n, H, W) float32, true light at n instants, white = 1;
    - `instants`: (n,) int64, their cycles, counted from the first of `spikes`;

    and for a scene with dense truth

    - `flow`: (n - 1, 2, H, W) float32, pixels right and down, from each instant to the next;
    - `occlusion`: (n - 1, H, W) uint8: 0 seen there, 128 at an edge, 255 covered or outside;
    - `depth`: (n, H, W) float32, m;
    - `mask`: (n, H, W) uint8, number of the object, 0 for the background;
    - `boxes`: (n, objects, 4) float32: x, y, width, height, zeros for an object that is not seen.

    Raises:
        InputError: the folder holds no data set or an unfinished one, the split no items, or an
            item is too short.
    """

    def __init__(
        self, folder: str | os.PathLike[str], split: str = "train", *, camera: str | None = None,
        cycles: int | None = None, unfinished: bool = False,
    ) -> None:  # fmt: skip
        self.folder = Path(folder)
        if split not in SPLITS:
            raise InputError("split", f"one of {', '.join(SPLITS)}", repr(split), "choose one")
        if not (self.folder / "dataset.json").is_file():
            raise InputError(
                "the data set", "a folder of `viform dataset`", f"{self.folder}", "check the path"
            )
        paths = sorted((self.folder / "items").glob("*.json"))
        if not (self.folder / SUMS).is_file() and not unfinished:
            stated = json.loads((self.folder / "dataset.json").read_bytes())["items"]
            raise InputError(
                "the data set", "finished",
                f"{self.folder} with {len(paths)} of {len(stated)} items",
                "go on with its command and --resume, or give unfinished=True",
            )  # fmt: skip
        every = [json.loads(path.read_bytes()) for path in paths]
        self.items: list[dict[str, Any]] = [
            item for item in every
            if item["split"] == split and camera in (None, item["camera"])
        ]  # fmt: skip
        if not self.items:
            known = sorted({f"{item['split']} of {item['camera']}" for item in every})
            raise InputError(
                "the data set", "one with items in this split of this camera",
                f"one with {', '.join(known) or 'none'}", "choose another split or camera",
            )  # fmt: skip
        shortest = min(item["cycles"] for item in self.items)
        if cycles is not None and not 1 <= cycles <= shortest:
            raise InputError(
                "cycles", f"1 to {shortest}", f"{cycles}", f"give {1 if cycles < 1 else shortest}"
            )
        self._cycles = cycles

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> dict[str, Any]:
        item = self.items[index]
        size = (item["width"], item["height"])
        length = self._cycles or item["cycles"]
        first = (item["cycles"] - length) // 2
        stream = part_of(
            DatStream(self.folder / item["recording"], size), slice(first, first + length)
        )
        arrays = load_arrays(self.folder / item["truth_folder"] / "truth.npz")
        found = {
            "name": item["name"],
            "spikes": stream.planes(),
            "light": arrays["light"],
            "instants": arrays["cycle"] - first,
        }
        if item["truth"] == "dense":
            found["flow"] = np.ascontiguousarray(np.moveaxis(arrays["flow"], -1, 1))
            found["depth"] = arrays["depth_m"]
            found |= {name: arrays[name] for name in ("occlusion", "mask", "boxes")}
        return found


def torch_dataset(*arguments: Any, **options: Any) -> Any:
    """A `torch.utils.data.Dataset` with the items of `SpikeDataset`, whose arguments it takes, as
    tensors.

    Raises:
        InputError: as `SpikeDataset`, or PyTorch is not installed.
    """
    from scenarios.studies.dataset.tensors import TorchSpikeDataset

    return TorchSpikeDataset(SpikeDataset(*arguments, **options))
