"""Real-time scheduling of the control process, as far as the machine permits."""

from __future__ import annotations

import ctypes
import gc
import os

_MCL_CURRENT_AND_FUTURE = 3


def become_realtime(priority: int) -> list[str]:
    """Set SCHED_FIFO, lock the memory, and switch garbage collection off; returns what was not permitted.

    SCHED_FIFO holds for the calling thread; threads started before keep ordinary scheduling. Without the
    permission (a laptop) the program still runs, with a few milliseconds more jitter. priority: 0 leaves
    scheduling and memory as they are.
    """
    refused = []
    if priority > 0:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except OSError as error:
            refused.append(f"SCHED_FIFO {priority} ({error.strerror})")
        libc = ctypes.CDLL("libc.so.6", use_errno=True)
        if libc.mlockall(_MCL_CURRENT_AND_FUTURE) != 0:
            refused.append(f"mlockall ({os.strerror(ctypes.get_errno())})")
    gc.collect()
    gc.freeze()
    gc.disable()
    return refused
