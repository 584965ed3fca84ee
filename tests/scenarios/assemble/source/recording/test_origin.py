"""Bytes of a file that grows and of a pipe: waited for, held back, ended, and refused."""

import fcntl
import os
import struct
import sys
import termios
import threading

import numpy as np
import pytest

from cosim import InputError
from scenarios.assemble.source.recording.origin import GrowingFile, Pipe


class Time:
    """A clock that moves only while somebody sleeps; `at` has what happens then."""

    def __init__(self):
        self.now, self.at = 0.0, {}

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds
        for when in sorted(when for when in self.at if when <= self.now):
            self.at.pop(when)()


def appended(path, data):
    with path.open("ab") as file:
        file.write(data)


def test_a_file_is_followed_until_it_has_not_grown_for_its_time(tmp_path):
    path, time = tmp_path / "a.dat", Time()
    path.write_bytes(b"abc")
    time.at = {0.9: lambda: appended(path, b"de"), 1.8: lambda: appended(path, b"f")}
    file, got = GrowingFile(path, 1.0, time, time.sleep), b""
    while not file.end:
        got += file.fetch(2, 0.25)
    assert got == b"abcdef" and time.now == pytest.approx(2.8, abs=0.03)
    assert file.end == "it has not grown for 1 s"
    file.close()


def test_a_wait_for_a_file_ends_in_time(tmp_path):
    time, path = Time(), tmp_path / "a.dat"
    path.touch()
    file = GrowingFile(path, 60.0, time, time.sleep)
    assert file.fetch(5, 0.5) == b"" and time.now == pytest.approx(0.5)
    assert not file.end
    file.close()


def test_a_file_that_shrinks_is_refused(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(bytes(100))
    file = GrowingFile(path, 1.0)
    file.fetch(60, 0.0)
    os.truncate(path, 70)
    assert len(file.fetch(60, 0.0)) == 10
    os.truncate(path, 50)
    with pytest.raises(InputError) as caught:
        file.fetch(1, 0.0)
    assert str(caught.value) == (
        f"sensor.source must be a file that only grows, not {path}, which shrank to 50 bytes after "
        "70 were read; let its writer append, and start again with another --out"
    )
    with pytest.raises(InputError, match=r"of at least 70 bytes, not .* has 50; start again"):
        file.skip(70)
    file.close()


def followed(path, time, change):
    """Reads a file of 1 000 bytes, changes it after 0.5 s, and reads on; what was read."""
    path.write_bytes(bytes(range(250)) * 4)
    time.at = {0.5: change}
    file, got = GrowingFile(path, 1.0, time, time.sleep), b""
    try:
        while not file.end:
            got += file.fetch(100, 0.25)
    finally:
        file.close()
    return got, file.end


@pytest.mark.parametrize("appends", [0, 1, 500])
@pytest.mark.parametrize("kept", [False, True], ids=["truncated first", "overwritten"])
def test_a_file_that_is_written_anew_in_its_place_is_refused(tmp_path, kept, appends):
    """It has the same inode, and is never seen shorter than what was read."""
    path = tmp_path / "a.dat"

    def anew():
        with path.open("r+b" if kept else "wb") as file:
            file.write(bytes(range(249, -1, -1)) * 4 + bytes(appends))

    with pytest.raises(InputError) as caught:
        followed(path, Time(), anew)
    assert str(caught.value) == (
        f"sensor.source must be a file that only grows, not {path}, which was written anew after "
        "1000 bytes were read; let its writer append, and start again with another --out"
    )


def test_a_file_that_another_replaces_is_refused_after_its_end(tmp_path):
    path, other = tmp_path / "a.dat", tmp_path / "b.dat"

    def replaced():
        appended(path, b"end")
        other.write_bytes(bytes(5000))
        other.rename(path)

    with pytest.raises(InputError, match="was replaced by another file after 1003 bytes were read"):
        followed(path, Time(), replaced)


def test_a_file_that_is_moved_away_or_deleted_is_read_to_its_end(tmp_path):
    path, time = tmp_path / "a.dat", Time()

    def moved():
        path.rename(tmp_path / "b.dat")
        time.at[1.0] = lambda: appended(tmp_path / "b.dat", b"more")  # its writer goes on

    got, end = followed(path, time, moved)
    assert len(got) == 1004 and end == "it has not grown for 1 s, and it was moved away"
    got, end = followed(path, Time(), path.unlink)
    assert len(got) == 1000 and end == "it has not grown for 1 s, and it was deleted"


def test_samples_of_a_long_file_are_few_and_spread(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(np.random.default_rng(1).bytes(100_000))
    file = GrowingFile(path, 1.0)
    while file.fetch(97, 0.0):
        pass
    places = [at for at, _ in file._samples]
    assert 32 <= len(places) <= 65
    assert max(np.diff([0, *places, 100_000])) < 10_000
    file.close()


def test_a_pipe_gives_what_comes_and_ends_with_its_writer(tmp_path):
    os.mkfifo(tmp_path / "p")
    pipe = Pipe(str(tmp_path / "p"))
    assert pipe.fetch(4, 0.0) == b"" and not pipe.end  # nobody writes yet
    writer = os.open(tmp_path / "p", os.O_WRONLY)
    assert pipe.fetch(4, 0.0) == b"" and not pipe.end
    os.write(writer, b"abcdef")
    assert pipe.fetch(4, 1.0) == b"abcd"
    os.close(writer)
    assert pipe.fetch(4, 1.0) == b"ef" and not pipe.end
    assert pipe.fetch(4, 1.0) == b"" and pipe.end == "its writer has closed it"
    pipe.close()


def test_a_faster_writer_is_held_back_by_the_pipe(tmp_path):
    """What nobody has asked for stays in the pipe, until it takes no more."""
    os.mkfifo(tmp_path / "p")
    pipe = Pipe(str(tmp_path / "p"))
    writer, stopped = os.open(tmp_path / "p", os.O_WRONLY), threading.Event()
    room = fcntl.fcntl(writer, fcntl.F_GETPIPE_SZ)

    def write():
        os.write(writer, bytes(2 * room))  # returns when all is in the pipe
        stopped.set()

    thread = threading.Thread(target=write)
    thread.start()
    assert len(pipe.fetch(1000, 10.0)) == 1000
    assert not stopped.is_set()
    taken = 1000
    while taken < 2 * room:
        taken += len(pipe.fetch(2 * room - taken, 10.0))
    thread.join()
    os.close(writer)
    left = struct.unpack("i", fcntl.ioctl(pipe._file, termios.FIONREAD, bytes(4)))
    assert stopped.is_set() and left == (0,)
    pipe.close()


def test_a_silent_pipe_ends_after_its_time(tmp_path):
    time = Time()
    os.mkfifo(tmp_path / "p")
    pipe = Pipe(str(tmp_path / "p"), 1.0, time)
    assert pipe.fetch(4, 0.0) == b"" and not pipe.end
    time.now = 1.0
    assert pipe.fetch(4, 0.0) == b"" and pipe.end == "nothing has come for 1 s"
    pipe.close()


@pytest.mark.parametrize(
    ("make", "file", "pipe"),
    [
        (lambda path: None,
         "a file that exists, not {0}; check the path",
         "a pipe that exists, not {0}; make it: mkfifo {0}"),
        (os.mkdir,
         "a file that grows, with sensor.source_timeout, not {0}, a folder; name a file",
         "a named pipe, not {0}, a folder; name a pipe made with mkfifo"),
        (lambda path: path.touch(), None, "a named pipe, not {0}, no pipe; write file:{0}"),
        (os.mkfifo,
         "a file that grows, with sensor.source_timeout, not {0}, no regular file; write pipe:{0}",
         None),
    ],
)  # fmt: skip
def test_another_kind_of_source_is_one_line(make, file, pipe, tmp_path):
    place = tmp_path / "x"
    make(place)
    opened = ((file, lambda: GrowingFile(place, 1.0)), (pipe, lambda: Pipe(str(place))))
    for says, call in opened:
        if says is None:
            call().close()
            continue
        with pytest.raises(InputError) as caught:
            call()
        assert str(caught.value) == f"sensor.source must be {says.format(place)}"


def test_a_terminal_is_no_stream(monkeypatch):
    master, slave = os.openpty()
    with open(slave, "rb", buffering=0) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with pytest.raises(InputError) as caught:
            Pipe("-")
        assert str(caught.value) == (
            "standard input must be a pipe or a file, not a terminal; send planes to it: "
            "cat x.dat | viform run ..."
        )
        with pytest.raises(InputError, match=r"a named pipe, not .*, a terminal; name a"):
            Pipe(os.ttyname(slave))
    os.close(master)
    with pytest.raises(InputError, match="standard input must be open, not closed"):
        Pipe("-")  # the terminal of the test
