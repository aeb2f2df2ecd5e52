"""The packages: ours are the ones that load, though their names are common; imports; lists of files."""

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ["controller", "hal", "vision", "sim", "config"]


@pytest.mark.parametrize("name", PACKAGES)
def test_each_package_loads_from_this_project(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__file__ is not None
    assert Path(module.__file__).resolve().is_relative_to(ROOT)


@pytest.mark.parametrize("name", PACKAGES)
def test_no_package_imports_the_tests(name: str) -> None:
    importing = re.compile(r"^\s*(from|import)\s+tests\b", re.MULTILINE)
    assert [str(path) for path in (ROOT / name).rglob("*.py") if importing.search(path.read_text())] == []


def test_no_test_imports_another() -> None:
    """What they share is in tests/support."""
    importing = re.compile(r"^\s*(from|import)\s+tests\.[\w.]*test_", re.MULTILINE)
    assert [str(path) for path in (ROOT / "tests").rglob("*.py") if importing.search(path.read_text())] == []


@pytest.mark.parametrize("name", [*PACKAGES, "tests/support"])
def test_the_docstring_of_each_folder_lists_all_of_its_files(name: str) -> None:
    missing = []
    for init in (ROOT / name).rglob("__init__.py"):
        listed = set(re.findall(r"\w+", ast.get_docstring(ast.parse(init.read_text())) or ""))
        files = {path.stem for path in init.parent.glob("*.py")} - {"__init__"}
        folders = {path.parent.name for path in init.parent.glob("*/__init__.py")}
        missing += [str(init.parent / each) for each in (files | folders) - listed]
    assert missing == []


# Neither devices nor emulators: what to look for in a bag and what came with its images, what any recording
# offers, a folder on the disk, the simulated outside.
NO_DEVICES = {
    "hal.cameras.bag_topics",
    "hal.cameras.gyro_track",
    "hal.cameras.pose_track",
    "hal.cameras.recording",
    "hal.cameras.tum_writer",
    "sim.contact",
    "sim.plant",
    "sim.simulation",
    "sim.world",
}


def test_only_build_names_concrete_devices() -> None:
    inner = re.compile(r"^\s*from ((?:hal\.(?:cameras|chassis|links)|sim)(?:\.\w+)+) import", re.MULTILINE)
    naming = {
        str(path.relative_to(ROOT / "controller"))
        for path in (ROOT / "controller").rglob("*.py")
        if set(inner.findall(path.read_text())) - NO_DEVICES
    }
    # The bench and the evaluation measure devices and renderers one by one, outside of any program.
    assert {name for name in naming if not name.startswith(("bench/", "evaluation/", "campaign/"))} == {
        "build.py",
        "build_chassis.py",
    }
