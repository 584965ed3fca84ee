"""The order of bits, bytes and rows in the planes of a stream without a header.

Recordings differ in it: the bits of a byte from the least or the most significant one on, the bytes
as they stand or those of larger words turned round, as a board with a wide bus writes them, and the
picture upright or not. The default is that of `.dat`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError

BitOrder = Literal["little", "big"]
ByteOrder = Literal["little", "big-16", "big-32", "big-64"]
Flip = Literal["vertical", "none", "horizontal", "both"]


@dataclass(frozen=True)
class PlaneOrder:
    """How the bits of a plane lie in its bytes.

    Attributes:
        bits: whether the first pixel of a byte is its least ("little") or most significant bit.
        words: "little" for bytes as they stand; "big-N" for words of N bits, pixels from the least
            significant byte on, written with the most significant byte first.
        flip: how the stored picture is turned over to be upright.
    """

    bits: BitOrder = "little"
    words: ByteOrder = "little"
    flip: Flip = "vertical"

    @property
    def word(self) -> int:
        """Bytes of a word that is turned round; 1 for none."""
        return 1 if self.words == "little" else int(self.words.removeprefix("big-")) // 8

    def check(self, frame: int) -> None:
        """Raises InputError if the bytes of a frame are not whole words."""
        if frame % self.word:
            raise InputError(
                "the bytes of a plane", f"a multiple of {self.word}, as its words are {self.words}",
                f"{frame}", "correct its size or its order of bytes",
            )  # fmt: skip

    def planes(
        self, frames: npt.NDArray[np.uint8], stored: tuple[int, int], width: int
    ) -> npt.NDArray[np.uint8]:
        """The upright planes of stored ones.

        Args:
            frames: (T, bytes of a frame).
            stored: (height, width) of a frame.
            width: columns that are pixels, the first ones as they are stored.

        Returns:
            (T, height, width) of 0 and 1.
        """
        if self.word > 1:
            frames = frames.reshape(len(frames), -1, self.word)[..., ::-1].reshape(frames.shape)
        turned = np.unpackbits(frames, axis=1, bitorder=self.bits).reshape(-1, *stored)[..., :width]
        if self.flip in ("vertical", "both"):
            turned = turned[:, ::-1]
        if self.flip in ("horizontal", "both"):
            turned = turned[..., ::-1]
        return turned


DAT_ORDER: Final = PlaneOrder()
"""Order of `.dat`."""
