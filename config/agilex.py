"""What the configuration has to know of an AgileX model; all else is in hal/chassis/agilex_models.py."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

AgilexModelName = Literal["bunker", "bunker_mini", "bunker_pro", "scout", "scout_mini", "tracer"]

# Why a model cannot be reached over RS-232.
NO_SERIAL: Mapping[AgilexModelName, str] = MappingProxyType(
    {
        "bunker_mini": "it has CAN only",
        "bunker_pro": "it has CAN only",
        "tracer": "its serial line speaks another protocol (percentages), which has no driver here",
    }
)

# What a model makes, and how fast it turns at most, at any speed: by the vendor's SDK (robot_limits) for
# BUNKER, SCOUT and SCOUT MINI. For BUNKER MINI and BUNKER PRO no limits were found: theirs are what the
# paper's task needs.
AGILEX_TOP_SPEED_MPS: Mapping[AgilexModelName, float] = MappingProxyType(
    {
        "bunker": 3.0,
        "bunker_mini": 1.5,
        "bunker_pro": 1.5,
        "scout": 1.5,
        "scout_mini": 3.0,
        "tracer": 1.5,
    }
)

AGILEX_TOP_YAW_RATE_RADPS: Mapping[AgilexModelName, float] = MappingProxyType(
    {
        "bunker": 2.5235,
        "bunker_mini": 1.0,
        "bunker_pro": 1.0,
        "scout": 0.5235,
        "scout_mini": 2.5235,
        "tracer": 0.7853,
    }
)
