"""What numba keeps of a function is not used where the function takes what has changed since."""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

from cosim.compute.numba_cache import taken
from cosim.report.png import for_display
from sensor.continuous.crossing import edge
from sensor.latched.reference.engine import expose

CALLER = """
from numba import njit
import viform_kept_constants as constants
from viform_kept_callee import added

@njit(cache=True)
def total(x):
    return added(x) + constants.MORE
"""
CALLEE = """
from numba import njit

@njit(cache=True)
def {name}(x):
    return x + {amount}
added = {name}
"""


@pytest.fixture
def total(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Reads the modules anew, whose callee and constant are given, and returns total(1)."""
    names = ("viform_kept_callee", "viform_kept_constants", "viform_kept_caller")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # sources of one second look alike to it
    (tmp_path / f"{names[2]}.py").write_text(CALLER)

    def run(amount: int, more: int) -> tuple[int, int]:
        """The result, and how often the caller was found on the disk."""
        (tmp_path / f"{names[0]}.py").write_text(CALLEE.format(name="plus", amount=amount))
        (tmp_path / f"{names[1]}.py").write_text(f"MORE = {more}\n")
        for name in names:
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        function = importlib.import_module(names[2]).total
        found = function(1)
        return found, sum(function.stats.cache_hits.values())

    yield run
    for name in names:
        sys.modules.pop(name, None)


def test_a_changed_callee_or_constant_is_compiled_anew(total: Any) -> None:
    assert total(10, 100) == (111, 0)
    assert total(10, 100) == (111, 1)
    assert total(20, 100) == (121, 0)
    assert total(20, 300) == (321, 0)
    assert total(10, 100) == (111, 1)


def test_an_index_with_a_type_of_a_module_that_has_moved_is_written_anew(total: Any) -> None:
    assert total(10, 100) == (111, 0)
    cache = sys.modules["viform_kept_caller"].total._cache._cache_file
    named = pickle.dumps(cache._version) + b"cviform_moved\nThing\n."
    Path(cache._index_path).write_bytes(named + hashlib.sha256(named).digest())
    assert total(10, 100) == (111, 0)
    assert total(10, 100) == (111, 1)


def test_what_a_function_takes_is_the_same_in_each_process() -> None:
    """No address and no order of a set is a part of it: what is kept would never be found."""
    code = (
        "from cosim.compute.numba_cache import taken\n"
        "from sensor.latched.reference.engine import expose\n"
        "print(taken(expose.py_func))"
    )
    other = os.environ | {"PYTHONHASHSEED": "7"}
    said = subprocess.run(
        [sys.executable, "-c", code], env=other, capture_output=True, encoding="utf-8", check=True
    )
    function: Any = expose
    assert said.stdout.strip() == taken(function.py_func)


def test_what_no_function_of_ours_needs_is_not_compiled() -> None:
    """No text of the two shapes, which takes seconds, and no form for C of our own functions; a
    user's own may be called from C."""

    def for_c(function: Any) -> int:
        made = function.get_compile_result(function.nopython_signatures[0])
        return int(made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name))

    @njit
    def put(target: Any, source: Any) -> None:
        target[:] = source

    with pytest.raises(ValueError, match=r"^cannot assign slice from input of different size$"):
        put(np.zeros(3), np.zeros(2))
    ours = njit(edge.py_func)
    ours(1, (0, 0, 0, 2, 1))
    assert for_c(put) and not for_c(ours)


def test_a_kept_function_is_used_without_what_only_the_compiler_needs() -> None:
    """Numba would import all that it can compile first, .3 s of each process. What is compiled
    after it has all of that."""
    for_display(np.zeros((2, 2)))  # kept from now on
    code = (
        "import sys\n"
        "import numpy as np\n"
        "from numba import njit\n"
        "from cosim.report.codes import look_up\n"
        "from cosim.report.png import for_display\n"
        "print(for_display(np.ones((1, 2))), sum(look_up.stats.cache_hits.values()))\n"
        "print('numba.np.linalg' in sys.modules, njit(lambda x: x[0] + x[1])((3, 4)))\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=True
    )
    assert said.stdout.split("\n")[:2] == ["[[255 255]] 1", "False 7"]
