"""The launcher `viform`, without a network: real shell, real files, stand-ins for what it calls.

The script is copied into a box where its system paths lead nowhere else, and runs with a PATH of a
few real tools and of fake `python3`, `apt-get`, `sudo` and `id` that write down how they were
called. What is tried on a real machine (Debian from nothing) is told in docs/install.md.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = [
    "cat",
    "cksum",
    "cut",
    "find",
    "flock",
    "grep",
    "ln",
    "mkdir",
    "mktemp",
    "mv",
    "readlink",
    "rm",
    "sh",
]
TOOLS += ["sleep", "tail", "touch"]

FAKE_PYTHON = """#!/bin/sh
[ -e "$BOX/{name}.lacks-venv" ] && no_venv=1
printf '%s %s\\n' {name} "$*" >>"$BOX/calls"
case "$*" in
    *"import ensurepip"*) [ -z "${{no_venv-}}" ] ;;
    *sys.version_info*) echo {version}; exit {unfit} ;;
    *_base_executable*) readlink -f "$0" ;;
    *"-m venv"*)
        mkdir -p "$4/bin" && ln -s "$(readlink -f "$0")" "$4/bin/python" && : >"$4/pyvenv.cfg" ;;
    *"-m pip install"*)
        echo pip talks; echo pip complains >&2
        if [ -e "$BOX/pip.sleeps" ]; then sleep 1; fi
        if [ -e "$BOX/pip.fails" ]; then echo no such package; exit 1; fi
        if [ -e "$BOX/pip.dies" ]; then echo Installing collected packages: x; kill -9 $PPID; fi ;;
    */bin/viform*)
        shift
        # As scenarios/cli/start.py does: the command asks for what the file `lacks` names.
        if [ -e "$BOX/lacks" ] && [ -n "${{VIFORM_LAUNCHER-}}" ]; then
            while read -r package; do
                case " $VIFORM_ASKED " in
                    *" $package "*) ;;
                    *) VIFORM_INSTALL="${{VIFORM_INSTALL:+$VIFORM_INSTALL }}$package" ;;
                esac
            done <"$BOX/lacks"
            [ -z "${{VIFORM_INSTALL-}}" ] ||
                {{ export VIFORM_INSTALL && exec "$VIFORM_LAUNCHER" "$@"; }}
        fi
        echo "$VIFORM_CALLED" >"$BOX/called"
        export -p | grep -o 'PYTHON[A-Z0-9]*' >"$BOX/exported"
        printf '<%s>' "$@" ;;
esac
"""

FAKE_APT = """#!/bin/sh
echo "apt-get $*" >>"$BOX/calls"
echo apt talks
if [ -e "$BOX/apt.fails" ]; then echo E: no network; exit 100; fi
case "$*" in *install*) rm -f "$BOX/lacks" ;; esac
case "$*" in *install*python3-venv*)
    rm -f "$BOX/python3.lacks-venv"
    if [ -e "$BOX/python3.apt" ]; then ln -s "$BOX/python3.apt" "$BOX/bin/python3"; fi ;;
esac
"""


class Box:
    """A machine with a clone on it. `calls` are the lines that the stand-ins wrote."""

    def __init__(self, root: Path, *, uid: int = 1000):
        self.root = root
        self.bin = root / "bin"
        self.bin.mkdir()
        self.clone = root / "a clone"
        self.clone.mkdir()
        self.home = root / "home"
        self.home.mkdir()
        for tool in TOOLS:
            if found := shutil.which(tool):
                (self.bin / tool).symlink_to(found)
        first, rest = (ROOT / "viform").read_text().split("\n", 1)
        rest = re.sub(r"(?<![\w$}])/(usr|etc|var)/", rf"{root}/\1/", rest)
        rest = rest.replace("while sleep 1 ", "while sleep 0.02 ")
        self.script("a clone/viform", f"{first}\n{rest}")
        self.script("bin/id", f"#!/bin/sh\necho {uid}\n")
        for name in ("pyproject.toml", "requirements.lock", "requirements-dev.lock"):
            shutil.copy(ROOT / name, self.clone / name)
        self.venv = self.clone / ".venv"

    def script(self, name: str, text: str) -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)

    def python(self, name: str = "python3", version: str = "3.12.1", *, fit: bool = True) -> None:
        text = FAKE_PYTHON.format(name=name.split("/")[-1], version=version, unfit=int(not fit))
        self.script(f"bin/{name}", text)

    def lacks(self, *packages: str) -> None:
        """What the command will ask for, until apt-get has installed it."""
        (self.root / "lacks").write_text("".join(f"{package}\n" for package in packages))

    def apt(self) -> None:
        """An apt-get that brings the venv module, Python and what the command lacks, in name."""
        self.script("bin/apt-get", FAKE_APT)

    def sudo(self, *, allowed: bool) -> None:
        text = 'echo "sudo $*" >>"$BOX/calls"\n'
        text += '[ "$1" = -n ] && shift\n"$@"\n' if allowed else "exit 1\n"
        self.script("bin/sudo", f"#!/bin/sh\n{text}")

    def touch(self, *names: str) -> None:
        for name in names:
            path = self.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()

    def environment(self, **variables: str) -> dict[str, str]:
        plain = {"PATH": str(self.bin), "BOX": str(self.root), "HOME": str(self.home)}
        return plain | {"TMPDIR": str(self.home)} | variables

    def run(self, *arguments: str, at: str = "a clone/viform", cwd: Path | None = None, **env: str):
        return subprocess.run(
            [self.root / at, *arguments],
            env=self.environment(**env),
            cwd=cwd or self.root,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=30,
        )

    def calls(self) -> list[str]:
        """Calls since the last time."""
        path = self.root / "calls"
        lines = path.read_text().splitlines() if path.exists() else []
        path.unlink(missing_ok=True)
        return lines


@pytest.fixture
def box(tmp_path):
    return Box(tmp_path)


def pips(calls: list[str]) -> list[str]:
    return [call.split("--progress-bar off ")[1] for call in calls if "-m pip install" in call]


def made(calls: list[str]) -> int:
    return sum("-m venv" in call for call in calls)


@pytest.mark.parametrize("shell", ["sh", "dash", "bash", "busybox"])
def test_the_script_is_posix_shell(shell):
    if not shutil.which(shell):
        pytest.skip(f"no {shell} here")
    command = [shell, "sh", "-n"] if shell == "busybox" else [shell, "-n"]
    for script in ("viform", ".ci/run") if shell == "bash" else ("viform",):
        assert subprocess.run([*command, ROOT / script]).returncode == 0
        assert os.access(ROOT / script, os.X_OK)


def test_set_up_once_then_only_the_command(box):
    box.python()
    first = box.run("run", "film", "--set", "a=b c", "")
    assert first.returncode == 0
    assert first.stdout == "<run><film><--set><a=b c><>"
    assert first.stderr == "viform: making .venv (once, about a minute)\n"
    calls = box.calls()
    assert made(calls) == 1
    assert pips(calls) == [
        f"-r {box.clone}/requirements.lock",
        "--no-deps --no-build-isolation -e .",
    ]

    second = box.run("run", "film")
    assert (second.returncode, second.stdout, second.stderr) == (0, "<run><film>", "")
    assert box.calls() == [f"python3 {box.venv}/bin/viform run film"]


def test_a_long_step_says_how_long_and_what_it_does(box):
    box.python()
    box.touch("pip.sleeps")
    first, *said = box.run("list").stderr.splitlines()
    assert first == "viform: making .venv (once, about a minute)"
    assert said[0] in ("viform:   10 s, pip talks", "viform:   10 s, pip complains")
    # Each of two steps counts once, from its beginning.
    seconds = [int(line.split()[1]) for line in said]
    again = seconds.index(10, 1)
    for step in (seconds[:again], seconds[again:]):
        assert step == [10 * n for n in range(1, len(step) + 1)]


def test_no_module_of_the_user_comes_before_ours(box):
    box.python()
    ill = ("PYTHONPATH", "PYTHONHOME", "PYTHONPLATLIBDIR", "PYTHONSTARTUP", "PYTHONINSPECT")
    done = box.run("list", **dict.fromkeys((*ill, "PYTHONSAFEPATH", "PYTHONUTF8"), "1"))
    assert done.returncode == 0
    kept = {"PYTHONSAFEPATH", "PYTHONNOUSERSITE", "PYTHONUTF8"}
    assert set((box.root / "exported").read_text().split()) == kept
    for seed, known in (("7", True), ("abc", False)):  # over the second, Python ends
        assert box.run("list", PYTHONHASHSEED=seed).returncode == 0
        assert ("PYTHONHASHSEED" in (box.root / "exported").read_text()) == known


def test_a_path_without_the_programs_of_the_system_is_named(box):
    box.python()
    (box.bin / "mktemp").unlink()
    done = box.run("list")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        f"viform: PATH must name the folders of the system's programs, not '{box.bin}'"
    )


def test_test_adds_its_own_and_covers_run(box):
    box.python()
    box.run("list")
    box.calls()
    added = box.run("--json", "test")
    assert added.stdout == "<--json><test>"
    assert added.stderr == "viform: adding what `test` needs to .venv\n"
    calls = box.calls()
    assert made(calls) == 0
    assert pips(calls)[0] == f"--no-compile -r {box.clone}/requirements-dev.lock"
    for command in ("test", "list"):
        assert box.run(command).stderr == ""
    assert pips(box.calls()) == []


@pytest.mark.parametrize("name", ["requirements.lock", "pyproject.toml"])
def test_a_changed_lock_installs_again(box, name):
    box.python()
    box.run("list")
    box.calls()
    with (box.clone / name).open("a") as file:
        file.write("# changed\n")
    assert box.run("list").stderr == "viform: bringing .venv up to date\n"
    calls = box.calls()
    assert made(calls) == 0
    assert len(pips(calls)) == 2


def test_another_minor_python_under_it_makes_it_anew(box):
    box.python()
    box.python("python3.11", "3.11.9")
    box.run("list")
    box.calls()
    (box.venv / "bin/python").unlink()
    assert box.run("list").stderr == "viform: making .venv (once, about a minute)\n"
    assert made(box.calls()) == 1
    assert (box.run("list").stderr, len(box.calls())) == ("", 1)
    (box.venv / "bin/python").unlink()
    (box.venv / "bin/python").symlink_to(box.bin / "python3.11")
    assert len(pips([box.run("list").stderr, *box.calls()])) == 2


def test_a_moved_clone_is_made_anew(box):
    box.python()
    box.run("list")
    box.calls()
    box.clone.rename(box.root / "moved")
    box.run("list", at="moved/viform")
    assert made(box.calls()) == 1


def test_a_killed_set_up_does_not_look_finished(box):
    box.python()
    box.touch("pip.dies")
    assert box.run("list").returncode == -signal.SIGKILL
    box.calls()
    (box.root / "pip.dies").unlink()
    again = box.run("list")
    assert again.stdout == "<list>"
    assert made(box.calls()) == 1


def test_a_killed_update_does_not_look_finished_with_the_old_lock(box):
    box.python()
    box.run("list")
    lock = box.clone / "requirements.lock"
    before = lock.read_bytes()
    lock.write_bytes(before + b"# changed\n")
    box.touch("pip.dies")
    assert box.run("list").returncode == -signal.SIGKILL
    box.calls()
    lock.write_bytes(before)
    (box.root / "pip.dies").unlink()
    assert box.run("list").returncode == 0
    assert made(box.calls()) == 1


def test_a_failed_pip_shows_its_end_and_keeps_the_environment(box):
    box.python()
    box.touch("pip.fails")
    failed = box.run("list")
    assert (failed.returncode, failed.stdout) == (2, "")
    assert "no such package\n" in failed.stderr
    assert failed.stderr.splitlines()[-1].startswith(
        "viform: pip must install requirements.lock but failed, see above"
    )
    box.calls()
    (box.root / "pip.fails").unlink()
    assert box.run("list").returncode == 0
    calls = box.calls()
    assert made(calls) == 0
    assert len(pips(calls)) == 2


@pytest.mark.skipif(not shutil.which("flock"), reason="without flock nobody waits")
def test_two_at_once_make_it_once(box):
    box.python()
    box.touch("pip.sleeps")
    command = [box.clone / "viform", "list"]
    both = [
        subprocess.Popen(
            command,
            env=box.environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    said = [process.communicate(timeout=30) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert [out for out, _ in said] == ["<list>", "<list>"]
    assert sorted(err.count("waiting for another set-up") for _, err in said) == [0, 1]
    calls = box.calls()
    assert (made(calls), len(pips(calls))) == (1, 2)


def test_it_works_from_anywhere_and_through_links(box):
    box.python()
    (box.root / "b").mkdir()
    (box.bin / "viform").symlink_to(box.clone / "viform")
    (box.root / "b/link").symlink_to("../bin/viform")
    assert box.run("list", cwd=box.root / "b", at="b/link").stdout == "<list>"
    assert made(box.calls()) == 1
    assert box.run("list", cwd=Path("/"), at="bin/viform").stderr == ""
    assert len(box.calls()) == 1


def test_a_named_environment_is_used_and_never_one_that_holds_other_things(box):
    box.python()
    assert box.run("list", VIFORM_VENV="b/c", cwd=box.home).returncode == 0
    assert (box.home / "b/c/viform-run.stamp").exists()
    assert not box.venv.exists()

    (box.home / "thesis.tex").touch()
    refused = box.run("list", VIFORM_VENV=str(box.home))
    assert refused.returncode == 2
    assert refused.stderr == (
        f"viform: {box.home} must be a new folder or a Python environment, not hold other things: "
        "name another in VIFORM_VENV\n"
    )
    assert (box.home / "thesis.tex").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_clone_that_cannot_be_written_keeps_its_environment_in_the_cache(box):
    box.python()
    box.clone.chmod(0o555)
    try:
        assert box.run("list").returncode == 0
        assert box.run("list").stderr == ""
        homeless = box.run("list", HOME="")
    finally:
        box.clone.chmod(0o755)
    assert len(list(box.home.glob(".cache/viform/*/viform-run.stamp"))) == 1
    assert homeless.returncode == 2
    assert homeless.stderr.count("\n") == 1
    assert "VIFORM_VENV" in homeless.stderr


def test_no_python_is_one_line_and_exit_2(box):
    for variables in ({}, {"VIFORM_NO_APT": "1"}):
        result = box.run("run", **variables)
        assert (result.returncode, result.stdout) == (2, "")
        assert result.stderr == (
            "viform: Python must be 3.11, 3.12 or 3.13, not absent: install one, or name one in "
            "VIFORM_PYTHON\n"
        )
    assert not box.venv.exists()
    assert list(box.home.iterdir()) == []


def test_an_unfit_python_is_named(box):
    box.python("python3", "3.9.2", fit=False)
    box.python("python3.13", "3.14.0", fit=False)
    result = box.run("run")
    assert result.returncode == 2
    assert result.stderr == (
        f"viform: Python must be 3.11, 3.12 or 3.13, not 3.9.2 ({box.bin}/python3) and 3.14.0 "
        f"({box.bin}/python3.13): install one, or name one in VIFORM_PYTHON\n"
    )


def test_the_first_fit_python_is_taken_and_another_can_be_asked_for(box):
    box.python("python3", "3.10.0", fit=False)
    box.python("python3.12")
    box.python("python3.13", "3.13.0")
    box.run("list")
    assert (box.venv / "bin/python").resolve() == box.bin / "python3.12"
    asked = str(box.bin / "python3.13")
    assert "making .venv" in box.run("list", VIFORM_PYTHON=asked).stderr
    assert (box.venv / "bin/python").resolve() == box.bin / "python3.13"
    assert box.run("list", VIFORM_PYTHON=asked).stderr == ""
    assert box.run("list").stderr == ""

    absent = box.run("list", VIFORM_PYTHON="python9")
    assert absent.returncode == 2
    assert absent.stderr == (
        "viform: VIFORM_PYTHON must be a Python 3.11, 3.12 or 3.13, not python9: name another or "
        "unset it\n"
    )


OPENCL = ("pocl-opencl-icd", "ocl-icd-libopencl1")


def installs(calls: list[str]) -> list[str]:
    asked = [call for call in calls if call.startswith("apt") and "install" in call]
    return [call.split("recommends ")[1] for call in asked]


def test_root_installs_python_and_then_what_the_command_lacks(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python("../python3.apt")
    box.apt()
    result = box.run("run", "film")
    assert (result.returncode, result.stdout) == (0, "<run><film>")
    assert result.stderr == (
        "viform: installing system packages (some minutes where the network is slow): "
        "python3 python3-venv\n"
        "viform: making .venv (once, about a minute)\n"
    )
    assert [call for call in box.calls() if call.startswith("apt")] == [
        "apt-get update -q",
        "apt-get -o DPkg::Lock::Timeout=600 install -y -q --no-install-recommends python3 "
        "python3-venv",
    ]
    box.lacks(*OPENCL)
    result = box.run("run", "film", "--set", "a=b c", "")
    assert (result.returncode, result.stdout) == (0, "<run><film><--set><a=b c><>")
    assert result.stderr == (
        "viform: installing system packages (some minutes where the network is slow): "
        f"{' '.join(OPENCL)}\n"
    )
    calls = box.calls()
    assert (made(calls), pips(calls), installs(calls)) == (0, [], [" ".join(OPENCL)])
    box.lacks(*OPENCL)
    link = box.root / "a link"
    link.symlink_to(box.clone / "viform")
    box.run("run", "film", at="a link")  # starts the script once more, by its path
    assert (box.root / "called").read_text() == f"{link}\n"
    box.calls()
    box.run("run", "film")
    assert len(box.calls()) == 1


def test_a_command_that_lacks_nothing_asks_for_nothing(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.apt()
    for command in ("list", "doctor", "run", "test"):
        assert box.run(command).returncode == 0
    assert installs(box.calls()) == []


def test_a_command_may_ask_twice_but_for_no_package_twice(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.apt()
    # An apt-get that brings nothing: the command goes on after it has asked for everything once.
    box.script("bin/apt-get", FAKE_APT.replace('rm -f "$BOX/lacks"', 'echo libegl1 >>"$BOX/lacks"'))
    box.run("list")
    box.calls()
    box.lacks(*OPENCL)
    result = box.run("run", "glass")
    assert (result.returncode, result.stdout) == (0, "<run><glass>")
    assert installs(box.calls()) == [" ".join(OPENCL), "libegl1"]


def test_without_apt_nobody_is_asked(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.apt()
    box.lacks(*OPENCL)
    result = box.run("run", VIFORM_NO_APT="1")
    assert (result.returncode, result.stdout) == (0, "<run>")
    assert installs(box.calls()) == []


def test_the_tests_take_another_environment_and_any_packages(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.apt()
    box.lacks("verilator", "g++", "iverilog")
    result = box.run("test", "-k", "house")
    assert result.stdout == "<test><-k><house>"
    assert result.stderr.splitlines()[1] == (
        "viform: installing system packages (some minutes where the network is slow): "
        "verilator g++ iverilog"
    )
    assert pips(box.calls())[0].endswith("requirements-dev.lock")


def test_a_user_with_sudo_installs_by_it(tmp_path):
    box = Box(tmp_path)
    box.python()
    box.touch("python3.lacks-venv")
    box.apt()
    box.sudo(allowed=True)
    assert box.run("run", "film").returncode == 0
    calls = [call for call in box.calls() if call.startswith("sudo")]
    assert calls[1] == "sudo -n apt-get update -q"
    assert calls[2].startswith("sudo -n apt-get -o DPkg::Lock::Timeout=600 install -y")


@pytest.mark.parametrize("sudo", ["absent", "refuses"])
def test_without_rights_it_prints_the_line_and_goes_on_if_it_can(tmp_path, sudo):
    box = Box(tmp_path)
    box.apt()
    bare = box.run("list", VIFORM_PYTHON="").stderr
    assert "run `sudo apt-get update && sudo apt-get install -y python3 python3-venv`" in bare
    box.touch("var/lib/apt/lists/mirror_Packages.lz4")
    if sudo == "refuses":
        box.sudo(allowed=False)
    line = "`sudo apt-get install -y python3 python3-venv`"
    without = box.run("run")
    assert without.returncode == 2
    assert without.stderr == (
        f"viform: Python must be 3.11, 3.12 or 3.13, not absent: run {line}, or name one in "
        "VIFORM_PYTHON\n"
    )

    box.python()
    box.touch("python3.lacks-venv")
    without = box.run("list")
    assert without.returncode == 2
    assert without.stderr == (
        f"viform: {box.bin}/python3 must have the venv module, which it does not: run `sudo "
        "apt-get install -y python3 python3-venv`, or name another Python 3.11, 3.12 or 3.13 in "
        "VIFORM_PYTHON\n"
    )

    (box.root / "python3.lacks-venv").unlink()
    box.lacks(*OPENCL)
    result = box.run("test")
    assert (result.returncode, result.stdout) == (0, "<test>")
    assert result.stderr.splitlines()[1:] == [
        f"viform: `test` needs {' '.join(OPENCL)}, which this user cannot install here: run `sudo "
        f"apt-get install -y {' '.join(OPENCL)}`"
    ]
    assert not [call for call in box.calls() if call.startswith("apt")]
    assert box.run("test", VIFORM_NO_APT="1").stderr == ""
    # These say so themselves, in one line.
    assert [box.run(command).stderr for command in ("run", "bench")] == ["", ""]


def test_a_failed_apt_shows_its_end(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.apt()
    box.touch("apt.fails")
    box.lacks(*OPENCL)
    result = box.run("run")
    assert (result.returncode, result.stdout) == (2, "")
    assert "E: no network\n" in result.stderr
    assert result.stderr.splitlines()[-1].startswith(
        "viform: apt-get must install pocl-opencl-icd ocl-icd-libopencl1 but failed"
    )
    assert box.run("run", VIFORM_NO_APT="1").stdout == "<run>"


def test_elsewhere_than_debian_the_packages_are_named(tmp_path):
    box = Box(tmp_path, uid=0)
    box.python()
    box.lacks(*OPENCL)
    result = box.run("test")
    assert result.stdout == "<test>"
    assert result.stderr.splitlines()[1] == (
        "viform: `test` needs pocl-opencl-icd ocl-icd-libopencl1, which this user cannot install "
        "here: install what Debian calls pocl-opencl-icd ocl-icd-libopencl1"
    )


def pins(name: str) -> dict[str, str]:
    """{package: version} of a lock; every line of it must be `package==version`."""
    lines = [line.split("#")[0].strip() for line in (ROOT / name).read_text().splitlines()]
    return dict(line.split("==") for line in lines if line)


def test_the_locks_agree_and_name_no_index():
    run, dev = pins("requirements.lock"), pins("requirements-dev.lock")
    assert run.items() <= dev.items()
    assert {"pytest", "hypothesis", "ruff", "mypy"} <= dev.keys() - run.keys()
    for name in ("requirements.lock", "requirements-dev.lock"):
        text = (ROOT / name).read_text()
        assert not re.search(r"://|^-|file:|@", text, re.MULTILINE)


def test_the_locks_hold_what_the_project_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for name, asked in (
        ("requirements.lock", project["dependencies"] + extras["build"]),
        ("requirements-dev.lock", project["dependencies"] + extras["build"] + extras["dev"]),
    ):
        held = pins(name)
        for requirement in asked:
            package = re.split(r"[<>=]", requirement)[0]
            assert package in held, f"{package} must be pinned in {name}: make the lock again"
            lowest = re.search(r">=([\d.]+)", requirement)
            below = re.search(r"<([\d.]+)", requirement)
            version = [int(part) for part in re.findall(r"\d+", held[package])]
            if lowest:
                assert version >= [int(part) for part in lowest[1].split(".")]
            if below:
                assert version < [int(part) for part in below[1].split(".")]


def test_the_launcher_and_the_project_name_the_same_pythons():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["requires-python"] == ">=3.11,<3.14"
    assert "(3, 11) <= sys.version_info[:2] < (3, 14)" in (ROOT / "viform").read_text()
    assert (3, 11) <= sys.version_info[:2] < (3, 14)


def test_an_environment_that_is_not_its_own_is_never_emptied(box):
    """One without pip cannot be used, whether a set-up was killed in it before or not."""
    box.python()
    box.script("mine/bin/python", "#!/bin/sh\nexit 1\n")
    box.touch("mine/pyvenv.cfg", "mine/notes.txt")
    for other in (
        "another", "one with viform.unfinished, the mark of an installation that did not end"
    ):  # fmt: skip
        done = box.run("list", VIFORM_VENV=str(box.root / "mine"))
        assert done.returncode == 2
        assert done.stderr == (
            f"viform: {box.root}/mine must be a new folder, one that viform made, or an "
            f"environment of Python 3.11, 3.12 or 3.13 with pip, not {other}: name another in "
            "VIFORM_VENV\n"
        )
        assert (box.root / "mine/notes.txt").exists() and (box.root / "mine/bin/python").exists()
        assert not made(box.calls())
        box.touch("mine/viform.unfinished")


def test_an_environment_whose_making_was_killed_is_its_own(box):
    box.python()
    assert box.run("list").returncode == 0
    assert (box.venv / "viform.place").read_text() == f"{box.venv}\n"
    (box.venv / "viform.unfinished").touch()
    for name in ("pyvenv.cfg", "viform-run.stamp"):
        (box.venv / name).unlink()
    box.calls()
    assert box.run("list").returncode == 0
    assert made(box.calls()) == 1
