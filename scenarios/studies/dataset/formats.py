"""Files of ground truth in the field's formats.

`.flo`, of the Middlebury flow benchmark (S. Baker et al., IJCV 92:1, 2011): the float32
202021.25, which is the text PIEH, width and height as int32, then u and v of each pixel as float32,
row by row; all little-endian.
COCO (T.-Y. Lin et al., ECCV 2014): boxes as [x, y, width, height] from the upper left corner, and
masks as run lengths of a column-major mask, of 0 first.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any, Final
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.format import write_array

MAGIC: Final = np.float32(202021.25)


def write_flo(path: Path, flow: npt.NDArray[np.float32]) -> None:
    """Writes optical flow, (H, W, 2) pixels to the right and down."""
    height, width = flow.shape[:2]
    with path.open("wb") as file:
        file.write(MAGIC.astype("<f4").tobytes())
        file.write(np.array([width, height], "<i4").tobytes())
        file.write(np.ascontiguousarray(flow, "<f4").tobytes())


def write_grey(path: Path, image: npt.NDArray[np.uint8]) -> None:
    """Writes (H, W) uint8 as PNG."""
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def write_arrays(path: Path, arrays: dict[str, npt.NDArray[Any]], stored: str = "") -> None:
    """Writes arrays as a compressed `.npz`, the same bytes for the same arrays. NumPy's own form
    compresses three times as long, for a few per cent of the size. stored: name of the one that is
    not compressed."""
    with ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            file, kind = BytesIO(), ZIP_STORED if name == stored else ZIP_DEFLATED
            write_array(file, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(ZipInfo(f"{name}.npy"), file.getbuffer(), kind, 1)


def run_lengths(mask: npt.NDArray[np.bool_]) -> list[int]:
    """COCO's uncompressed run lengths of a mask (H, W), column by column, zeros first."""
    flat = mask.ravel(order="F")
    ends = np.flatnonzero(np.diff(flat)) + 1
    lengths: list[int] = np.diff([0, *ends, flat.size]).tolist()
    return [0, *lengths] if flat.size and flat[0] else lengths
