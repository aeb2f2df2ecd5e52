"""Scenario families: seeded generators of worlds to prove the decision in."""

from sim.families.registry import FAMILY_NAMES, Case, generate

__all__ = ["FAMILY_NAMES", "Case", "generate"]
