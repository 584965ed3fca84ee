"""Every reader of a file and every wire, as targets of the fuzzer."""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from pathlib import Path
from shutil import rmtree
from typing import Any

import fastcrc
import numpy as np
import typer

from cosim import Clock, Viform
from cosim.files import open_stream, write_stream
from cosim.files.event_file import read_events
from cosim.files.intensities import read_intensities, write_intensities
from cosim.run.folder import REINSTATED
from cosim.run.loop import Checkpoint
from cosim.run.result import read_result
from cosim.spikes.intensities import Intensities
from cosim.spikes.viform import words_for
from imagers.run.tape import Tape
from rtl_model.cycle import Bridge, System
from rtl_model.geometry import Geometry
from rtl_model.host import read_csr
from rtl_model.host.ether.packet import answer_packet, answered, probe, record_packet
from rtl_model.virtual.ethernet import answer, make_bus
from rtl_model.virtual.faults import Faults
from scenarios.assemble.schema.loading import load
from scenarios.run import _reinstated_before
from scenarios.scenes.clips.film import FilmSource
from sensor.codec.coding import Code
from sensor.codec.files import open_any, write_fsc
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.packet import HEADER
from sensor.codec.vfl import write_vfl
from tests.fuzz.engine import LONGEST, Target
from tests.link.receiving.toy import small

CLOCK = Clock(40_000)
SEEDS = Path(__file__).with_name("seeds")


def _stream(cycles: int = 70, shape: tuple[int, int] = (20, 24)) -> Viform:
    rng = np.random.default_rng(1)
    planes = rng.random((cycles, *shape)) < 0.2
    return Viform.from_planes(planes, CLOCK)


def _read(path: Path, size: tuple[int, int] | None = None) -> None:
    stream, _ = open_any(path, size)
    stream.read_words(0, min(words_for(stream.cycles), 100))


def _file(name: str, read: Callable[[Path], object]) -> Callable[[bytes, Path], object]:
    """The reader of a file of this name."""

    def reads(data: bytes, folder: Path) -> object:
        path = folder / name
        path.write_bytes(data)
        return read(path)

    return reads


def _written(ending: str, *more: Any) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        path = folder / f"seed{ending}"
        write_stream(_stream(*more), path)
        return [path.read_bytes()]

    return seeds


def _raw(folder: Path) -> list[bytes]:
    path = folder / "seed.raw"
    write_stream(_stream(1, (1000, 1000)), path)
    return [path.read_bytes()]


def _coded(folder: Path) -> list[bytes]:
    out = []
    for code in (Code("line"), Code("repeat"), Code("statistical", 3.0, 1000.0)):
        path = folder / "seed.fsc"
        write_fsc(_stream(), path, code)
        out.append(path.read_bytes())
    return out


_CODES = (
    StreamCode(tile=16), StreamCode("raw"), StreamCode("first-spike", cycles=32),
    StreamCode("statistical", k=3.0, refine=4, threshold=1000.0), StreamCode(layers=4),
)  # fmt: skip


def _packet_files(folder: Path) -> list[bytes]:
    out = []
    for code in _CODES:
        path = folder / "seed.vfl"
        write_vfl(_stream(), path, code)
        out.append(path.read_bytes())
    return out


def _packets(folder: Path) -> list[bytes]:
    stream = _stream(128)
    packets = StreamEncoder(_CODES[0], stream.shape).encode(stream.words, 0)
    return [packet.to_bytes() for packet in packets]


def _take(data: bytes, folder: Path) -> None:
    """What was damaged, and the same with a checksum that holds."""
    stream = _stream(128)
    decoder = StreamDecoder(_CODES[0], stream.shape)
    decoder.take(data)
    if len(data) >= HEADER:
        crc = fastcrc.crc32.iscsi(data[:12] + data[HEADER:])
        decoder.take(data[:12] + crc.to_bytes(4, "little") + data[HEADER:])
    decoder.read(stream.cycles)


def _intensities(folder: Path) -> list[bytes]:
    path = folder / "seed.npz"
    write_intensities(_reports(), path)
    return [path.read_bytes()]


def _reports() -> Intensities:
    rng = np.random.default_rng(2)
    times = np.unique(rng.integers(0, 10**6, 50))
    n = len(times)
    return Intensities(
        rng.integers(0, 4, n).astype(np.uint16), rng.integers(0, 5, n).astype(np.uint16), times,
        rng.random(n), (4, 5), 10**6, CLOCK,
    )  # fmt: skip


def _members(make: Callable[[Path], list[bytes]]) -> Callable[[Path], list[bytes]]:
    """The arrays of an archive, one after another behind a byte that says which."""

    def seeds(folder: Path) -> list[bytes]:
        (whole,) = make(folder)
        (folder / "whole.npz").write_bytes(whole)
        with zipfile.ZipFile(io.BytesIO(whole)) as archive:
            return [bytes([n]) + archive.read(info) for n, info in enumerate(archive.infolist())]

    return seeds


def _packed(
    make: Callable[[Path], list[bytes]], name: str, read: Callable[[Path], object]
) -> Callable[[bytes, Path], object]:
    """The reader of a sound archive in which one array is damaged."""
    sound: list[bytes] = []

    def reads(data: bytes, folder: Path) -> object:
        if not sound:
            sound.extend(make(folder))
        path = folder / name
        with zipfile.ZipFile(io.BytesIO(sound[0])) as source, zipfile.ZipFile(path, "w") as out:
            chosen = (data[0] if data else 0) % len(source.infolist())
            for n, info in enumerate(source.infolist()):
                out.writestr(info.filename, data[1:] if n == chosen else source.read(info))
        return read(path)

    return reads


def _store(part: str) -> tuple[Callable[[Path], list[bytes]], Callable[[bytes, Path], object]]:
    """A Zarr store in which one file is damaged: `zarr.json` of the array, or a chunk."""

    def write(folder: Path) -> Path:
        path = folder / "seed.zarr"
        if not path.exists():
            write_stream(_stream(), path)
        files = sorted(p for p in path.rglob("*") if p.is_file())
        chosen = [p for p in files if (p.name == "zarr.json") == (part == "json")]
        return chosen[-1]

    def seeds(folder: Path) -> list[bytes]:
        return [write(folder).read_bytes()]

    def read(data: bytes, folder: Path) -> None:
        file = write(folder)
        sound = file.read_bytes()
        try:
            file.write_bytes(data)
            _read(folder / "seed.zarr")
        finally:
            file.write_bytes(sound)

    return seeds, read


def _scenarios(folder: Path) -> list[bytes]:
    files = sorted(Path("scenarios/files").glob("*.toml"))
    assert files
    return [path.read_bytes() for path in files]


def _settings(data: bytes, folder: Path) -> object:
    """Lines of --set."""
    lines = data.decode("utf-8", "surrogateescape").replace("\0", "").splitlines()
    return load("film", lines[:20])


def _checkpoint(folder: Path) -> list[bytes]:
    path = folder / "seed.npz"
    Checkpoint(path, "this run").save(64, {"counter": _Counter()})
    return [path.read_bytes()]


class _Counter:
    """A stage with a state that accepts any arrays."""

    def step(self, given: Any, block: Any) -> Any:
        return given

    def state(self) -> dict[str, Any]:
        return {"sum": np.arange(5)}

    def restore(self, state: dict[str, Any]) -> None:
        self.held = state


def _result(data: bytes, folder: Path) -> object:
    (folder / "result.json").write_bytes(data)
    return read_result(folder)


RESULT = json.dumps({
    "scenario": "film", "outcome": "ok", "seed": 1, "version": "0", "device": "a", "renderer": None,
    "simulated_s": 0.1, "run_time_s": 1.0,
    "error": {"value": 1e-3, "kind": "measured", "ci": [0, 1], "tolerance": 1e-3},
    "plan": {"kept": ["a"], "left_out": [{"effect": "b", "bound": 1.0, "kind": "proof",
                                          "measured": None}]},
    "metrics": {"psnr": {"value": 1.0, "unit": "dB"}},
    "latency": [{"stage": "a", "min_us": 1, "median_us": 2, "max_us": 3}],
    "throughput": [{"stage": "a", "value": 1, "unit": "b"}], "files": ["stream.zarr"],
}).encode()  # fmt: skip

CONFIG = b"""filename: rec.dat
spike_w: 24
spike_h: 20
is_labeled: false
labeled_data_type: [0]
labeled_data_suffix: ""
"""


def _config(data: bytes, folder: Path) -> None:
    write_stream(_stream(), folder / "rec.dat")
    (folder / "config.yaml").write_bytes(data)
    stream = open_stream(folder / "config.yaml")
    stream.read_words(0, 1)


LOG = [
    {"monotonic": 0.0, "wall": "2024-01-01T00:00:00Z", "event": "open", "format": "viform-line-1",
     "port": "/dev/pts/1", "baud": 115200, "simulated": True, "time_scale": 1.0, "frames": 8},
    {"monotonic": 0.1, "wall": "2024-01-01T00:00:01Z", "event": "silence", "value": 0},
    {"monotonic": 0.2, "wall": "2024-01-01T00:00:01Z", "event": "write", "command": "read",
     "address": "0x0", "words": 2, "hex": "020200000000"},
    {"monotonic": 0.3, "wall": "2024-01-01T00:00:01Z", "event": "read", "wanted": 8,
     "hex": "5649464f00000001", "more": "", "fault": None},
    {"monotonic": 0.4, "wall": "2024-01-01T00:00:01Z", "event": "stray", "hex": "00"},
    {"monotonic": 0.5, "wall": "2024-01-01T00:00:01Z", "event": "baud", "value": 9600},
]  # fmt: skip


def _logs(folder: Path) -> list[bytes]:
    """A log with every kind of event, and the begin of a bring-up's."""
    real = gzip.decompress((SEEDS / "bringup.log.gz").read_bytes())
    return ["\n".join(map(json.dumps, LOG)).encode() + b"\n", real]


def _replay(judge: bool) -> Callable[[Path], None]:
    """`viform board replay`, which prints the log or judges it as a bring-up."""

    def read(path: Path) -> None:
        from scenarios.cli.board.bringup import board_replay

        with redirect_stdout(io.StringIO()), suppress(typer.Exit):
            board_replay(path, judge=judge)

    return read


CSR = b"""#--------------------------------------------------------------------------------
csr_base,sensor,0x00000800,,
csr_register,sensor_threshold,0x00000800,1,rw
csr_register,sensor_control,0x00000804,1,rw
constant,config_clock_frequency,48000000,,
memory_region,capture,0x00010000,32768,io
"""


def _tape(folder: Path) -> list[bytes]:
    from types import SimpleNamespace

    path = folder / "seed.tape"
    tape = Tape(path, "this run", False)
    for frame in range(3):
        tape.record(SimpleNamespace(frame=frame, first=0), np.ones((4, 6), np.uint16))  # type: ignore[arg-type]
    tape.close()
    return [path.read_bytes()]


def _play(path: Path) -> None:
    tape = Tape(path, "this run", True)
    try:
        from types import SimpleNamespace

        for frame in range(5):
            tape.play(SimpleNamespace(frame=frame, first=0))  # type: ignore[arg-type]
    finally:
        tape.close()


def _pictures(folder: Path) -> list[bytes]:
    import av

    out = []
    frames = np.random.default_rng(3).integers(0, 256, (3, 32, 48, 3), np.uint8)
    for name, codec, pixels in (("a.png", "png", "rgb24"), ("a.mp4", "mpeg4", "yuv420p"),
                                ("a.gif", "gif", "rgb8")):  # fmt: skip
        with av.open(folder / name, "w") as container:
            stream = container.add_stream(codec, rate=25)
            stream.width, stream.height, stream.pix_fmt = 48, 32, pixels
            for frame in frames[: 1 if name == "a.png" else 3]:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, "rgb24")))
            container.mux(stream.encode())
        out.append((folder / name).read_bytes())
    return out


def _film(path: Path) -> None:
    from cosim import Block

    source = FilmSource(path, (16, 24), 500.0, CLOCK, 64, 0.0, None)
    source.step(None, Block(0, 64))


FINDINGS = json.dumps([
    {"effect": "shot noise", "message": "a bound was exceeded", "promised": 1e-3,
     "measured": 2e-3, "tile": 7},
    {"effect": "dead time", "message": "a bound was exceeded", "promised": None,
     "measured": None, "tile": None},
]).encode()  # fmt: skip


def _sent(folder: Path) -> list[bytes]:
    """A camera's recording of a transmission, without a header."""
    toy = small(bytes(3000), scale=1.03125)
    write_stream(toy.stream(), folder / "seed.dat")
    return [(folder / "seed.dat").read_bytes()]


def _receive(path: Path) -> None:
    """`viform link receive`, which ends with the file or with a verdict."""
    from scenarios.cli.link.files import link_receive

    out = path.with_name("out")
    rmtree(out, ignore_errors=True)
    with redirect_stdout(io.StringIO()) as text, suppress(typer.Exit):
        link_receive(path, out, "joint", True, "308x308", False)
    verdict = text.getvalue().splitlines()[0]
    assert len(verdict) < 2 * LONGEST, verdict


def _requests(folder: Path) -> list[bytes]:
    words = np.random.default_rng(4).integers(0, 256, 40, np.uint8).tobytes()
    return [
        bytes([2, 3, 0, 0, 0, 0]), bytes([1, 2, 0, 0, 0, 1]) + words[:8],
        bytes([4, 9, 0, 0, 0, 9]), bytes([3, 1, 0, 0, 0, 2]) + words[:4], words,
    ]  # fmt: skip


def _to_board(data: bytes, folder: Path) -> None:
    """Bytes to a board: whatever they are, it takes a command after its watchdog's time."""
    size = Geometry(4, 32, 32, clock_hz=8000, baud=1000, capture_words=64, sink_words=16)
    bridge = Bridge(system=System(size, build=0, keep=False), byte_clocks=1)
    bridge.feed(data[:2000], 0)
    bridge.wait(10**6)
    assert bridge.idle


def _etherbone_packets(folder: Path) -> list[bytes]:
    read, write = b"".join(n.to_bytes(4, "big") for n in (0, 4, 0x100000)), bytes(8)
    numbered = b"".join(n.to_bytes(4, "big") for n in (0, 0x100000, 1, 7))
    return [
        record_packet(1, read), record_packet(2, read, 0x304, write),
        record_packet(3, read, 0x50000000, numbered), probe(4), answer_packet([(1, write)]),
    ]  # fmt: skip


def _etherbone_board(data: bytes, folder: Path) -> None:
    """The board answers or drops a packet, and then still answers; the host takes no notice."""
    answered(data)
    bus = make_bus("model", Geometry(rows=2, columns=32, clock_hz=4_000_000), Faults())
    answer(data, bus)
    reply = answered(answer(record_packet(9, bytes(4)), bus) or b"")
    assert reply is not None and reply[0] == 9


TARGETS: tuple[Target, ...] = (
    Target("dat", _written(".dat"), _file("a.dat", lambda p: _read(p, (24, 20)))),
    Target("dat without a size", _written(".dat", 3, (250, 400)), _file("a.dat", _read)),
    Target("npz", _written(".npz"), _file("a.npz", _read)),
    Target("npz arrays", _members(_written(".npz")), _packed(_written(".npz"), "a.npz", _read)),
    Target("raw", _raw, _file("a.raw", _read)),
    Target("events", _written(".events.npz"), _file("a.events.npz", read_events)),
    Target("event arrays", _members(_written(".events.npz")),
           _packed(_written(".events.npz"), "a.events.npz", _read)),
    Target("intensities", _intensities, _file("a.npz", read_intensities)),
    Target("intensity arrays", _members(_intensities),
           _packed(_intensities, "a.npz", read_intensities)),
    Target("first spikes", _coded, _file("a.fsc", _read)),
    Target("packet file", _packet_files, _file("a.vfl", _read)),
    Target("packets", _packets, _take),
    Target("zarr metadata", *_store("json"), text=True),
    Target("zarr chunk", *_store("chunk")),
    Target("scenario", _scenarios, _file("a.toml", lambda p: load(str(p))), text=True),
    Target("settings", lambda folder: [b"scene.illuminance=500 lux\nsensor.clock=20 kHz",
                                       b"image.at=[1, 2]\nsensor.lens.psf=none", b"seed=3"],
           _settings, text=True),
    Target("config", lambda folder: [CONFIG], _config, text=True),
    Target("checkpoint", _checkpoint,
           _file("a.npz", lambda p: Checkpoint(p, "this run").load({"counter": _Counter()}))),
    Target("tape", _tape, _file("a.tape", _play)),
    Target("result", lambda folder: [RESULT], _result, text=True),
    Target("reinstated effects", lambda folder: [FINDINGS],
           _file(REINSTATED, _reinstated_before), text=True),
    Target("csr", lambda folder: [CSR], _file("csr.csv", read_csr), text=True),
    Target("log", _logs, _file("line.log", _replay(False)), text=True),
    Target("judged log", _logs, _file("line.log", _replay(True)), text=True),
    Target("picture", _pictures, _file("a.mp4", _film)),
    Target("transmission", _sent, _file("a.dat", _receive), weight=80),
    Target("request", _requests, _to_board),
    Target("etherbone", _etherbone_packets, _etherbone_board),
)  # fmt: skip
