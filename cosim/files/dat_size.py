"""Size of a `.dat`: from --size, from the config.yaml next to it, or from its length.

The file does not contain its size, and its content, which depends on the light, does not determine
it. Without --size and config.yaml, the length selects one of the sizes that cameras write:

| bytes a frame | frame | assumed if the length is a multiple |
|---|---|---|
| 12 500 | 400 x 250 | of this and not of 13 000 |
| 13 000 | 416 x 250, with head | of this and not of 12 500 |
| 11 250 | 450 x 200, as SpikeOne is printed | of this and of none of the others |
| 125 000 | 1000 x 1000 | never: such a length is also a multiple of 10 frames of 400 x 250 |

A multiple of both 12 500 and 13 000 (26 or 25 frames, and so on) is refused. A multiple of 125 000
or of 11 250 too is read as the other size, with a note on this possibility. If it were refused,
every 400 x 250 recording of 10, 200 or 500 frames would need a flag; without the note, a wrong
image could go unnoticed.
"""

from __future__ import annotations

from pathlib import Path

from cosim.errors import InputError
from cosim.files.config_yaml import CONFIG, Config, adjacent_config
from cosim.files.dat import DAT_SIZE, HEAD_SIZE, DatStream, Size, check_dat_size
from cosim.files.plane_order import DAT_ORDER, PlaneOrder

LARGE_SIZE = (1000, 1000)
PRINTED_SIZE = (450, 200)
_DAT, _HEAD, _LARGE, _PRINTED = (
    check_dat_size(*size) for size in (DAT_SIZE, HEAD_SIZE, LARGE_SIZE, PRINTED_SIZE)
)


def guess_size(path: Path, length: int) -> tuple[Size, tuple[str, ...]]:
    """The stored size of a file of `length` bytes, and notes for the user.

    Raises InputError if both 400 x 250 and 416 x 250 fit.
    """
    n = length // _LARGE
    large = f"1000x1000 ({n} frame{'s' if n > 1 else ''})"
    if length and length % _DAT == length % _HEAD == 0:
        fits = [f"400x250 ({length // _DAT} frames)", f"416x250 with head ({length // _HEAD})"]
        fits += [large] if length % _LARGE == 0 else []
        raise InputError(
            f"{path}",
            "of a size that its length tells",
            f"{length} bytes, which fit {' and '.join(fits)}",
            "give --size 400x250, --size 416x250" + (", --size 1000x1000" if fits[2:] else ""),
        )
    printed = f"450x200 ({length // _PRINTED} frames)"
    if length and length % _HEAD == 0:
        note = f"{path} is read as 400x250 with head, which its length says"
        if length % _PRINTED == 0:
            note += f"; it may be {printed}: --size says which"
        return HEAD_SIZE, (note,)
    if length and length % _DAT and length % _PRINTED == 0:
        return PRINTED_SIZE, (f"{path} is read as {printed}, which its length says",)
    others = [large] if length and length % _LARGE == 0 else []
    others += [printed] if length and length % _PRINTED == 0 else []
    if others:
        return DAT_SIZE, (
            f"{path} is read as 400x250 ({length // _DAT} frames); it may be "
            f"{' or '.join(others)}: --size says which",
        )
    return DAT_SIZE, ()


def open_dat(
    path: Path, size: Size | None = None, config: Config | None = None,
    order: PlaneOrder = DAT_ORDER,
) -> DatStream:  # fmt: skip
    """A `.dat` as a stream. Without `size` and `config`, see the top of this file."""
    if size is not None:
        return DatStream(path, size, order=order)
    known = config or adjacent_config(path)
    if known is None:
        return DatStream(path, *guess_size(path, path.stat().st_size), order=order)
    try:
        return DatStream(path, known.size, order=order)
    except InputError as exc:
        raise InputError(
            exc.what, f"{exc.must}, as its {CONFIG} says", exc.actual, exc.remedy
        ) from exc
