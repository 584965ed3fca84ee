"""The house and its rules: who may import whom, where GL, serial and OpenCL live, file habits.

The rules are read off the syntax trees, so an import inside a function counts as well.
"""

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# package -> those of ours that it may import, besides itself
MAY_IMPORT = {
    "cosim": set(),
    "sensor": {"cosim"},
    "display": {"cosim"},
    "rtl_model": {"cosim", "sensor"},
    "imagers": {"cosim", "sensor", "rtl_model"},
    "link": {"cosim", "sensor", "display"},
    "scenarios": {"cosim", "sensor", "display", "rtl_model", "imagers", "link"},
}

# outside library -> the only package that may import it
ONLY_IN = {
    "moderngl": "display",
    "glcontext": "display",
    "OpenGL": "display",
    "serial": "rtl_model",
    "pyopencl": "cosim",
}

HOME_OF_FIGURES = "cosim/report/figures.py"
"""The one file that makes figures: others would follow the settings of a user for his own."""
OTHER_OPENERS = ("os", "av", "webbrowser", "self._zip")
"""What has a function `open` that opens no text."""
FIGURE_MAKERS = ("matplotlib.figure", "matplotlib.backends", "matplotlib.pyplot", "pylab")

# package -> its rooms from the ground up; a room imports itself and those before it. A name stands
# for a folder or a file of the package; rooms in one string stand side by side.
ROOMS = {
    "cosim": (
        "clock errors", "stage frames config", "compute light spikes", "archive", "files plan",
        "run", "report",
    ),
    "sensor": (
        "device reconstruct frame_pixels", "circuit", "latched", "sections dynamic_range",
        "asynchronous continuous", "codec", "stability laboratory", "calibrate",
    ),
    "display": (
        "drives", "panels", "observe", "effects quality references render", "probes setting window",
        "core section plan", "camera", "chain stability", "report",
    ),
    "rtl_model": (
        "geometry prbs", "registers", "cycle readout", "verilated",
        "lockstep synthesis events", "host stream", "virtual", "bringup gateware stand_in",
    ),
    "imagers": (
        "common", "run", "report", "adaptive ebaps emccd hardware_chain pulse", "catalogue",
        "machine document stability",
    ),
    "link": (
        "line_codes timing verdict", "mode", "layout", "coding detect", "receiving sending theory",
        "section", "air stability", "setting", "prediction", "setup", "plan", "evaluation",
        "core report", "machine",
    ),
    "scenarios": ("scenes report", "assemble", "run", "python", "studies view", "cli"),
}  # fmt: skip

LOOSE = {"scenarios": {"__init__.py", "run.py"}}
"""Files that may stand in a package outside its rooms, where that is limited."""

KINDS = {"Scenario", "LinkScenario", "ImagerScenario", "BoardScenario", "RecordingScenario"}
"""Classes of scenarios; only `scenarios/assemble` asks which one it has."""

MAX_LINES = 400

# How the description of a value does not begin: it says what the value is, so a noun comes first.
NAMELESS = re.compile(
    r"(of|by|that|as|in|from|for|with|at|on|to|those|which|where|when|whether one|before|after"
    r"|between|below|across|about|around|against|without|they|since)\b(?! most\b)",
    re.IGNORECASE,
)
DESCRIBED = re.compile(r"\*{0,2}\w+(?:, \*{0,2}\w+)*(?: \([^)]*\))?: (.*)")
"""A value in a docstring: its names, and the first line of its description."""

# A text file that ships must not know the machine it was written on, nor a package index.
MACHINE = re.compile(
    r"(?<![\w.])/(?:work|root|opt/(?:wheels|pypi))/"
    r"|pypi\.org|--(?:extra-)?index-url|--find-links|--trusted-host"
)


def imported(tree: ast.AST, package: list[str]) -> Iterator[tuple[int, str]]:
    """Yields (line, absolute dotted name) of everything that a module of `package` imports.

    `package` is the dotted name, split, of the package that holds the module; relative imports
    count from it. `from a import b` yields `a.b`, since b may be a module. Of dynamic imports the
    literal ones are seen.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join(start + ([node.module] if node.module else []))
            for alias in node.names:
                yield node.lineno, f"{base}.{alias.name}" if base else alias.name
        elif isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            first = node.args[0]
            if (
                name in {"import_module", "__import__"}
                and isinstance(first, ast.Constant)
                and isinstance(first.value, str)
            ):
                yield node.lineno, first.value.lstrip(".")


def broken_rules(root: Path) -> list[str]:
    """One line for each place in the packages under `root` that breaks the house."""
    found = []
    for package, allowed in MAY_IMPORT.items():
        for path in sorted((root / package).rglob("*.py")):
            place = path.relative_to(root)
            text = path.read_text(encoding="utf-8")
            tree = ast.parse(text, filename=str(place))
            lines = text.count("\n")
            if ast.get_docstring(tree) is None:
                found.append(f"{place}:1: must open with a docstring")
            if lines >= MAX_LINES:
                found.append(f"{place}:{lines}: must be under {MAX_LINES} lines: one idea a file")
            if path.name == "__init__.py":
                found += [f"{place}:{line}: {what}" for line, what in undeclared(tree)]
            else:
                found += [f"{place}:{line}: {what}" for line, what in listed(tree, place)]
            found += [f"{place}:{line}: {what}" for line, what in loose_words(tree, place)]
            for line, name in imported(tree, list(place.parent.parts)):
                top, *rest = name.split(".")
                if top in MAY_IMPORT and top != package:
                    if top not in allowed:
                        found.append(f"{place}:{line}: {package} must not import {top}")
                    if any(part.startswith("_") for part in rest):
                        found.append(f"{place}:{line}: {name} is private to {top}")
                if top == "tests":
                    found.append(f"{place}:{line}: {package} must not import the tests")
                if ONLY_IN.get(top, package) != package:
                    found.append(f"{place}:{line}: only {ONLY_IN[top]} may import {top}")
                if name.startswith(FIGURE_MAKERS) and str(place) != HOME_OF_FIGURES:
                    found.append(f"{place}:{line}: only {HOME_OF_FIGURES} makes figures")
            for line, name in texts(tree):
                found.append(f"{place}:{line}: {name} must name its encoding")
    return found


def listed(tree: ast.Module, place: Path) -> Iterator[tuple[int, str]]:
    """Yields (line, message) for the `__all__` of a module: a package alone lists its names."""
    for node in tree.body:
        targets = getattr(node, "targets", None) or [getattr(node, "target", node)]
        if any(isinstance(target, ast.Name) and target.id == "__all__" for target in targets):
            yield node.lineno, "only an __init__.py has an __all__"


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yields (line, call) of each file or process that is read or written as text in the encoding
    of the user's locale."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        module = ast.unparse(node.func.value) if isinstance(node.func, ast.Attribute) else ""
        named = {word.arg: word.value for word in node.keywords}
        if "encoding" in named or None in named:
            continue
        if name in ("read_text", "write_text"):
            text = len(node.args) < 1 + (name == "write_text")
        elif name == "fdopen" or (name == "open" and module not in OTHER_OPENERS):
            values = [
                n.value for n in [*node.args, named.get("mode")] if isinstance(n, ast.Constant)
            ]
            modes = [v for v in values if isinstance(v, str) and re.fullmatch("[rwaxbt+]{1,3}", v)]
            # Without a mode, what has a method `open` may be a port, or a member of an archive.
            text = not any("b" in mode for mode in modes) and bool(
                modes or module in ("", "io") or name == "fdopen"
            )
        elif name in ("NamedTemporaryFile", "TemporaryFile", "SpooledTemporaryFile"):
            mode = named.get("mode", node.args[0] if node.args else None)
            text = mode is not None and "b" not in ast.unparse(mode)
        else:
            text = name in ("TextIOWrapper", "popen", "getoutput", "getstatusoutput")
            text |= bool({"text", "universal_newlines"} & named.keys()) and name in (
                "run", "Popen", "check_output", "check_call", "call",
            )  # fmt: skip
        if text:
            yield node.lineno, name


def text_of(node: ast.AST) -> ast.Constant | None:
    """The text of a statement that is a text alone, as a docstring is."""
    value = node.value if isinstance(node, ast.Expr) else None
    return value if isinstance(value, ast.Constant) and isinstance(value.value, str) else None


def described(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yields (line, begin of the description) of each value that a docstring, the text after an
    assignment, a key or an option describes."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        body = body if isinstance(body, list) else []
        for before, after in zip([node, *body], body, strict=False):
            text = text_of(after)
            if text is None:
                continue
            if isinstance(before, ast.Assign | ast.AnnAssign):
                yield text.lineno, text.value
            elif before is node:
                block, items = "", ""  # the heading, and the indentation of its items
                for n, line in enumerate(text.value.split("\n")):
                    indent, said = re.match(r"( *)(.*)", line).groups()
                    item = re.match(DESCRIBED, said)
                    if said in ("Attributes:", "Args:"):
                        block, items = f"{indent} ", ""
                    elif not indent.startswith(block):
                        block = "" if said else block
                    elif block and item and indent == (items or indent):
                        items = indent
                        yield text.lineno + n, item[1]
        for word in node.keywords if isinstance(node, ast.Call) else ():
            if word.arg in ("description", "help") and isinstance(word.value, ast.Constant):
                yield word.value.lineno, str(word.value.value)


def loose_words(tree: ast.Module, place: Path) -> Iterator[tuple[int, str]]:
    """Yields (line, message) for descriptions of values without a noun at their beginning, and for
    docstrings that begin with "Returns"."""
    for line, text in described(tree):
        if word := NAMELESS.match(text):
            yield line, f"a description must begin with its noun, not with {word[0]}"
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        text = text_of(body[0]) if isinstance(body, list) and body else None
        if text is not None and text.value.startswith("Returns "):
            yield text.lineno, "a docstring must say what the function gives, without Returns"


def modules(root: Path) -> dict[str, Path]:
    """Dotted name -> file of every module of the packages; a package's is its __init__."""
    found = {}
    for package in MAY_IMPORT:
        for path in sorted((root / package).rglob("*.py")):
            name = ".".join(path.relative_to(root).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


def is_of_types(node: ast.AST) -> bool:
    """Whether a statement is read by type checkers only."""
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def statements(node: ast.AST) -> Iterator[ast.stmt]:
    """All statements inside a node. A walk through their expressions as well takes ten times as
    long."""
    for name in ("body", "orelse", "finalbody", "handlers", "cases"):
        for inner in getattr(node, name, ()):
            yield inner
            yield from statements(inner)


def uses(root: Path) -> dict[str, set[tuple[str, str | None]]]:
    """Module -> (module, name or None) of ours that it imports when it runs."""
    known = modules(root)
    found: dict[str, set[tuple[str, str | None]]] = {}
    for module, path in known.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        typing = {id(inner) for n in statements(tree) if is_of_types(n) for inner in statements(n)}
        found[module] = set()
        for node in statements(tree):
            if id(node) in typing:
                continue
            if isinstance(node, ast.ImportFrom) and node.module in known:
                for alias in node.names:
                    whole = f"{node.module}.{alias.name}"
                    pair = (whole, None) if whole in known else (node.module, alias.name)
                    found[module].add(pair)
            elif isinstance(node, ast.Import):
                found[module] |= {(a.name, None) for a in node.names if a.name in known}
    return found


def circles(edges: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected components of more than one node (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(edges.get(node, ())):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            at = stack.index(node)
            component, stack[at:] = stack[at:], []
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(edges):
        if node not in index:
            visit(node)
    return found


def rooms_of(edges: dict[str, set[str]], depth: int) -> dict[str, set[str]]:
    """What imports what among the folders and files that stand in the same folder, `depth` names
    deep. The `__init__` of a folder is no part of its own rooms."""
    found: dict[str, set[str]] = {}
    for module, others in edges.items():
        *folder, room = module.split(".")[:depth]
        if len(folder) == depth - 1:
            here = found.setdefault(".".join([*folder, room]), set())
            for other in others:
                there = other.split(".")[:depth]
                if len(there) == depth and there[:-1] == folder and there[-1] != room:
                    here.add(".".join(there))
    return found


def crooked_rooms(root: Path) -> list[str]:
    """One line for each import that runs against the order of rooms, and each circle."""
    edges = uses(root)
    found = []
    for package, order in ROOMS.items():
        floor = {room: n for n, rooms in enumerate(order) for room in rooms.split()}
        for module, others in edges.items():
            if module.split(".")[0] != package or module == package:
                continue
            here = module.split(".")[1]
            if here not in floor:
                found.append(f"{module}: {here} must stand in ROOMS")
                continue
            for other, _ in sorted(others, key=str):
                there = other.split(".")[1] if other.startswith(f"{package}.") else None
                if there not in (None, here) and floor.get(there, 99) >= floor[here]:
                    found.append(f"{module}: {package}/{here} must not import {package}/{there}")
    plain = {m: {o for o, _ in others} - {m} for m, others in edges.items()}
    found += [f"{' '.join(circle)}: must not import in a circle" for circle in circles(plain)]
    for depth in range(2, 1 + max(module.count(".") + 1 for module in plain)):
        found += [
            f"{' '.join(circle)}: rooms must not import in a circle"
            for circle in circles(rooms_of(plain, depth))
        ]
    return found


def idle_exports(root: Path) -> list[str]:
    """Names in an `__init__` that nothing outside its folder imports from it."""
    known = modules(root)
    used = set()
    for path in (*known.values(), *root.glob("viform.py"), *root.glob("viform-stubs/*.pyi")):
        for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
            home = known.get(getattr(node, "module", None) or "", root / "no/__init__.py")
            if isinstance(node, ast.ImportFrom) and home.parent not in path.parents:
                used |= {(node.module, alias.name) for alias in node.names}
    found = []
    for package, path in known.items():
        if path.name != "__init__.py" or package == "scenarios.cli":  # the program's entry point
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                names = ast.literal_eval(node.value)
                found += [
                    f"{package}: nothing outside imports {name}"
                    for name in names if (package, name) not in used
                ]  # fmt: skip
    return found


def asked_kinds(root: Path) -> list[str]:
    """One line for each test of a scenario's kind outside `scenarios/assemble`."""
    found = []
    for module, path in modules(root).items():
        text = path.read_text(encoding="utf-8")
        if module.startswith("scenarios.assemble") or not any(kind in text for kind in KINDS):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
                names = {n.id for n in ast.walk(node.args[1]) if isinstance(n, ast.Name)}
                if names & KINDS:
                    found.append(f"{module}:{node.lineno}: asks of what kind a scenario is")
    return found


def undeclared(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yields (line, message) for public names of an `__init__` that stand outside its `__all__`."""
    public: dict[str, int] = {}
    declared: set[str] | None = None
    for node in tree.body:
        names: list[str] = []
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [(alias.asname or alias.name).split(".")[0] for alias in node.names]
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names = [node.name]
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
            if "__all__" in names and node.value is not None:
                declared = set(ast.literal_eval(node.value))
        public |= {name: node.lineno for name in names if not name.startswith("_")}
    for name in sorted(public.keys() - (declared or set())):
        yield public[name], f"{name} must stand in __all__ or begin with an underscore"
    for name in sorted((declared or set()) - public.keys() - {"__version__"}):
        yield 1, f"__all__ names {name}, which is not here"


def git(root: Path, *words: str) -> str:
    """What git says of a clone; skips the test where there is none."""
    # git refuses a clone that another user owns, which a container often runs in.
    command = ["git", "-c", f"safe.directory={root}", "-C", str(root), *words]
    try:
        return subprocess.run(command, capture_output=True, check=True, text=True).stdout
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("needs git and a clone to know which files are ours")


def tracked(root: Path) -> list[Path]:
    """Files git tracks or would add; skips the test where there is no clone."""
    listed = git(root, "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    return [root / name for name in listed.split("\0") if name and (root / name).is_file()]


def machine_words(path: Path) -> list[str]:
    """What a text file says of the machine it was made on; of a binary file, nothing."""
    data = path.read_bytes()
    if b"\0" in data:
        return []
    return MACHINE.findall(data.decode("utf-8", errors="replace"))


def write_house(root: Path, **files: str) -> None:
    """Writes a clean tree of all packages, then `files`: package__module='source' over it."""
    for package in MAY_IMPORT:
        (root / package).mkdir()
        (root / package / "__init__.py").write_text('"""A part."""\n')
    for name, text in files.items():
        place = root / (name.replace("__", "/", 1) + ".py")
        place.write_text(text)


def test_the_house_holds():
    assert broken_rules(ROOT) == []


def test_no_test_lists_its_names():
    assert not [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        if "__all__" in (text := path.read_text(encoding="utf-8"))
        for line, _ in listed(ast.parse(text), path.relative_to(ROOT))
    ]


def test_rooms_import_one_way_and_nothing_imports_in_a_circle():
    assert crooked_rooms(ROOT) == []


def test_commands_print_numbers_in_the_style_of_the_house():
    """A precision with g would print a count of 1e6 as "1e+06"."""
    loose = [
        f"{path.relative_to(ROOT)}:{node.lineno} {node.value}"
        for path in sorted((ROOT / "scenarios" / "cli").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        and re.search(r"(^|:)[<>^+ 0-9]*\.[0-9]+g(}|$)", node.value)
    ]  # fmt: skip
    assert not loose, "take cosim.config.amounts"


def test_every_compiled_function_releases_the_interpreter():
    """The thread that ends a command after a signal runs Python: `cosim/compute/stopping.py`."""
    deaf = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in modules(ROOT).values()
        if "njit" in (text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "njit"
        and not any(given.arg == "nogil" for given in node.keywords)
    ]  # fmt: skip
    assert not deaf, "write nogil=True"


def test_no_file_stands_loose():
    for package, allowed in LOOSE.items():
        assert {path.name for path in (ROOT / package).glob("*.py")} == allowed


def test_every_exported_name_is_imported():
    assert idle_exports(ROOT) == []


def test_only_the_assembly_asks_for_the_kind_of_a_scenario():
    assert asked_kinds(ROOT) == []


def test_a_planted_circle_export_or_question_is_found(tmp_path):
    write_house(
        tmp_path,
        cosim__clock='"""A module."""\nfrom cosim.errors import E\n',
        cosim__errors='"""A module."""\nfrom cosim.clock import C\n',
        cosim__frames='"""A module."""\nfrom cosim import C\n',
        cosim____init__='"""A part."""\nfrom cosim.clock import C\n\n__all__ = ["C"]\n',
        scenarios__run='"""A module."""\nif isinstance(x, (int, LinkScenario)):\n    pass\n',
    )
    assert crooked_rooms(tmp_path) == [
        "cosim.clock: cosim/clock must not import cosim/errors",
        "cosim.errors: cosim/errors must not import cosim/clock",
        "cosim.clock cosim.errors: must not import in a circle",
        "cosim.clock cosim.errors: rooms must not import in a circle",
    ]
    assert idle_exports(tmp_path) == ["cosim: nothing outside imports C"]
    assert asked_kinds(tmp_path) == ["scenarios.run:2: asks of what kind a scenario is"]


def test_a_circle_of_deep_rooms_is_found_also_through_an_import_inside_a_function(tmp_path):
    write_house(tmp_path)
    said = {
        "assemble/__init__": "",
        "assemble/behind/a": "from scenarios.assemble.source.b import X\n",
        "assemble/source/b": "X = 1\n",
        "assemble/source/c": "def f():\n    from scenarios.assemble.behind.d import X\n",
        "assemble/behind/d": "X = 1\n",
    }
    for name, text in said.items():
        place = tmp_path / "scenarios" / f"{name}.py"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(f'"""A module."""\n{text}')
    assert crooked_rooms(tmp_path) == [
        "scenarios.assemble.behind scenarios.assemble.source: rooms must not import in a circle"
    ]


def test_every_package_of_the_table_is_here_and_ships():
    pyproject = (ROOT / "pyproject.toml").read_text()
    for package in MAY_IMPORT:
        assert (ROOT / package / "__init__.py").is_file()
        assert pyproject.count(f'"{package}"') >= 3, f"{package} in wheel, sdist and mypy"


def test_no_file_knows_the_machine_it_was_written_on():
    mine = Path(__file__).resolve()  # holds the patterns
    said = {str(path): machine_words(path) for path in tracked(ROOT) if path != mine}
    assert {path: words for path, words in said.items() if words} == {}


def test_a_clone_has_the_bytes_of_the_repository(tmp_path):
    """Also one that turns the ends of lines into those of Windows, as a user's git may."""
    for name in ("true", "false"):
        words = ("-c", f"core.autocrlf={name}", "-c", "core.eol=native")
        git(ROOT, *words, "checkout-index", "--all", f"--prefix={tmp_path}/{name}/")
    files = [path for path in (tmp_path / "false").rglob("*") if path.is_file()]
    assert len(files) > 1000
    for path in files:
        other = tmp_path / "true" / path.relative_to(tmp_path / "false")
        assert other.read_bytes() == path.read_bytes(), path.relative_to(tmp_path / "false")


@pytest.mark.parametrize(
    ("place", "source", "says"),
    [
        ("cosim__a", "import sensor", "cosim/a.py:2: cosim must not import sensor"),
        ("cosim__a", "from sensor.chip import Chip", "cosim must not import sensor"),
        ("cosim__a", "def f():\n    import link", "cosim/a.py:3: cosim must not import link"),
        ("cosim__a", "import importlib\nimportlib.import_module('link')", "not import link"),
        ("cosim__a", "if False:\n    __import__('display.panel')", "not import display"),
        ("sensor__a", "import display", "sensor must not import display"),
        ("display__a", "import sensor", "display must not import sensor"),
        ("rtl_model__a", "import display", "rtl_model must not import display"),
        ("rtl_model__a", "import imagers", "rtl_model must not import imagers"),
        ("imagers__a", "import display", "imagers must not import display"),
        ("link__a", "import rtl_model", "link must not import rtl_model"),
        ("link__a", "import scenarios", "link must not import scenarios"),
        ("sensor__a", "from cosim._clock import edge", "cosim._clock.edge is private to cosim"),
        ("sensor__a", "from cosim import _clock", "cosim._clock is private to cosim"),
        ("sensor__a", "import moderngl", "only display may import moderngl"),
        ("scenarios__a", "import serial.tools", "only rtl_model may import serial"),
        ("sensor__a", "import pyopencl as cl", "only cosim may import pyopencl"),
        ("sensor__a", "from matplotlib.figure import Figure", "only cosim/report/figures.py makes"),
        ("sensor__a", "import matplotlib.pyplot as plt", "only cosim/report/figures.py makes"),
        ("sensor__a", "path.read_text()", "read_text must name its encoding"),
        ("sensor__a", "path.write_text(words)", "write_text must name its encoding"),
        ("sensor__a", "open(path)", "open must name its encoding"),
        ("sensor__a", "open(path, 'a')", "open must name its encoding"),
        ("sensor__a", "path.open('w')", "open must name its encoding"),
        ("sensor__a", "os.fdopen(4, mode='w')", "fdopen must name its encoding"),
        ("sensor__a", "gzip.open(path, 'rt')", "open must name its encoding"),
        ("sensor__a", "NamedTemporaryFile('w')", "NamedTemporaryFile must name its encoding"),
        ("sensor__a", "TextIOWrapper(raw)", "TextIOWrapper must name its encoding"),
        ("sensor__a", "subprocess.run(words, text=True)", "run must name its encoding"),
        ("sensor__a", "from tests import helpers", "sensor must not import the tests"),
        (
            "sensor__a",
            'def f():\n    """Gives x.\n\n    Args:\n        a, b (int): of x.\n    """',
            "sensor/a.py:6: a description must begin with its noun, not with of",
        ),
        ("sensor__a", 'X = 3\n"""By name."""', "begin with its noun, not with By"),
        ("sensor__a", 'x: int = Field(description="that is left")', "its noun, not with that"),
        ("sensor__a", 'def f():\n    """Returns x."""', "sensor/a.py:3: a docstring must say what"),
        ("sensor__a", "__all__ = ['f']", "sensor/a.py:2: only an __init__.py has an __all__"),
        ("sensor__a", "x = 1\n" * 398, "sensor/a.py:400: must be under 400 lines"),
    ],
)
def test_a_planted_violation_is_found(tmp_path, place, source, says):
    write_house(tmp_path, **{place: f'"""A module."""\n{source}\n'})
    found = broken_rules(tmp_path)
    assert len(found) == 1
    assert says in found[0]


def test_a_missing_docstring_is_found(tmp_path):
    write_house(tmp_path, sensor__a="x = 1\n")
    assert broken_rules(tmp_path) == ["sensor/a.py:1: must open with a docstring"]


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("from .chip import Chip", "Chip must stand in __all__"),
        ("from .chip import Chip\n__all__ = []", "Chip must stand in __all__"),
        ("from .chip import Chip\n__all__ = ['Chip', 'Pixel']", "__all__ names Pixel"),
        ("def f(): ...", "f must stand in __all__"),
        ("LIMIT: int = 3", "LIMIT must stand in __all__"),
    ],
)
def test_a_public_name_outside_all_is_found(tmp_path, source, says):
    write_house(tmp_path, sensor____init__=f'"""A part."""\n{source}\n')
    found = broken_rules(tmp_path)
    assert len(found) == 1
    assert says in found[0]


def test_what_is_allowed_passes(tmp_path):
    write_house(
        tmp_path,
        sensor____init__='"""A part."""\nfrom ._a import f\n\n__all__ = ["f"]\n_limit = 3\n',
        sensor___a='"""A module."""\nfrom cosim import clock\nfrom . import _b\nimport numpy\n',
        sensor___b='"""Own private names and relative imports are our own affair."""\n',
        link__a='"""A module."""\nimport cosim, sensor.chip, display\n',
        display__a='"""A module."""\ndef f():\n    import moderngl\n',
        display__b='"""A module."""\nopen(path, "rb")\npath.open("wb")\narchive.open(name)\n'
        'path.read_text(encoding="ascii")\nos.open(path, os.O_RDONLY)\nline.replace(text="")\n',
        scenarios__a='"""A module."""\nimport cosim, sensor, display, rtl_model, imagers, link\n',
    )
    assert broken_rules(tmp_path) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("see /work/shared/design.md", ["/work/"]),
        ("cache = '/root/.cache'", ["/root/"]),
        ("--find-links /opt/wheels/x", ["--find-links", "/opt/wheels/"]),
        ("numpy @ https://pypi.org/simple", ["pypi.org"]),
        ("its/work/is at docs/root/a, /usr/bin and /etc/OpenCL/vendors", []),
    ],
)
def test_a_machine_path_is_found(tmp_path, text, words):
    path = tmp_path / "a.md"
    path.write_text(text)
    assert machine_words(path) == words
