"""The Python interface: the bits of the command line, and the examples of docs/python.md."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import viform
from cosim import Block, Interrupted
from cosim.files import Recorder, open_stream
from cosim.run.progress import QuietProgress
from cosim.run.shown import progress_in_python
from scenarios.cli.entry import _main
from scenarios.python.errors import python_words
from scenarios.python.frames import write_frames
from scenarios.scenes.clips.pictures import open_clip

ROOT = Path(viform.__file__).parent
SMALL = {"sensor.width": 64, "sensor.height": 48}
EXAMPLES = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.DOTALL)


def frames(count: int = 5) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (count, 48, 64, 3), dtype=np.uint8)


USER = """
from typing import Any, assert_type
import numpy as np
import viform

frames = np.zeros((8, 48, 64), np.uint8)
camera = viform.Camera("spikeone", width=64, height=48)
spikes = camera.film(frames, frame_rate=2000)
assert_type(camera.shape, tuple[int, int])
assert_type(viform.Display().show(spikes).images["still"].dtype.itemsize, int)
assert_type(viform.send(b"a").received, bytes)
assert_type(viform.send(b"a", out="run").outcome, str)
"""


@pytest.mark.parametrize(
    "example",
    [
        pytest.param(text, id=text.split("viform.")[1][:12],
                     marks=[pytest.mark.slow] if "viform.send" in text or "Link(" in text else [])
        for text in EXAMPLES
    ],
)  # fmt: skip
def test_an_example_of_the_documentation_runs(
    example: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "docs/python.md", "exec"), {})


def test_the_documentation_names_every_name() -> None:
    text = (ROOT / "docs/python.md").read_text()
    assert all(f"`{name}" in text or f"{name}(" in text for name in viform.__all__)
    assert len(EXAMPLES) == 8


def test_checkers_of_types_and_editors_see_every_name() -> None:
    stub: dict[str, object] = {}
    exec((ROOT / "viform-stubs/__init__.pyi").read_text(), stub)
    assert stub["__all__"] == viform.__all__
    assert all(stub[name] is getattr(viform, name) for name in viform.__all__)
    for package in viform._PACKAGES:
        assert (ROOT / package / "py.typed").is_file(), "without it, all names are Any"


@pytest.mark.slow  # mypy reads numpy and the project: most of a minute
def test_the_types_of_calls_are_those_of_what_they_give(tmp_path: Path) -> None:
    script = tmp_path / "user.py"
    script.write_text(USER)
    options = "--strict", "--cache-dir", str(tmp_path), "--no-error-summary"
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(script)], capture_output=True, text=True,
        cwd=tmp_path,
    )  # fmt: skip
    assert done.stdout == "", done.stdout
    script.write_text(USER + "camera.film(frames, frame_rate='2000')\nspikes.rates()\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(script)], capture_output=True, text=True,
        cwd=tmp_path,
    )  # fmt: skip
    assert [line.rpartition("  [")[2] for line in done.stdout.splitlines()] == [
        "arg-type]", "attr-defined]",
    ]  # fmt: skip


def test_importing_loads_nothing_else() -> None:
    code = "import sys, viform; print(sorted({'numpy', 'cosim', 'scenarios'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"
    assert all(getattr(viform, name) is not None for name in viform.__all__)
    with pytest.raises(AttributeError, match="no attribute 'films'"):
        viform.films  # noqa: B018


def test_modules_of_the_user_hide_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finders = [finder for finder in sys.meta_path if finder is not viform._Packages]
    monkeypatch.setattr(sys, "meta_path", finders)
    monkeypatch.syspath_prepend(str(tmp_path))
    names = ("cosim", "display", "link", "scenarios", "sensor")
    for name in names:
        monkeypatch.delitem(sys.modules, name)
    for name in names[1:]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "cosim.py").touch()
    (tmp_path / "mine.py").touch()
    assert find_spec("display").origin == str(tmp_path / "display/__init__.py")
    spec = spec_from_file_location("again", viform.__file__)
    again = module_from_spec(spec)
    spec.loader.exec_module(again)
    for name in names:
        assert find_spec(name).origin == str(ROOT / name / "__init__.py")
    assert find_spec("mine").origin == str(tmp_path / "mine.py")
    with pytest.warns(UserWarning) as said:
        assert again.Clock.__module__ == "cosim.clock"
    hidden = sorted(str(each.message).split("`")[1] for each in said)
    assert hidden == [f"import {name}" for name in names]
    assert f"not {tmp_path}/sensor/__init__.py: rename" in str([str(s.message) for s in said])

    monkeypatch.setitem(sys.modules, "sensor", SimpleNamespace(
        __spec__=spec_from_file_location("sensor", tmp_path / "sensor/__init__.py")
    ))  # fmt: skip
    with pytest.raises(ImportError, match=f"not {tmp_path}/sensor/__init__.py, which was") as no:
        spec.loader.exec_module(module_from_spec(spec))
    assert "\n" not in str(no.value)


def test_a_program_finds_what_it_needs_in_any_folder(tmp_path: Path) -> None:
    """The program's children find no module of the working folder, nor does PYTHONPATH matter."""
    for name in ("sensor", "display", "random", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the file of the user')\n")
    code = "from cosim.compute.opencl import probe; import viform; viform.Stream; print(*probe())"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", f"import sys; del sys.path[0]\n{code}"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert "'platform'" in done.stdout, done.stderr
    (tmp_path / "random.py").unlink()
    (tmp_path / "json.py").unlink()
    program = Path(sys.executable).with_name("viform")
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run([program, "list"], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, "") and "light-link" in done.stdout


def test_film_gives_the_bits_of_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = tmp_path / "clip.npy"
    assert write_frames(frames(), clip) == 5
    spikes = viform.film(
        (f for f in frames()), frame_rate=np.float64(1000), tolerance=1e-2, out=tmp_path / "kept",
        **SMALL,
    )  # fmt: skip
    again = viform.run(tmp_path / "kept", out=tmp_path / "repeated").stream[:]
    assert again == spikes and (tmp_path / "kept.npy").is_file()
    given = [f"--set={key}={value}" for key, value in SMALL.items()]
    out = tmp_path / "run"
    assert not _main([
        "run", "film", "--set", f"scene.path={clip}", "--set", "duration=5 ms",
        "--set", "scene.frame_rate=1000 Hz",
        "--tolerance", "1e-2", "--out", str(out), *given,
    ])  # fmt: skip
    stream = open_stream(out)
    assert spikes.cycles == stream.cycles == 200 and spikes.clock == stream.clock
    assert (spikes.words == stream.read_words(0, 7)).all() and spikes.words.any()
    monkeypatch.setattr("scenarios.python.runs.run_scenario", None)  # none is made
    again = viform.film(clip, frame_rate=1000, duration="5 ms", tolerance=1e-2, **SMALL)
    assert again == spikes and any("f/" in note for note in again.notes)


@pytest.mark.parametrize("kind", ["colour", "grey", "float"])
def test_frames_keep_their_codes(tmp_path: Path, kind: str) -> None:
    given = frames(3)
    if kind != "colour":
        given = given[..., 1]
    if kind == "float":
        given = np.random.default_rng(4).random((3, 48, 64))
    write_frames((frame for frame in given), tmp_path / "clip.npy")
    assert (np.load(tmp_path / "clip.npy") == given).all()
    clip = open_clip(tmp_path / "clip.npy", (48, 64), rate=25)
    for n, frame in enumerate(given):
        code = frame / 255
        linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
        expected = {
            "colour": lambda linear=linear: linear @ [0.2126, 0.7152, 0.0722],
            "grey": lambda linear=linear: linear, "float": lambda frame=frame: frame,
        }[kind]()  # fmt: skip
        assert np.abs(clip.frame(n) - expected).max() < 1e-5
    assert clip.rate == 25 and clip.frame(3) is None


def test_a_stream_is_sliced_by_time_and_place(tmp_path: Path) -> None:
    planes = np.random.default_rng(5).integers(0, 2, (150, 6, 9), dtype=np.uint8)
    whole = viform.Viform.from_planes(planes, viform.Clock(40_000))
    viform.save(whole, tmp_path / "s.npz")
    for stream in (whole, viform.open(tmp_path / "s.npz")):
        for first, stop in ((0, 150), (1, 150), (31, 33), (64, 96), (5, 140), (149, 150)):
            part = stream[first:stop]
            assert part.start == first and (part.planes() == planes[first:stop]).all()
        corner = stream[40:-7, 2:5, -3:]
        assert (corner.planes() == planes[40:-7, 2:5, -3:]).all()
        assert (stream[-1].planes() == planes[-1:]).all()
        assert stream.between(1e-3, 2e-3) == stream[40:80]
        assert stream.between(-1e-3, 1e-3) == stream[:40]
        assert stream.between(3e-3, float("inf")) == stream[120:]
        for times in ((2e-3, 1e-3), (1, 2), (-2, -1), (0, float("nan"))):
            with pytest.raises(viform.InputError, match="times must be a part of 0 to"):
                stream.between(*times)
        assert np.allclose(stream.rate(), planes.mean(axis=0))
        assert "150 cycles at 40 kHz (3.75 ms), 9 x 6 pixels" in repr(stream)
        assert len(stream) == 150 and (stream.planes() == planes).all()
        assert stream._repr_png_().startswith(b"\x89PNG")
    assert part[0:1].start == 149


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (slice(0, 10, 2), "cycles must be a slice without a step"),
        (150, "cycles must be a part of 0:150"),
        ((slice(None), slice(4, 4)), "rows must be a part of 0:6, not 4:4"),
        ((0, 0, "a"), "columns must be a slice without a step, or an index"),
    ],
)
def test_a_part_that_is_none_is_one_line(part: object, says: str) -> None:
    stream = viform.Viform.from_planes(np.zeros((150, 6, 9), np.uint8), viform.Clock(40_000))
    with pytest.raises(viform.InputError, match=says):
        stream[part]


def test_a_key_that_is_none_is_not_given_and_a_dictionary_is_a_section() -> None:
    size: dict[str, Any] = {"width": 32, "height": 24}
    plain = viform.Camera("spikeone", **size).film(frames(), 500)
    for keys in ({"preset": None, "pattern": None}, {"sensor": size}, {"lens": {"psf": "none"}}):
        same = viform.Camera("spikeone", **size | keys).film(frames(), 500)
        assert np.array_equal(same.words, plain.words)
    shaded = viform.Camera("spikeone", pattern={"prnu": 0.2}, **size).film(frames(), 500)
    dotted = viform.Camera("spikeone", **{"pattern.prnu": 0.2, **size}).film(frames(), 500)
    assert np.array_equal(shaded.words, dotted.words)
    assert not np.array_equal(shaded.words, plain.words)
    called = viform.film(frames(), frame_rate=500, sensor=size, duration=None)
    assert called.shape == (24, 32) and called.cycles == plain.cycles
    shown = viform.Display(drive=None, pursuit=None).show(plain, eye="still")  # type: ignore[arg-type]
    assert shown.images["still"].shape[1:] == (24, 32)
    for keys in ({"pattern": {}}, {"pattern": {"prnu": {}}}, {"pattern": {"prnu": {"x": 1}}}):
        with pytest.raises(viform.InputError) as refused:
            viform.Camera(**keys)
        assert "\n" not in str(refused.value)


def test_bad_input_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stream = viform.Viform.from_planes(np.zeros((50, 6, 9), np.uint8), viform.Clock(40_000))
    calls = {
        "frame_rate must be given with frames": lambda: viform.film(frames()),
        "frame_rate must be frames/s above 0": lambda: viform.film(frames(), frame_rate=-1),
        "the clip must be one frame or more": lambda: viform.film([], frame_rate=25),
        "a frame must be": lambda: viform.film(np.zeros((2, 4, 4), np.int64), frame_rate=25),
        "from 0 to 1, a share of white, not 0 to 2": lambda: viform.film(
            np.full((2, 4, 4), 2.0), frame_rate=25
        ),
        "frame 1 must be": lambda: viform.film(
            [np.zeros((4, 4), np.uint8), np.zeros((4, 5), np.uint8)], frame_rate=25
        ),
        "frame 1 must be .4, 4. uint8": lambda: viform.film(
            [np.zeros((4, 4), np.uint8), np.zeros((4, 5), np.uint8)], frame_rate=25, out="kept"
        ),
        "scene.path must be": lambda: viform.film("no-such-clip.mp4"),
        "sensor.widht": lambda: viform.film("step", **{"sensor.widht": 5}),
        "duration must be a text, number, path, list or": lambda: viform.film("step", duration={}),
        "frame_rate must be frames/s as a number": lambda: viform.film(
            frames(), frame_rate="25 Hz"
        ),
        "frames must be arrays": lambda: viform.film(None, frame_rate=25),
        "^method must be one of": lambda: viform.reconstruct(stream, 5, "tpf"),
        "the stream must be a Viform, a Stream or a path": lambda: viform.reconstruct(
            np.zeros((4, 4)), 5
        ),
        "a part must be cycles, rows, columns": lambda: stream[0, 0, 0, 0],
        "the stream must be a file that exists": lambda: viform.open("nothing.npz"),
        "size must be .width, height. in whole pixels": lambda: viform.open(
            "nothing.dat", size="9x6"
        ),
        "frames must be an array .T, H, W.": lambda: viform.film(frames()[0, ..., 0], frame_rate=9),
        "at must be the number of a cycle": lambda: viform.reconstruct(stream, 5.5),
        "^method must be one of tfp, tfi, tfstp, motion-tfp, tau": lambda: viform.reconstruct(
            stream, 5, "255"
        ),
        "the run must be a folder with a result.json": lambda: viform.Run("nothing"),
        "window must be a whole number of cycles": lambda: viform.reconstruct(
            stream, 5, window=3.5
        ),
        "the path must be a text or a Path, not None": lambda: viform.open(None),
        "the path must be a text or a Path, not 3": lambda: viform.save(stream, 3),
        "the output must be .* not x.intensities.npz": lambda: viform.save(
            stream, "x.intensities.npz"
        ),
        "scene.path must be given once": lambda: viform.film(
            frames(), frame_rate=25, out="run", **{"scene.path": "clip.mp4"}
        ),
        "scene.frame_rate must be given once": lambda: viform.film(
            "clip.mp4", frame_rate=25, **{"scene.frame_rate": "30 Hz"}
        ),
        "sensor.source must be given once": lambda: viform.show(
            stream, out="run", **{"sensor.source": "file:other.npz"}
        ),
        "link.file must be given once": lambda: viform.send(b"a", out="run", **{"link.file": "a"}),
        "report must be given with out": lambda: viform.show(stream, report="none"),
        "report must be given with out, not al": lambda: viform.send(b"a", report="none"),
        "data must be bytes, or the path of a file, not list": lambda: viform.send([1, 2]),
        "data must be one byte or more, not none": lambda: viform.send(bytearray()),
        "the path must be a text or a Path, not 7": lambda: viform.Run(7),
        "planes must be 0 or 1": lambda: viform.Viform.from_planes(
            frames()[..., 0], viform.Clock(40_000)
        ),
        "planes must be .T, H, W. bool or uint8": lambda: viform.Viform.from_planes(
            frames()[..., 0] / 255, viform.Clock(40_000)
        ),
    }
    for says, call in calls.items():
        with pytest.raises(viform.InputError, match=says):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "argument"),
    [
        ("write --set sensor.clock='20 kHz'", 'write **{"sensor.clock": "20 kHz"}'),
        ("write --set sensor.writes='[{\"cycle\": 400}]'",
         'write **{"sensor.writes": [{"cycle": 400}]}'),
        ("--set sensor.widht", "sensor.widht"),
        ("values of --set", "values of a keyword argument"),
        ("--dark-limit", "dark_limit"),
        ("go on with the same command and --out '/a b' --resume",
         'go on with the same command and out="/a b" resume=True'),
        ("see `viform list --keys`", "see `viform list --keys`"),
        ("finish it: viform run x --resume --out x", "finish it: viform run x --resume --out x"),
        ("an en--dash", "an en--dash"),
    ],
)  # fmt: skip
def test_errors_speak_of_arguments(option: str, argument: str) -> None:
    assert python_words(option) == argument


def test_the_errors_of_functions_speak_of_arguments(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a").touch()
    with pytest.raises(viform.InputError) as raised:
        viform.run("film", out=tmp_path / "full")
    assert str(raised.value).startswith("out must be a new or empty folder")
    assert str(raised.value).endswith("choose another, or add resume=True")
    with pytest.raises(viform.InputError) as raised:
        viform.run("film", **{"sensor.threshold.x": 1})
    assert "--" not in str(raised.value) and "sensor.threshold.x" in str(raised.value)


def test_a_run_tells_its_results_and_is_resumed(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = viform.run("film", out=out, tolerance=1e-2, duration="2 ms", **SMALL)
    assert done.outcome == "ok" and done.error is not None and done.error < 1e-2
    assert done.stream.shape == (48, 64) and done.report is not None and done.report.is_file()
    assert done.images and all(image.shape[:2] == (48, 64) for image in done.images.values())
    assert done.metrics["spike_rate"] == pytest.approx(float(done.stream.rate().mean()), rel=0.01)
    assert "Run of film: ok" in repr(done)
    before = (out / "result.json").stat().st_mtime_ns
    again = viform.run("film", out=out, tolerance=1e-2, duration="2 ms", resume=True, **SMALL)
    assert again == done and (out / "result.json").stat().st_mtime_ns == before
    assert viform.Run(str(out)) == done
    bare = viform.run(
        "film", out=tmp_path / "bare", tolerance=1e-2, duration="2 ms", report="none", **SMALL
    )
    assert bare.report is None and not bare.images
    for name, value in done.metrics.items():
        assert bare.metrics[name] == value or name in ("camera", "full_physics")
    with pytest.raises(viform.InputError, match="report must be one of page, none"):
        viform.film("step", out=tmp_path / "no", report="pages")
    assert not (tmp_path / "no").exists()


def test_what_is_in_memory_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A film of frames that was stopped in the middle has the bits of one that was not."""
    given = {"frame_rate": 1000, "tolerance": 1e-2, **SMALL}
    whole = viform.film(frames(16), **given)
    out, step = tmp_path / "run", Recorder.step

    def stop(self: Recorder, data: object, block: Block) -> object:
        if block.start == 2 * block.cycles:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.5)  # until the main thread has it
        return step(self, data, block)

    monkeypatch.setattr(Recorder, "step", stop)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(Interrupted):
        viform.film(frames(16), out=out, **given)
    signal.signal(signal.SIGINT, before)
    monkeypatch.undo()
    assert not (out / "result.json").exists()
    with pytest.raises(viform.InputError, match="add resume=True"):
        viform.film(frames(16), out=out, **given)
    assert viform.film(frames(16), out=out, resume=True, **given) == whole
    assert viform.film(frames(16), out=out, resume=True, **given) == whole  # complete
    for call in (viform.film, viform.send):
        with pytest.raises(viform.InputError, match="resume must be given with out"):
            call(b"x" if call is viform.send else "step", resume=True)


@pytest.mark.parametrize("data", [b"", "file"])
def test_nothing_is_not_sent(tmp_path: Path, data: bytes | str) -> None:
    (tmp_path / "file").touch()
    given = data if isinstance(data, bytes) else str(tmp_path / data)
    with pytest.raises(viform.InputError, match=r"^data must be one byte or more, not ") as raised:
        viform.send(given, out=tmp_path / "out")
    assert "\n" not in str(raised.value) and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("terminal", "asked", "seen"),
    [(True, None, True), (True, False, False), (False, None, False), (False, True, True)],
)
def test_progress_is_shown_on_a_terminal(
    terminal: bool, asked: bool | None, seen: bool, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal, raising=False)
    monkeypatch.setattr("cosim.run.shown.EVERY_S", -1.0)  # a line for every step
    done = viform.run(
        "film", out=tmp_path / "run", tolerance=1e-2, duration="2 ms", progress=asked, **SMALL
    )
    said = capsys.readouterr()
    assert bool(said.err) == seen and said.out == ""
    assert done.notes  # which are not printed
    assert not any(note in said.err for note in done.notes)


def test_a_notebook_shows_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    shell = type("ZMQInteractiveShell", (), {})()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    with progress_in_python(None) as shown:
        assert type(shown) is not QuietProgress
    with progress_in_python(False) as shown:
        assert type(shown) is QuietProgress


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a").touch()
    with pytest.raises(viform.InputError, match=r"not .*full; choose another, or add resume=True$"):
        viform.send(b"bytes", out=tmp_path / "full")
