"""The chassis of docs/add-a-chassis.md: its code as it stands on the page, on a wire."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType

from config.loader import CONFIG_DIR
from tests.support.chassis_rig import COUNTS_PER_M, PLANT, SLIP_FACTOR, Rig, serial_ends
from tests.support.wires import PluggedSerial

PAGE = (CONFIG_DIR.parent / "docs" / "add-a-chassis.md").read_text(encoding="utf-8")
CODE = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def page_module() -> ModuleType:
    """All code of the page, in its order, as one module."""
    module = ModuleType("page_chassis")
    # Where dataclasses look up the names of annotations.
    sys.modules[module.__name__] = module
    source = "from __future__ import annotations\n" + "\n\n".join(CODE)
    exec(compile(source, "docs/add-a-chassis.md", "exec"), module.__dict__)
    return module


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
