from __future__ import annotations

import platform
from pathlib import Path

import cv2
import pytest

from controller.bench.machine import cpu_name, describe_machine, one_opencv_thread, usable_cores


def test_the_machine_is_described() -> None:
    machine = describe_machine()
    assert list(machine) == ["cpu", "cores", "system", "python", "opencv", "numpy"]
    assert machine["opencv"] == cv2.__version__
    assert machine["python"] == platform.python_version()
    assert machine["cores"] == usable_cores() >= 1


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("processor\t: 0\nmodel name\t: AMD EPYC\nmodel name\t: other\n", "AMD EPYC"),
        ("processor\t: 0\nHardware\t: BCM2835\nModel\t\t: Raspberry Pi 5\n", "Raspberry Pi 5"),
        ("processor\t: 0\n", platform.machine()),
    ],
)
def test_the_cpu_is_named_as_the_kernel_names_it(tmp_path: Path, text: str, name: str) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(text)
    assert cpu_name(cpuinfo) == name


def test_cpu_name_where_there_is_no_such_file(tmp_path: Path) -> None:
    assert cpu_name(tmp_path / "none") == (platform.processor() or platform.machine())


def test_opencv_gets_its_threads_back() -> None:
    def fail_inside() -> None:
        with one_opencv_thread():
            assert cv2.getNumThreads() == 1
            raise KeyError

    before = cv2.getNumThreads()
    with pytest.raises(KeyError):
        fail_inside()
    assert cv2.getNumThreads() == before
