"""Scenario families: seeded generators of worlds in which the decision is tested.

registry.py - all families by name, with the faults of each
layout.py - common parts: the aisle, racks, people and robots
oncoming.py - obstacles that come towards the robot
crossing.py - obstacles that cross its path
same_way.py - obstacles that go the robot's way
standing.py - obstacles that stand on the path, beside it or above it
close_by.py - obstacles that stand close beside the path
step_in.py - a person who steps into the path, stands and leaves; not in the registry
"""

from sim.families.registry import FAMILY_NAMES, Case, generate

__all__ = ["FAMILY_NAMES", "Case", "generate"]
