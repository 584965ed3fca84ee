"""Memory of a process that reads a file."""

from __future__ import annotations

import subprocess
import sys

_CODE = """
import re, resource, sys
from pathlib import Path
from cosim import InputError
{setup}
def size(key):
    found = re.search(key + r":\\s+(\\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) * 1024
before = size("VmRSS")
resource.setrlimit(resource.RLIMIT_AS, (size("VmSize") + {most}, resource.RLIM_INFINITY))
try:
    {read}
    said = "read"
except InputError as exc:
    said = str(exc)
print(size("VmHWM") - before)
print(said)
"""


def reading(setup: str, read: str, most: int) -> tuple[str, int]:
    """What a process says that executes a statement: "read", or the refusal; and the bytes of
    memory that it took at most.

    Args:
        setup: imports, before memory counts.
        read: the statement.
        most: bytes of address space that the process may take.
    """
    code = _CODE.format(setup=setup, read=read, most=most)
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    took, said = child.stdout.splitlines()
    return said, int(took)
