"""A run that is complete, for Python."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cosim import Events, InputError, Intensities
from cosim.files.event_file import ENDING, read_events
from cosim.files.intensities import ENDING as INTENSITIES
from cosim.files.intensities import read_intensities
from scenarios.python.streams import Stream


@dataclass(frozen=True, repr=False)
class Run:
    """The folder of a complete run.

    Attributes:
        folder: folder of the run; a text becomes a path.
        notes: lines that the command line would print.

    Raises:
        InputError: the folder holds no complete run.
    """

    folder: Path
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "folder", Path(self.folder))
        if not (self.folder / "result.json").is_file():
            raise InputError(
                "the run", "a folder with a result.json", f"{self.folder}",
                "check the path, or resume the run",
            )  # fmt: skip

    @cached_property
    def result(self) -> dict[str, Any]:
        """The document `result.json`."""
        document: dict[str, Any] = json.loads((self.folder / "result.json").read_bytes())
        return document

    @property
    def outcome(self) -> str:
        """ok, degraded or failed."""
        return str(self.result["outcome"])

    @property
    def error(self) -> float | None:
        """Measured error of the simulation against full physics; None if it is unknown."""
        value = self.result["error"]["value"]
        return None if value is None else float(value)

    @property
    def metrics(self) -> dict[str, float | None]:
        """Values of the metrics, in the units of `result`."""
        return {name: metric["value"] for name, metric in self.result["metrics"].items()}

    @cached_property
    def streams(self) -> dict[str, Stream]:
        """The recorded streams by the names of their files: stream, camera, ..."""
        names = [name for name in self.result["files"] if name.endswith(".zarr")]
        return {Path(name).stem: Stream(self.folder / name) for name in names}

    @property
    def stream(self) -> Stream:
        """The stream of the run. Raises InputError if it was not kept."""
        if "stream" not in self.streams:
            kept = ", ".join(f"{name}.zarr" for name in self.streams)
            raise InputError(
                "the run", "one with a stream.zarr", f"one with {kept}" if kept else "one without",
                "take it from Run.streams" if kept else "run a scenario of a spike camera",
            )  # fmt: skip
        return self.streams["stream"]

    @property
    def events(self) -> Events | None:
        """The events of asynchronous pixels, in memory; None for other runs."""
        path = self._file(ENDING)
        return None if path is None else read_events(path)

    @property
    def intensities(self) -> Intensities | None:
        """The reports of continuous pixels, in memory; None for other runs."""
        path = self._file(INTENSITIES)
        return None if path is None else read_intensities(path)

    def _file(self, ending: str) -> Path | None:
        """The recording of the camera with this ending."""
        name = f"stream{ending}"
        return self.folder / name if name in self.result["files"] else None

    @cached_property
    def images(self) -> dict[str, npt.NDArray[np.uint8]]:
        """Images of the run by name: (H, W) or (H, W, 3) uint8, red, green, blue."""
        images: dict[str, npt.NDArray[np.uint8]] = {}
        for name in self.result["files"]:
            if name.startswith("images/") and name.endswith(".png"):
                read = cv2.imread(str(self.folder / name), cv2.IMREAD_UNCHANGED)
                if read is not None:
                    image = np.asarray(read, np.uint8)
                    images[Path(name).stem] = image[..., ::-1] if image.ndim == 3 else image
        return images

    @property
    def received(self) -> dict[str, bytes]:
        """Files that a link has received, by name."""
        names = [name for name in self.result["files"] if name.startswith("received/")]
        return {Path(name).name: (self.folder / name).read_bytes() for name in names}

    @property
    def report(self) -> Path | None:
        """The page of the run; None if it was made without."""
        return self.folder / "report.html" if "report.html" in self.result["files"] else None

    def __repr__(self) -> str:
        error = "unknown" if self.error is None else f"{self.error:.2g}"
        return (
            f"Run of {self.result['scenario']}: {self.outcome}, {self.result['simulated_s']:g} s "
            f"of light in {self.result['run_time_s']:.3g} s, error {error}, in {self.folder}"
        )
