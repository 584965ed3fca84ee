"""Builds a data set, for the command line and for Python (`viform.dataset`): what is left to do,
the items, then what is made of all of them.

`dataset.json` states the data set and is written first. An item is done when its document is there
and its files have the sums that it states.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim import InputError, Interrupted
from cosim.files.atomic import sync_tree
from cosim.run.folder import claim_folder, how_to_resume, output_folder
from cosim.run.inputs import digest
from cosim.run.progress import Pace, Progress
from cosim.run.shown import progress_in_python
from cosim.run.workers import check_workers
from scenarios.assemble.schema.loading import assignments_of
from scenarios.studies.batch.axes import read_axis
from scenarios.studies.batch.jobs import begin_batch, read_document, run_jobs
from scenarios.studies.dataset.card import write_annotations, write_card, write_sums
from scenarios.studies.dataset.inputs import read_cameras, read_sources
from scenarios.studies.dataset.item import make_item
from scenarios.studies.dataset.order import (
    CHECK,
    PARTS,
    Item,
    Order,
    Places,
    digest_of,
    read_split,
    write_config,
)


def build_dataset(
    order: Order, folder: Path, *, device: str | None, workers: int, scheduler: str | None,
    resume: bool, progress: Progress,
) -> dict[str, Any]:  # fmt: skip
    """Makes the items that are not there yet.

    Args:
        order: the data set.
        folder: folder to create, or with `resume` that of an interrupted data set.
        device: device of the runs.
        workers, scheduler: see `run_jobs`.
        resume: whether an interrupted data set goes on.
        progress: progress of the items.

    Returns:
        The document of the data set: its folder, counts, and the items by split.

    Raises:
        InputError: a key cannot be used, before anything is written; the folder is in use; or the
            disk is full.
        Interrupted: by the user; `--resume` goes on.
    """
    items = order.items()
    places = Places(folder, items)
    with claim_folder("dataset", folder, resume):
        begin_batch("dataset", folder, _stated(order, items), "items", resume)
        shutil.rmtree(folder / PARTS, ignore_errors=True)  # of a process that was killed
        try:
            failed = _make(items, order.check, places, device, workers, scheduler, progress)
        except InputError:
            _remove_empty(folder)
            raise
        made = [item for item in items if item.name not in failed]
        documents = [_slim(places, item) for item in made]
        for item in {places.root(item): item for item in items}.values():
            (folder / places.root(item)).mkdir(exist_ok=True)
            write_config(folder / places.root(item), places.size(item))
        shutil.rmtree(folder / PARTS, ignore_errors=True)
        write_annotations(places, made, documents)
        write_card(order, folder, items, documents, failed)
        places.set_times(made)
        sync_tree(folder)  # what the sums state outlasts a loss of power
        known = {name: digest for each in documents for name, digest in each["files"].items()}
        sums = write_sums(places, known)
    return {
        "folder": str(folder), "items": len(items), "failed": len(failed),
        "sha256": sums,
        "splits": {
            split: [item.name for item in made if item.split == split]
            for split in dict.fromkeys(item.split for item in items)
        },
        "errors": [{"item": name, "error": str(exc)} for name, exc in failed.items()],
    }  # fmt: skip


def _slim(places: Places, item: Item) -> dict[str, Any]:
    """The document of an item without its masks and its scenario, which take most of its space."""
    document = read_document(places.document(item), "dataset")
    return {key: value for key, value in document.items() if key not in ("objects", "scenario")}


def _remove_empty(folder: Path) -> None:
    """Removes what a data set without an item has in its folder."""
    if not any((folder / "items").iterdir()):
        for place in (folder / "items", folder / PARTS):
            shutil.rmtree(place, ignore_errors=True)
        (folder / "dataset.json").unlink()


def _stated(order: Order, items: list[Item]) -> dict[str, Any]:
    """The data set as it was asked for."""
    return {
        "seed": order.seed,
        "sources": [source.given for source in order.sources],
        "cameras": [camera.label for camera in order.cameras],
        "drawn": [axis.given for axis in order.axes],
        "set": list(order.assignments),
        "samples": order.samples,
        "check": order.check,
        "split": list(order.split),
        "items": [
            {
                "name": item.name, "split": item.split, "drawn": item.values,
                "digest": hashlib.sha256(item.scenario.model_dump_json().encode()).hexdigest(),
            }
            for item in items
        ],
    }  # fmt: skip


def _make(
    items: list[Item], check: int, places: Places, device: str | None, workers: int,
    scheduler: str | None, progress: Progress,
) -> dict[str, InputError]:  # fmt: skip
    """Makes what is not there; returns the errors of items that cannot be made. What cannot be
    filmed by one camera is mentioned once."""
    jobs = [
        (n, (item, places, device, check > 0 and n % check == 0))
        for n, item in enumerate(items)
        if not _is_there(item, places)
    ]
    title = f"{places.folder.name}: {len(items)} items"
    progress.start(title, len(items))
    pace, done = Pace(len(items)), len(items) - len(jobs)
    progress.advance(done)
    failed: dict[str, InputError] = {}
    said: set[tuple[str, str]] = set()
    held: list[str] = []  # until an item is there: an error of all is raised, not noted
    try:
        for number, result in run_jobs(make_item, jobs, workers, scheduler):
            done += 1
            item = items[number]
            if isinstance(result, InputError):
                failed[item.name] = result
                if (item.source, str(result)) not in said:
                    said.add((item.source, str(result)))
                    held.append(f"left out {item.name}: {result}")
            if len(failed) < done:
                for note in held:
                    progress.note(note)
                held.clear()
            left = pace.step(done, time.monotonic())
            if left:
                progress.tell(f"{title}, {(len(items) - done) / left:.2g} a second")
            progress.advance(done)
    except (KeyboardInterrupt, Interrupted):  # between items, or within one
        raise Interrupted(done, len(items), how_to_resume(places.folder), "items") from None
    if len(failed) == len(items):
        raise next(iter(failed.values()))
    return failed


def _is_there(item: Item, places: Places) -> bool:
    """Whether an item is complete: its document states the sums of its files, and that of its clip
    if that is still there."""
    path = places.document(item)
    if not path.is_file():
        return False
    document = read_document(path, "dataset")
    clip = getattr(item.scenario.scene, "path", None)
    if clip is not None and digest(clip) not in (None, document["source_sha256"]):
        return False
    return all(
        (places.folder / name).is_file() and digest_of(places.folder / name) == digest
        for name, digest in document["files"].items()
    )


def order_of(
    sources: Sequence[str], cameras: Sequence[str], vary: Sequence[str],
    assignments: Sequence[str], samples: int, split: str, seed: int | None,
    tolerance: float | None, check: int = CHECK,
) -> Order:  # fmt: skip
    """An order by the texts of the command line. Raises InputError."""
    return Order(
        tuple(read_sources(sources)), tuple(read_cameras(cameras)), tuple(map(read_axis, vary)),
        tuple(assignments), samples, read_split(split), 1 if seed is None else seed, tolerance,
        check,
    )  # fmt: skip


def dataset(
    *sources: str | os.PathLike[str], out: str | os.PathLike[str],
    cameras: Sequence[str | os.PathLike[str]] = (), vary: Mapping[str, str] | None = None,
    samples: int = 1, split: str = ".8,.1,.1", seed: int = 1, tolerance: float | None = None,
    check: int = CHECK,
    device: str | None = None, workers: int = 1, scheduler: str | None = None,
    resume: bool = False, progress: bool | None = None, **settings: Any,
) -> dict[str, Any]:  # fmt: skip
    """Films sources with cameras as `viform dataset` does: the same files.

    Args:
        sources: scenarios, TOML files, clips, or folders of clips.
        out: folder to create.
        cameras: chip presets, or TOML files with a [sensor]; that of each scenario if empty.
        vary: ranges by key, such as {"scene.illuminance": "200:2000 lux:log"}.
        samples: scenes of each source.
        split: shares of train, val and test.
        seed: seed of all that is drawn.
        tolerance: allowed relative error of each item.
        check: an item of so many is measured against full physics; 0 for none.
        device: number or part of the name of an OpenCL device, or "numba".
        workers: processes on this machine; a script needs no main guard for them.
        scheduler: address of a Dask scheduler, whose workers film instead; they must see `out`.
        resume: whether the interrupted data set in `out` goes on.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenarios.

    Returns:
        The document of `viform dataset --json`.

    Raises:
        InputError: the input cannot be used.
    """
    check_workers(workers)
    asked = order_of(
        [os.fspath(each) for each in sources], [os.fspath(each) for each in cameras],
        [f"{key}={values}" for key, values in (vary or {}).items()], assignments_of(settings),
        samples, split, seed, tolerance, check,
    )  # fmt: skip
    folder = output_folder("dataset", Path(out), resume)
    with progress_in_python(progress) as shown:
        return build_dataset(
            asked, folder, device=device, workers=workers, scheduler=scheduler, resume=resume,
            progress=shown,
        )  # fmt: skip
