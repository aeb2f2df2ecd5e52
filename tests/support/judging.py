"""Evidence of motion made by hand, and the verdict on it.

The camera looks along z and is level, the track is 3 m away. Settings: 4 sigmas (16 squared), slowest
speed 0.15 m/s and 0.02 m/s for each metre of distance, 0.21 m/s at 3 m.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from config.perception import MotionSettings
from hal.types import FloatArray
from vision.bodies.judgement import Verdict, judge
from vision.bodies.motion_evidence import MotionEvidence

SETTINGS = MotionSettings(max_speed_mps=1.5, min_speed_mps=0.15, sigmas=4.0)
DT_S = 0.05
SURE = 0.01  # (m/s)^2: 0.8 m/s are 7.7 sigmas
UNKNOWN = 9.0
ACROSS = (0.8, 0.0, 0.0)
ALONG = (0.0, 0.0, -0.8)
STILL = (0.0, 0.0, 0.0)
UPWARDS = (0.0, -0.8, 0.0)
LEVEL_UP = np.array([0.0, -1.0, 0.0])
Speed = tuple[float, float, float]


def covariance(variance: float) -> FloatArray:
    return variance * np.eye(3)[None]


def one(velocity: Speed = STILL, **changes: Any) -> MotionEvidence:
    """A track of which fragments, surface and arrivals say nothing; velocity is the filter's."""
    plain = MotionEvidence(
        sight=np.array([[0.0, 0.0, 1.0]]),
        distance_m=np.array([3.0]),
        depth_sigma_m=np.array([0.0725]),
        velocity=np.array([velocity]),
        covariance=covariance(SURE),
        own_velocity=np.zeros((1, 3)),
        own_covariance=covariance(UNKNOWN),
        surface_velocity=np.zeros((1, 3)),
        surface_covariance=covariance(UNKNOWN),
        ends=np.array([0]),
        agreement=np.array([0.0]),
        restless=np.array([False]),
        restless_s=np.array([0.0]),
        arriving_s=np.array([0.0]),
        arrived=np.array([0]),
        cells=np.array([100]),
        keeps_area=np.array([True]),
        size_m=np.array([0.8]),
        velocity_measured_s=np.array([0.0]),
        rim_mps=np.array([0.0]),
        rim_sigmas=np.array([0.0]),
        rim_s=np.array([0.0]),
        approach_mps=np.array([0.0]),
        approach_s=np.array([0.0]),
        view_radps=np.array([0.0]),
        growth_mps=np.array([0.0]),
        advances=np.array([True]),
        border_is_guess=np.array([False]),
        up=LEVEL_UP,
        trusted=True,
        reckoned=True,
        borne_out=1.0,
    )
    return replace(plain, **changes)


def by_fragments(velocity: Speed, ends: int, agreement: float = 1.0, **changes: Any) -> MotionEvidence:
    """The filter's velocity and that of this frame's fragments are the same."""
    own = {"own_velocity": np.array([velocity]), "own_covariance": covariance(SURE)}
    return one(velocity, **{**own, "ends": np.array([ends]), "agreement": np.array([agreement]), **changes})


def surface(velocity: Speed, variance: float) -> dict[str, Any]:
    return {"surface_velocity": np.array([velocity]), "surface_covariance": covariance(variance)}


def verdict(seen: MotionEvidence, evidence: float = 0.0, moving: bool = False) -> Verdict:
    return judge(seen, np.array([evidence]), np.array([moving]), DT_S, SETTINGS)


def rises(seen: MotionEvidence) -> bool:
    return bool(verdict(seen).evidence[0] > 0.0)


def by_surface(velocity: Speed, velocity_measured_s: float, **changes: Any) -> MotionEvidence:
    """No fragment at all: a plain surface that goes."""
    return one(
        velocity,
        **{**surface(velocity, SURE), "velocity_measured_s": np.array([velocity_measured_s]), **changes},
    )


def by_rim(rim_mps: float = 0.8, rim_s: float = 0.15, **changes: Any) -> MotionEvidence:
    """A half hidden body: only its free rims tell that it goes; of the filter 0.64 / 0.0909 = 7.0."""
    rims = {"rim_mps": np.array([rim_mps]), "rim_s": np.array([rim_s]), "rim_sigmas": np.array([5.0])}
    return one(ACROSS, **{**rims, "covariance": covariance(0.09), **changes})
