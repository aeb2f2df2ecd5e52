"""The chassis of docs/add-a-chassis.md: its code as it stands on the page, pasted where the page says."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

from config.loader import CONFIG_DIR
from tests.support.chassis_rig import COUNTS_PER_M, PLANT, SLIP_FACTOR, Rig, serial_ends
from tests.support.wires import PluggedSerial

ROOT = CONFIG_DIR.parent
PAGE = (ROOT / "docs" / "add-a-chassis.md").read_text(encoding="utf-8")
# (file, text) of each block: whole files, and lines that go into one.
FILES = re.findall(r"^```python\n# (\S+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
CHANGES = re.findall(r"^```diff\n# (\S+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def changed(text: str, change: str) -> str:
    """text with the lines of a change: + comes in, - goes, and the others are found in this order."""
    lines, at = text.splitlines(), 0
    for index, line in enumerate(change.splitlines()):
        mark, content = line[:1], line[1:]
        if mark == "+":
            if index == 0:
                # What comes before the first line that is found goes right before it.
                first = next(line[1:] for line in change.splitlines() if line[:1] in "- ")
                at = lines.index(first)
            lines.insert(at, content)
            at += 1
            continue
        at = lines.index(content, at)
        if mark == "-":
            del lines[at]
        else:
            at += 1
    return "\n".join(lines) + "\n"


def paste(project: Path) -> None:
    """A copy of the program into project, with all that the page says in it."""
    for package in ("config", "controller", "hal", "sim", "vision"):
        shutil.copytree(ROOT / package, project / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in FILES:
        assert not (project / name).exists(), name
        (project / name).write_text(text, encoding="utf-8")
    for name, change in CHANGES:
        path = project / name
        path.write_text(changed(path.read_text(encoding="utf-8"), change), encoding="utf-8")


@cache
def page_module() -> ModuleType:
    """Everything that the page's code names, as one module; each file of it can be imported from then on."""
    together = ModuleType("page_chassis")
    for name, text in [*_added_lines("config/chassis.py"), *FILES]:
        modules = name.removesuffix(".py").replace("/", ".")
        # Where dataclasses and pydantic look up the names of annotations.
        module = import_module(modules) if (ROOT / name).exists() else ModuleType(modules)
        sys.modules[modules] = module
        exec(compile(text, f"docs/add-a-chassis.md: {name}", "exec"), module.__dict__)
        vars(together).update(vars(module))
    return together


def _added_lines(name: str) -> list[tuple[str, str]]:
    """The class of the configuration, without the union that it is added to."""
    change = dict(CHANGES)[name]
    added = [line[1:] for line in change.partition("\n-")[0].splitlines()]
    return [(name, "\n".join(added) + "\n")]


@contextmanager
def page_rig(kind: str) -> Iterator[Rig]:
    """kind: as of serial_ends."""
    page = page_module()
    config = page.MinitrackConfig.model_validate(
        {
            "kind": "minitrack",
            "link": {"url": "loop://"},
            "counts_per_m": COUNTS_PER_M,
            "track_width_m": PLANT.track_width_m,
            "slip_factor": SLIP_FACTOR,
        }
    )
    with ExitStack() as stack:
        near, far = serial_ends(kind)
        plug = PluggedSerial(near)
        emulator = stack.enter_context(page.MinitrackEmulator(far, page.TrackedPlant(PLANT), COUNTS_PER_M))
        chassis = stack.enter_context(page.MinitrackChassis(plug, config))
        yield Rig(chassis, emulator, plug, own_timeout_s=0.3, battery_v=24.0)
