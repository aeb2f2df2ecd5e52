"""The chassis of docs/add-a-chassis.md: its code as it stands on the page, as one module and as a rig."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module
from itertools import takewhile
from types import ModuleType

from tests.support.chassis_rig import COUNTS_PER_M, PLANT, SLIP_FACTOR, Rig, serial_ends
from tests.support.docs_pages import ROOT, Page
from tests.support.wires import PluggedSerial

PAGE = Page("docs/add-a-chassis.md")


@cache
def page_module() -> ModuleType:
    """Everything that the page's code names, as one module; each file of it can be imported from then on."""
    together = ModuleType("page_chassis")
    for name, text in [*_added_lines("config/chassis.py"), *PAGE.files]:
        modules = name.removesuffix(".py").replace("/", ".")
        # Where dataclasses and pydantic look up the names of annotations.
        module = import_module(modules) if (ROOT / name).exists() else ModuleType(modules)
        sys.modules[modules] = module
        exec(compile(text, f"{PAGE.name}: {name}", "exec"), module.__dict__)
        vars(together).update(vars(module))
    return together


def _added_lines(name: str) -> list[tuple[str, str]]:
    """The class of the configuration, without the union that it is added to."""
    change = dict(PAGE.changes)[name]
    added = [line[1:] for line in takewhile(lambda line: line.startswith("+"), change.splitlines())]
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
