"""The policies that drive the same missions side by side, by name."""

from __future__ import annotations

from collections.abc import Callable

from config.app import AppConfig
from controller.campaign.noisy_camera import mount_of
from controller.campaign.paper_rule import PaperRule
from controller.campaign.protective_field import ProtectiveField
from controller.campaign.stage import Stage
from controller.campaign.zone_monitor import ZoneMonitor
from controller.control import Decides
from controller.decision.decide import DecisionMaker

OURS, PAPER, ZONES, FIELD = "ours", "paper", "zones", "field"


def _ours(config: AppConfig, _: Stage) -> Decides:
    period_s = 1.0 / config.runner.control_rate_hz
    mount, noise = mount_of(config.robot), config.perception.depth_noise
    return DecisionMaker(config.decision, config.robot, mount, period_s, noise)


_BUILDERS: dict[str, Callable[[AppConfig, Stage], Decides]] = {
    OURS: _ours,
    PAPER: lambda config, _: PaperRule(config.robot, mount_of(config.robot)),
    ZONES: lambda config, stage: ZoneMonitor(config.robot, stage),
    FIELD: lambda config, stage: ProtectiveField(config.robot, stage),
}

POLICY_NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build_policy(name: str, config: AppConfig, stage: Stage) -> Decides:
    """A policy for one drive. Those with their own scanner see the true stage, without errors or faults."""
    return _BUILDERS[name](config, stage)
