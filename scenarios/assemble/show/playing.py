"""Plays a stream into the display of a scenario: one chain of stages for every source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosim import Clock, run_blocks
from cosim.compute.opencl import Device
from cosim.files import Recorder, ZarrStream
from cosim.light.source import Source
from cosim.run.chain import STREAM
from cosim.run.folder import how_to_resume, room_for
from cosim.run.progress import Progress
from display.camera.rolling import make_shutter
from display.camera.stage import PanelCamera
from display.chain.display import DisplayChain, make_display_chain
from display.chain.pursuit import Pursuit, pursuit_of
from display.panels.fit import fit_words
from display.section import DisplaySection
from scenarios.assemble.camera.stages import SceneStage
from scenarios.assemble.schema.filming import CameraSection, SpikesSection
from scenarios.assemble.show.feeds import Feed, Planes
from scenarios.assemble.show.filmed import FramesFilmer
from scenarios.assemble.show.filmer import Filmer
from scenarios.assemble.show.spike_camera import make_spikes_filmer

__all__ = ["SHOWN", "Playing", "make_camera", "make_playing"]

SHOWN: Final = "shown.zarr"
"""The planes that the display has shown, in the folder of a run whose recording are no planes."""


@dataclass(frozen=True, eq=False)
class Playing:
    """A display that waits for a stream.

    Attributes:
        chain: the stages of the display.
        source: the scene for the reference displays; None without one.
        camera: the camera that films the display; None without one.
        clock, cycles, shape: of the stream.
        instants: cycles of the images.
    """

    chain: DisplayChain
    source: Source | None
    camera: Filmer | None
    clock: Clock
    cycles: int
    shape: tuple[int, int]
    instants: list[int]

    def play(
        self, planes: Planes, folder: Path, seconds: dict[str, float], progress: Progress
    ) -> ZarrStream:
        """Shows the planes, and records them if they are not in the folder yet. An interrupted run
        plays them from the start again.

        Args:
            planes: the planes.
            folder: folder of the run.
            seconds: wall time of each stage, s; that of the stages of the display is added.
            progress: receives the progress.

        Raises:
            Interrupted, InputError: the user stopped it; the disk is full.
        """
        progress.start("the display", self.cycles)
        place = folder / (STREAM if planes.stored else SHOWN)
        stages: dict[str, Any] = {}
        if self.source is not None:
            stages["scene"] = SceneStage(self.source, (0, 0))
        stages["planes"] = planes.stage
        if not planes.stored:
            stages["planes to disk"] = Recorder(place, self.shape, self.cycles, self.clock)
        stages = self.chain.stages(stages)
        if self.camera is not None:
            stages |= self.camera.stages(folder)
        with room_for("the planes of the display", folder):
            spent = run_blocks(
                stages, self.cycles, progress=progress.advance, remedy=how_to_resume(folder)
            )
        # The scene and the recording of the source have times of their own.
        seconds |= {f"display: {name}" if name in seconds else name: s for name, s in spent.items()}
        return ZarrStream(place)


def make_playing(
    section: DisplaySection,
    camera: CameraSection | None,
    feed: Feed,
    instants: Sequence[int],
    seed: int,
    source: Source | None,
    pursued: Source | None,
    white: float | None,
) -> Playing:
    """The display of a scenario, with every effect.

    Args:
        section: the section [display].
        camera: the section [camera]; None without one.
        feed: what the display shows.
        instants: cycles of the images.
        seed: seed of the camera's noise.
        source: the scene for the reference displays; None without one.
        pursued: the same scene once more, on which the motion of the pursuing eye is measured.
        white: illuminance of the scene's white, lux; None without a scene.

    Raises:
        InputError: the panel cannot show the stream, the display cannot be rendered, or no frame
            of the camera fits.
    """
    panel = section.panel(feed.shape, feed.clock, 0.0, feed.white_rate)
    pursuit = Pursuit(section.pursuit or 0.0, "the pursuing eye does not move: no scene is known")
    if pursued is not None:
        pursuit = pursuit_of(pursued, feed.clock.edge(feed.cycles), section.pursuit)
    elif section.pursuit:
        pursuit = Pursuit(
            section.pursuit, f"the pursuing eye follows {section.pursuit:g} pixels/s"
        )
    setting = section.setting(panel, instants, feed.cycles, pursuit.velocity)
    points = [] if source is None else source.points()
    chain = make_display_chain(
        section, feed.shape, white, feed.cycles, instants, setting, pursuit, points
    )
    try:
        filming = make_camera(camera, chain, feed.shape, feed.cycles, seed)
    except BaseException:
        chain.close()
        raise
    return Playing(
        chain, source, filming, feed.clock, feed.cycles, feed.shape, list(instants)
    )  # fmt: skip


def make_camera(
    section: CameraSection | None,
    display: DisplayChain,
    stream: tuple[int, int],
    cycles: int,
    seed: int,
    device: Device | None = None,
) -> Filmer | None:
    """The camera that films a display; None without a section.

    Args:
        section: the section [camera].
        display: the display.
        stream: (height, width) of the stream.
        cycles: length of the run, cycles.
        seed: seed of the noise.
        device: OpenCL device of a spike camera, None for numba; the bits are the same.

    Raises:
        InputError: the camera does not fit the panel or the run.
    """
    if section is None:
        return None
    panel = display.panel
    mapping = None if panel.shape == stream else fit_words(display.section.fit, stream, panel.shape)
    if isinstance(section, SpikesSection):
        return make_spikes_filmer(section, panel, cycles, seed, device, mapping)
    shutter = make_shutter(section, panel, cycles)
    return FramesFilmer(PanelCamera(section, shutter, seed, mapping))
