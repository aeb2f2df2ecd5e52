"""docs/add-a-camera.md: what is pasted from it is a camera, in the contract suite and on a drive."""

from __future__ import annotations

import importlib.util
import re
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from types import ModuleType
from typing import get_args
from uuid import uuid4

import pytest
import yaml

from config.camera import CameraConfig, SimulatedCameraConfig
from config.loader import CONFIG_DIR
from config.scenario import load_scenario
from hal.clocks import MonotonicClock
from hal.types import CameraMount, PlanarPose
from sim.rendering.camera import SimulatedCamera
from sim.world import World
from tests.support.docs_pages import PACKAGES, ROOT, Page, changed, python_in, ruff_findings

PAGE = Page("docs/add-a-camera.md")
WRITER = "tests/support/frame_writer.py"
IMAGE = {"width": 320, "height": 240, "fx": 230.0, "fy": 230.0, "cx": 159.5, "cy": 119.5, "fps": 10.0}
LATENCY_S = 0.01
LINES_SEEN = 12


@pytest.fixture(scope="module")
def pasted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project with the page's camera in it."""
    project = tmp_path_factory.mktemp("project")
    PAGE.paste(project, (*PACKAGES, "tests/contract", "tests/support", "tests/unit/hal"))
    shutil.copy(ROOT / "tests" / "conftest.py", project / "tests")
    return project


def test_the_code_of_the_page_is_one_camera() -> None:
    assert len(PAGE.files) == 3, "driver, other end, test"
    assert len(PAGE.changes) == 3, "config, composition, contract suite"


@pytest.mark.parametrize(
    ("file", "last", "mine"),
    [
        ("config/camera.py", "    | SimulatedCameraConfig\n", "    | MyConfig\n"),
        ("controller/build.py", "    SimulatedCameraConfig,\n)", "\nfrom hal.cameras.mine import Mine"),
        ("tests/contract/test_frame_sources.py", "    paced_recording,\n", "    mine,\n"),
    ],
)
def test_its_lines_still_fit_once_another_kind_was_added(file: str, last: str, mine: str) -> None:
    text = (ROOT / file).read_text()
    assert last in text
    fits = changed(text.replace(last, last + mine), dict(PAGE.changes)[file], f"{PAGE.name}: {file}")
    assert mine in fits


def test_ruff_is_content(pasted: Path) -> None:
    assert not ruff_findings(pasted)


def test_it_passes_the_contract_suite_and_its_own_test(pasted: Path) -> None:
    tests = ("tests/contract/test_frame_sources.py", "tests/unit/hal/test_frame_file.py")
    done = python_in(pasted, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests, "-k", "frame_file")
    assert done.returncode == 0, done.stdout + done.stderr
    passed = re.search(r"([0-9]+) passed", done.stdout)
    assert passed is not None
    assert int(passed[1]) >= 15, done.stdout


def test_it_drives_until_it_goes_and_what_was_recorded_replays(pasted: Path) -> None:
    _configuration(pasted)
    with _other_program(pasted, until_seen=pasted / "seen.jsonl"):
        command = ("run", "--config", "mine.yaml", "--quiet", "--record", "seen")
        done = python_in(pasted, "-m", "controller", *command, "--observations", "seen.jsonl")
    assert "perception is lost: camera: frame: cannot be read any more" in done.stdout, (
        done.stdout + done.stderr
    )
    assert "limits      kept" in done.stdout
    driven_m = re.search(r"; ([0-9.]+) m in", done.stdout)
    assert driven_m is not None, done.stdout
    assert float(driven_m[1]) > 0.1
    done = python_in(pasted, "-m", "controller", "replay", "seen", "--config", "mine.yaml", "--quiet")
    assert done.returncode == 0, done.stdout + done.stderr
    frames = re.search(r"recording   seen: ([0-9]+) frames, .* 0 skipped", done.stdout)
    assert frames is not None, done.stdout
    assert int(frames[1]) >= LINES_SEEN


def _configuration(project: Path) -> None:
    """The real-time simulation, with the page's camera in place of the simulated one."""
    config = yaml.safe_load((CONFIG_DIR / "sim-realtime.yaml").read_text())
    config["camera"] = {"kind": "frame_file", "file": "frame", "latency_s": LATENCY_S, **IMAGE}
    config["path"] = {"segments": [{"kind": "line", "length_m": 20.0}]}
    config["chassis"]["link"]["channel"] = f"camera-page-{uuid4().hex[:8]}"
    config["simulation"]["scenario"] = "empty"
    config["runner"]["max_duration_s"] = 40.0
    (project / "mine.yaml").write_text(yaml.safe_dump(config))


@contextmanager
def _other_program(project: Path, until_seen: Path) -> Iterator[None]:
    """Hands over an empty hall as seen from its path's beginning, until some frames of it were seen."""
    begun, given_up = Event(), Event()

    def enough() -> bool:
        return until_seen.exists() and until_seen.read_bytes().count(b"\n") >= LINES_SEEN

    def hand_over() -> None:
        clock, world = MonotonicClock(), World(load_scenario("empty"))
        image = SimulatedCameraConfig.model_validate({"kind": "simulated", **IMAGE})
        writer = _writer(project).FrameWriter(project / "frame")
        mount, start = CameraMount(0.45, 0.0, 0.6, 0.07), PlanarPose(0.0, 0.0, 0.0)
        with SimulatedCamera(world, image, mount, clock, lambda _: start) as camera:
            while not (enough() or given_up.is_set()):
                frame = camera.read(1.0)
                writer.write(frame.colour, frame.depth, clock.now_ns())
                begun.set()
        writer.end()

    with ThreadPoolExecutor(max_workers=1) as thread:
        handing_over = thread.submit(hand_over)
        try:
            assert begun.wait(30.0)
            yield
        finally:
            given_up.set()
            handing_over.result()


def _writer(project: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("page_frame_writer", project / WRITER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("config", get_args(get_args(CameraConfig)[0]))
def test_every_camera_has_gone_the_steps(config: type) -> None:
    assert f"case {config.__name__}()" in (ROOT / "controller" / "build.py").read_text()
    assert isinstance(vars(config)["edge_tangents"], property)
