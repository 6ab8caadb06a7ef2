"""What importing does not do, and which layer may know which."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import warp_caustics as wc

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "warp_caustics"
KERNELS = ROOT / "kernels"

# What the device code may import besides its own files: Warp, and what shapes a factory of kernels.
KERNEL_IMPORTS = {"__future__", "collections", "dataclasses", "enum", "functools", "math", "typing", "warp"}
# Slow to import, or with effects of their own: used inside functions alone.
HEAVY = {"OpenEXR", "matplotlib", "PIL", "pyvista", "rasterio", "vtk", "vtkmodules", "xarray"}
# The outermost layer, which nothing else of the package may know.
VIEWS = {f"warp_caustics.view{part}" for part in ("", "_compare", "_live", "_meshes")}
OUTER = {"warp_caustics.__main__", "warp_caustics.cli", *VIEWS}


def _module(path: Path) -> str:
    """Name of the module of a file of the package, or of its device code."""
    root, package = (KERNELS, "warp_caustics.kernels") if path.is_relative_to(KERNELS) else (PACKAGE, "warp_caustics")
    return ".".join([package, *path.relative_to(root).with_suffix("").parts]).removesuffix(".__init__")


FILES = sorted(PACKAGE.rglob("*.py"))
KERNEL_FILES = sorted(KERNELS.rglob("*.py"))
MODULES = [_module(path) for path in (*FILES, *KERNEL_FILES)]

# Runs in a fresh process: what is loaded and which settings change, by an import of the package and of all its modules.
PROBE = """
import importlib, json, locale, logging, os, random, signal, sys, warnings
import numpy as np
import warp as wp

def settings():
    return {
        "environment": dict(os.environ),
        "errstate": np.geterr(),
        "filters": [str(entry) for entry in warnings.filters],
        "handlers": [str(handler) for handler in logging.root.handlers],
        "hooks": [str(sys.excepthook), str(signal.getsignal(signal.SIGINT))],
        "level": logging.root.level,
        "locale": locale.setlocale(locale.LC_ALL),
        "printing": str(np.get_printoptions()),
        "random": str(random.getstate()),
        "random of numpy": str(np.random.get_state()),
        "warp": {name: str(value) for name, value in vars(wp.config).items()},
    }

before = settings()
loaded = set(sys.modules)
import warp_caustics
first = sorted(set(sys.modules) - loaded)
for name in json.loads(sys.argv[1]):
    importlib.import_module(name)
after = settings()
import warp_caustics.cli  # rich draws random numbers when it is imported
print(json.dumps({
    "first": first,
    "all": sorted(sys.modules),
    "changed": [name for name in before if before[name] != after[name]],
    "warp started": wp._src.context.runtime is not None,
}))
"""


@pytest.fixture(scope="module")
def probe() -> dict:
    names = json.dumps([name for name in MODULES if not _within(name, {"warp_caustics.__main__", "warp_caustics.cli"})])
    done = subprocess.run(
        [sys.executable, "-c", PROBE, names], capture_output=True, text=True, check=False, cwd=ROOT.parent
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_package_alone_loads_its_errors_alone(probe):
    ours = {name for name in probe["first"] if name.startswith("warp_caustics")}
    assert ours == {"warp_caustics", "warp_caustics.errors"}


def test_no_module_starts_warp(probe):
    assert not probe["warp started"]


def test_no_module_loads_what_is_heavy(probe):
    assert "warp_caustics.view" in probe["all"]
    assert not HEAVY & {name.partition(".")[0] for name in probe["all"]}


def test_no_module_changes_a_global_setting(probe):
    assert probe["changed"] == []


def test_the_kernels_are_no_package_of_their_own(probe):
    assert "warp_caustics.kernels" in probe["all"]
    assert "kernels" not in probe["all"]


def test_every_public_name_is_there_and_once():
    assert sorted(set(wc.__all__)) == sorted(wc.__all__)
    for name in wc.__all__:
        assert getattr(wc, name) is not None
    assert dir(wc) == sorted(wc.__all__)


def test_the_wheel_holds_every_package_and_data_file():
    """An editable install does not show what a wheel would lack."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    listed = set(settings["packages"])
    assert listed == {_module(path) for path in (*FILES, *KERNEL_FILES) if path.name == "__init__.py"}
    patterns = settings["package-data"]["warp_caustics.scenes"]
    for path in (PACKAGE / "scenes").iterdir():
        assert path.suffix == ".py" or path.is_dir() or any(path.match(pattern) for pattern in patterns), path.name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        wc.no_such_name  # noqa: B018


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: str(path.relative_to(KERNELS)))
def test_kernels_know_warp_alone(path):
    package = _module(path) if path.name == "__init__.py" else _module(path).rpartition(".")[0]
    for name in _imports(path, package):
        assert name.startswith("warp_caustics.kernels") or name.partition(".")[0] in KERNEL_IMPORTS, name


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_nothing_inside_knows_the_outer_layer(path):
    module = _module(path)
    if _within(module, OUTER):
        return
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for name in _imports(path, package):
        assert not _within(name, OUTER), name
        assert name.partition(".")[0] not in {"bench", "kernels", "tests"}, name


def test_the_guard_reads_relative_imports(tmp_path):
    path = tmp_path / "probe.py"
    path.write_text("from .waves import wave\nfrom . import cli\nfrom ..view import view\nimport a.b\n")
    assert _imports(path, "warp_caustics.kernels") == {
        "warp_caustics.kernels.waves",
        "warp_caustics.kernels.waves.wave",
        "warp_caustics.kernels",
        "warp_caustics.kernels.cli",
        "warp_caustics.view",
        "warp_caustics.view.view",
        "a.b",
    }


def _within(module: str, packages: set[str]) -> bool:
    return any(module == package or module.startswith(f"{package}.") for package in packages)


def _imports(path: Path, package: str) -> set[str]:
    """Full names of all that a file imports, wherever in it, given the package that it belongs to."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            names.add(module)
            names |= {f"{module}.{alias.name}" for alias in node.names}
    return names
