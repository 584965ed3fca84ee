"""What is made of all items: COCO annotations, the data card, and the sums of all files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from cosim.files.atomic import atomic_write
from cosim.run.result import dumps, viform_version
from scenarios.scenes.objects.plate import CATEGORIES
from scenarios.studies.batch.jobs import read_document
from scenarios.studies.dataset.order import Item, Order, Places, digest_of
from scenarios.studies.dataset.reading import SPLITS, SUMS

_TRACKS: Final = 100
"""Numbers of tracks of a view; a scene has at most 64 objects."""
_FILES: Final = (
    ("`SPLIT/spike/NAME.dat`", "spikes, a bit a pixel and cycle, rows from the bottom up"),
    ("`SPLIT/gt/NAME.png`", "true light in the middle of the recording, linear, white = 255"),
    ("`SPLIT/truth/NAME/light-CYCLE.png`", "the same at the instants"),
    ("`SPLIT/truth/NAME/flow-A-B.flo`", "optical flow from cycle A to B (Middlebury)"),
    ("`SPLIT/truth/NAME/occlusion-A-B.png`", "0 seen at B, 128 at an edge, 255 covered or outside"),
    ("`SPLIT/truth/NAME/mask-CYCLE.png`", "number of the object, 0 for the background"),
    ("`SPLIT/truth/NAME/truth.npz`", "`light`, `cycle`, `time_ps`; `flow`, `occlusion`, `depth_m`, "
     "`mask`, `boxes` (x, y, width, height)"),
    ("`SPLIT/coco.json`", "boxes, masks, categories and tracks of the objects (COCO)"),
    ("`items/NAME.json`", "settings, what was drawn, metrics, sums"),
    ("`config.yaml`", "description for SpikeCV"),
)  # fmt: skip
_HOW: Final = """\
Flow, occlusion, depth, masks and boxes
exist for drawn objects; an item says `"truth": "dense"`. Instants are the middles of cycles.

## Loading

    import viform
    items = viform.SpikeDataset(".", "{split}")          # numpy arrays
    items = viform.torch_dataset(".", "{split}", cycles=64)  # tensors, for a DataLoader

SpikeCV, with the absolute path of this folder:

    parameters = data_parameter_dict("/PATH/{where}{split}/spike", "reconstruction")
    spikes = SpikeStream(**parameters).get_spike_matrix()

Spike-Zoo:

    config = BaseDatasetConfig(
        root_dir="/PATH/{where}", width={width}, height={height}, rate={rate:g}
    )
    data = BaseDataset(config)
    data.build_source("{split}")
"""


def write_annotations(
    places: Places, items: Sequence[Item], documents: Sequence[dict[str, Any]]
) -> None:
    """Writes a `coco.json` for each split that has scenes with dense truth. An image is the light
    of an item at an instant; a track is an object of a view, the same for all cameras. Masks are
    read item by item: those of a large data set would not fit into memory."""
    files: dict[str, list[Item]] = {}
    for item, document in zip(items, documents, strict=True):
        if document["truth"] == "dense":
            files.setdefault(places.coco(item), []).append(item)
    stated = {item.name: document for item, document in zip(items, documents, strict=True)}
    for name, chosen in files.items():
        images = [
            {
                "file_name": f"truth/{item.name}/light-{cycle:06}.png", "item": item.name,
                "cycle": cycle, **{side: stated[item.name][side] for side in ("width", "height")},
            }
            for item in chosen for cycle in stated[item.name]["instants"]
        ]  # fmt: skip
        head = dumps({
            "info": {"description": f"{chosen[0].split}, drawn objects"},
            "categories": [{"id": n + 1, "name": name} for n, name in enumerate(CATEGORIES)],
            "images": [{"id": n + 1, **image} for n, image in enumerate(images)],
            "annotations": [],
        })  # fmt: skip
        before, after = head.rsplit("[]", 1)
        with atomic_write(places.folder / name) as part, part.open("w", encoding="utf-8") as file:
            file.write(f"{before}[")
            count = 0
            for count, (row, lengths) in enumerate(_annotations(places, chosen), 1):
                text = dumps({"id": count, **row}).replace("\n", "\n    ")
                # Most of the text, in a tenth of the time of `dumps`.
                counts = ",".join(f"\n          {length}" for length in lengths)
                text = text.replace('"counts": []', f'"counts": [{counts}\n        ]')
                file.write(f"{',' if count > 1 else ''}\n    {text}")
            file.write(("\n  ]" if count else "]") + after)


def _annotations(
    places: Places, items: Sequence[Item]
) -> Iterator[tuple[dict[str, Any], list[int]]]:
    """The annotations of items, whose images are numbered from 1 on, and the run lengths of each,
    which the annotation lacks."""
    first = 1
    for item in items:
        document = read_document(places.document(item), "dataset")
        numbers = {cycle: first + n for n, cycle in enumerate(document["instants"])}
        first += len(numbers)
        for row in document["objects"]:
            annotation = {
                "image_id": numbers[row["cycle"]],
                "category_id": CATEGORIES.index(row["category"]) + 1, "bbox": row["bbox"],
                "area": row["area"], "iscrowd": 0,
                "track_id": _TRACKS * item.view + row["object"],
                "segmentation": {"counts": [], "size": [document["height"], document["width"]]},
            }  # fmt: skip
            yield annotation, row["counts"]


def write_sums(places: Places, known: Mapping[str, str]) -> str:
    """Writes SHA256SUMS, which `sha256sum -c` reads; returns the SHA-256 of it. known: sums of
    files that the documents of their items state; the other files are read."""
    lines = [
        f"{known.get(name) or digest_of(places.folder / name)}  {name}\n" for name in places.files()
    ]
    text = "".join(lines)
    with atomic_write(places.folder / SUMS) as part:
        part.write_text(text, encoding="utf-8")
    return hashlib.sha256(text.encode()).hexdigest()


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(str(cell) for cell in line)} |\n" for line in lines)


def write_card(
    order: Order, folder: Path, items: Sequence[Item], documents: Sequence[dict[str, Any]],
    failed: dict[str, Any],
) -> None:  # fmt: skip
    """Writes README.md, the data card."""
    counts = [
        (split, sum(each["split"] == split for each in documents),
         len({each["view"] for each in documents if each["split"] == split}))
        for split in SPLITS
    ]  # fmt: skip
    drawn = [(axis.key, axis.given.partition("=")[2]) for axis in order.axes]
    if any("scene.layout" in item.values for item in items) and "scene.layout" not in dict(drawn):
        drawn.append(("scene.layout", "a seed for each view"))
    drawn.append(("seed", "a seed of the noise for each item"))
    sizes = sorted({(each["width"], each["height"]) for each in documents})
    several = len(sizes) > 1
    where = f"{sizes[0][0]}x{sizes[0][1]}/" if several else ""
    split = documents[0]["split"]
    rates = sorted({round(each["metrics"]["white_rate"]["value"], 4) for each in documents})
    rate = f"{rates[0]:g}" if len(rates) == 1 else f"{rates[0]:g} to {rates[-1]:g}"
    usual = rates[0] if len(rates) == 1 else -1  # Spike-Zoo: it varies
    left = "".join(f"- {name}: {exc}\n" for name, exc in failed.items())
    text = f"""# Recordings of spike cameras

Simulated recordings of spike cameras with the true light, made by Viform {viform_version()}.

License: (state yours here, and that of the clips)

{_table(["split", "items", "scenes"], counts)}
- Sources: {", ".join(source.given for source in order.sources)}
- Cameras: {", ".join(dict.fromkeys(item.camera for item in items))}
- Pixels: {", ".join(f"{w} x {h}" for w, h in sizes)}
- Seed of everything drawn: {order.seed}
- Set: {", ".join(f"`{text}`" for text in order.assignments) or "nothing"}
- White fires at {rate} spikes a cycle (`white_rate` of an item; Spike-Zoo's `rate`).

Drawn, by a Latin hypercube (keys of `scene` for each scene, others for each item):

{_table(["key", "range"], drawn)}
## Files

{_table(["file", "content"], _FILES)}
`{SUMS}` holds the SHA-256 of every file: `sha256sum -c {SUMS}`. {_HOW.format(
    where=where, split=split, width=sizes[0][0], height=sizes[0][1], rate=usual
)}"""  # fmt: skip
    if left:
        text += f"\n## Left out\n\n{left}"
    with atomic_write(folder / "README.md") as part:
        part.write_text(text, encoding="utf-8")
