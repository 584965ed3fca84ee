"""Standard output and standard error: encodings of terminals, foreign text, and streams that are
closed or take nothing."""

from __future__ import annotations

import io
import json
import resource
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosim import InputError
from cosim.compute import opencl
from cosim.errors import one_line, say
from cosim.run.result import dumps
from cosim.run.shown import SilentProgress, TerminalProgress
from scenarios.cli.entry import _main
from scenarios.cli.output import print_document, tell
from scenarios.cli.start import isolate
from scenarios.cli.streams import Printed, json_for

FOREIGN = "clip\x1b[2J\r\nviform: all is well\x9b2J\u202e\udcff.mp4"
"""The name of a file that would clear a terminal, and print a line of its own."""


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [
        ("utf-8", "4.9 × 10⁻⁸ at 40 °C, 12\u202f000 µs, ä, \\udcff"),
        ("ascii", "4.9 x 10^-8 at 40 degC, 12 000 us, \\xe4, \\udcff"),
        ("latin-1", "4.9 × 10^-8 at 40 °C, 12 000 µs, ä, \\udcff"),
        ("cp1252", "4.9 × 10^-8 at 40 °C, 12 000 µs, ä, \\udcff"),
        ("gbk", "4.9 × 10^-8 at 40 °C, 12 000 us, \\xe4, \\udcff"),
    ],
)
def test_a_terminal_without_our_signs_spells_them(encoding: str, printed: str) -> None:
    raw = io.BytesIO()
    stream = Printed(raw, encoding=encoding, errors="viform")
    stream.write("4.9 × 10⁻⁸ at 40 °C, 12\u202f000 µs, ä, \udcff")
    stream.flush()
    assert raw.getvalue().decode(encoding) == printed


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "gbk"])
def test_a_document_stays_one_whatever_the_stream_and_its_text(
    encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", Printed(raw, encoding=encoding, errors="viform"))
    print_document({"unit": "µm²", "name": FOREIGN, "far": "\N{GRINNING FACE}"})
    sys.stdout.flush()
    text = raw.getvalue().decode(encoding)
    assert json.loads(text) == {"unit": "µm²", "name": FOREIGN, "far": "\N{GRINNING FACE}"}
    assert text.replace("\n", "").isprintable() and text.isascii() is (encoding != "utf-8")


def test_a_document_can_be_written_to_a_file() -> None:
    assert json.loads(dumps([FOREIGN]).encode("utf-8")) == [FOREIGN]
    assert json_for(SimpleNamespace(encoding="UTF-8"), '"µ"') == '"µ"'


def test_foreign_text_stays_in_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    say(FOREIGN)
    SilentProgress().note(FOREIGN)
    tell(FOREIGN, "12\u202f000")
    out, err = capsys.readouterr()
    assert (
        out == f"{one_line(FOREIGN)}\n12\u202f000\n" and err == f"viform: {one_line(FOREIGN)}\n" * 2
    )
    assert one_line(FOREIGN).isprintable()


def test_a_bar_shows_foreign_text_in_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "dumb")
    progress = TerminalProgress()
    progress.start(f"[red]{FOREIGN}", 2)
    progress.note(FOREIGN)
    progress.close()
    assert f"viform: {one_line(FOREIGN)}\n" in shown.getvalue()
    assert "[red]clip" in shown.getvalue()
    assert "\x1b" not in shown.getvalue() and "\x9b" not in shown.getvalue()


def test_commands_print_foreign_names_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import numpy as np

    from cosim import Clock, Viform
    from cosim.files.npz import write_npz

    name = "a\x1b[2J\nb"
    write_npz(Viform(np.ones((1, 4, 32), np.uint32), 32, Clock(20000)), tmp_path / f"{name}.npz")
    assert _main(["convert", str(tmp_path / f"{name}.npz"), str(tmp_path / f"{name}.dat")]) == 0
    (tmp_path / f"{name}.toml").write_text("[sensor]\nno = 1\n", encoding="utf-8")
    assert _main(["run", str(tmp_path / f"{name}.toml")]) == 2
    out, err = capsys.readouterr()
    for text in (out, err):
        assert "a\\x1b[2J\\nb" in text and all(line.isprintable() for line in text.splitlines())
    assert out.count("\n") == 1 and err.count("viform: ") == err.count("\n")


def test_settings_of_a_user_s_other_programs_do_not_reach_a_command() -> None:
    environ = {
        "MPLBACKEND": "module://matplotlib_inline.backend_inline", "MATPLOTLIBRC": "/home/a",
        "NUMBA_THREADING_LAYER": "tbb", "NUMBA_DISABLE_JIT": "1", "NUMBA_DUMP_IR": "1",
        "NUMBA_NUM_THREADS": "all", "NUMBA_CACHE_DIR": "/a", "PYTHONWARNINGS": "error",
        "HOME": "/b",
    }  # fmt: skip
    isolate(environ)
    assert environ == {
        "MPLBACKEND": "agg", "MATPLOTLIBRC": "/dev/null", "NUMBA_CACHE_DIR": "/a", "HOME": "/b",
    }  # fmt: skip
    environ["NUMBA_NUM_THREADS"] = "1"
    isolate(environ)
    assert environ["NUMBA_NUM_THREADS"] == "1"


def test_a_small_limit_of_files_is_told_before_the_compiler_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(resource, "getrlimit", lambda of: (20480, limit[1]))
    with pytest.raises(InputError) as refused:
        opencl._check_cache(tmp_path)
    assert str(refused.value) == (
        "the limit of a file's size (ulimit -f) must be 2048 KiB or more, not 20 KiB; raise it, or "
        "pass --device numba"
    )


def test_a_working_folder_that_is_gone_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    assert _main(["list"]) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith(
        "viform: the working folder must be one that exists, not lost"
    )
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("redirected", "out"),
    [
        (">&-", ""), ("2>&-", "out\n"), ("2>/dev/full", "out\n"), ("2</dev/null", "out\n"),
        ("<&- >&- 2>&-", ""),
    ],
)  # fmt: skip
def test_standard_streams_may_be_closed_or_full(redirected: str, out: str) -> None:
    program = (
        "import os, sys; from scenarios.cli.streams import protect; protect();"
        "assert os.open('/dev/null', 0) > 2;"  # else prints would go into a file of ours
        "print('err', file=sys.stderr); print('out')"
    )
    command = ["sh", "-c", f'exec "$0" -c "$1" {redirected}', sys.executable, program]
    done: Any = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=60)
    assert (done.returncode, done.stdout) == (0, out)
    assert done.stderr == ("err\n" if redirected == ">&-" else "")


USED = ("run", "step", "--set", "sensor.width=32", "--set", "sensor.height=32", "--set",
        "duration=2 ms", "--set", "scene.at=1 ms", "--device", "numba", "--out", "out")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "code"),
    [
        ("MPLBACKEND=module://nothing.here MATPLOTLIBRC=$PWD", "", 0),
        ("PYTHONUTF8=0 PYTHONCOERCECLOCALE=0 LC_ALL=POSIX", "", 0),
        ("PYTHONIOENCODING=cp1252", "", 0),
        ("NUMBA_THREADING_LAYER=tbb NUMBA_NUM_THREADS=none", "", 0),
        ("NUMBA_CACHE_DIR=/proc/none", "", 0),
        ("PYTHONWARNINGS=error PYTHONOPTIMIZE=2", "", 0),
        ("HOME= TMPDIR=/nowhere TERM=dumb COLUMNS=1 LANG=xx_YY.FOO", "", 0),
        ("", ">&-", 0), ("", "2>&-", 0), ("", "2>/dev/full", 0), ("", "<&- >&- 2>&-", 0),
        ("umask 0777;", "", 0),
        ("prlimit --fsize=20000", "", 2),
        ("prlimit --nofile=9", "", 2),
        ("mkdir gone; cd gone; rmdir ../gone;", "", 2),
    ],
)  # fmt: skip
def test_a_run_is_complete_or_refused_in_any_surroundings(
    tmp_path: Path, before: str, after: str, code: int
) -> None:
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n", encoding="utf-8")
    program = "from scenarios.cli import main; main()"
    command = f'{before} "$0" -c \'{program}\' "$@" {after}'
    done: Any = subprocess.run(
        ["sh", "-c", command, sys.executable, *USED],
        cwd=tmp_path, capture_output=True, encoding="utf-8", errors="replace", timeout=600,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert (tmp_path / "out/result.json").exists() is (code == 0)
    assert "Traceback" not in done.stderr
    if code:
        assert done.stderr.splitlines()[-1].startswith("viform: ") and not done.stdout
