"""The faults of a scenario that belong to the configuration of its plant and of its camera.

All other faults happen in what controller/build.py makes of the scenario.
"""

from __future__ import annotations

from config.app import AppConfig
from config.camera import SimulatedCameraConfig
from config.faults import Faults
from controller.build import build_faults

# Faults of the base: nothing comes of them where another process, or a real base, is at the end of the link.
_OF_THE_BASE = ("yaw_slip", "distance_slip", "feedback_lost_s")


def with_scenario_faults(config: AppConfig) -> AppConfig:
    """The configuration with the slip and the vibration that its scenario asks for. Raises ConfigError."""
    return with_slip_and_vibration(config, build_faults(config))


def unused_faults_warning(config: AppConfig) -> str | None:
    """One line that names the faults of the scenario that an external base does not have; None without any.

    Raises ConfigError.
    """
    if config.simulation is None or config.simulation.base == "emulated":
        return None
    faults = build_faults(config)
    unused = [name for name in _OF_THE_BASE if getattr(faults, name) is not None]
    if not unused:
        return None
    return (
        f"{config.simulation.scenario}: faults.{', faults.'.join(unused)}: not simulated, since "
        "simulation.base is 'external'"
    )


def with_slip_and_vibration(config: AppConfig, faults: Faults) -> AppConfig:
    """The configuration with the slip and the vibration that a scenario asks for."""
    changes: dict[str, object] = {}
    if config.simulation is not None:
        plant: dict[str, object] = {}
        if faults.yaw_slip is not None:
            plant["slip_factor"] = 1.0 / (1.0 - faults.yaw_slip)
        if faults.distance_slip is not None:
            plant["distance_slip"] = faults.distance_slip
        changes["simulation"] = config.simulation.model_copy(
            update={"plant": config.simulation.plant.model_copy(update=plant)}
        )
    if faults.vibration is not None and isinstance(config.camera, SimulatedCameraConfig):
        shaking = {
            "vibration_deg": faults.vibration.amplitude_deg,
            "vibration_hz": faults.vibration.frequency_hz,
        }
        changes["camera"] = config.camera.model_copy(update=shaking)
    return config.model_copy(update=changes)
