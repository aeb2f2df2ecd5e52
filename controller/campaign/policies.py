"""The policies that drive the same missions side by side, by name."""

from __future__ import annotations

from collections.abc import Callable

from config.app import AppConfig
from controller.build import build_decision
from controller.campaign.paper_rule import PaperRule
from controller.campaign.protective_field import ProtectiveField
from controller.campaign.stage import Stage
from controller.campaign.zone_monitor import ZoneMonitor
from controller.control import Decides
from hal.geometry import mount_of

OURS, PAPER, ZONES, FIELD = "ours", "paper", "zones", "field"


_BUILDERS: dict[str, Callable[[AppConfig, Stage], Decides]] = {
    OURS: lambda config, _: build_decision(config),
    PAPER: lambda config, _: PaperRule(config.robot, mount_of(config.robot)),
    ZONES: lambda config, stage: ZoneMonitor(config.robot, stage),
    FIELD: lambda config, stage: ProtectiveField(config.robot, stage),
}

POLICY_NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build_policy(name: str, config: AppConfig, stage: Stage) -> Decides:
    """A policy for one drive. Those with their own scanner see the true stage, without errors or faults."""
    return _BUILDERS[name](config, stage)
