"""Boxes on the floor of an odometry frame, for tests of what the decision makes of them."""

from __future__ import annotations

import numpy as np

from config.path import ArcSpec, LineSpec, PathSpec
from config.robot import Robot
from controller.decision.bodies import Bodies
from controller.path.path import Path


def line_path(length_m: float = 20.0) -> Path:
    return Path(PathSpec(segments=(LineSpec(kind="line", length_m=length_m),)), Robot())


def arc_path(radius_m: float, angle_deg: float) -> Path:
    spec = PathSpec(segments=(ArcSpec(kind="arc", radius_m=radius_m, angle_deg=angle_deg),))
    return Path(spec, Robot())


def box(
    x_m: float,
    y_m: float,
    vx_mps: float = 0.0,
    vy_mps: float = 0.0,
    *,
    number: int = 1,
    half_view_m: float = 0.2,
    half_across_m: float = 0.25,
    top_m: float = 1.7,
    bottom_m: float = 0.0,
    sigma_mps: float = 0.1,
    age_s: float = 5.0,
    captured_ns: int = 0,
) -> Bodies:
    """One body, seen along x; it moves if it has a velocity."""
    return Bodies(
        captured_ns=captured_ns,
        ids=np.array([number], np.int64),
        xy_m=np.array([[x_m, y_m]]),
        velocity_mps=np.array([[vx_mps, vy_mps]]),
        measured_mps=np.array([[vx_mps, vy_mps]]),
        innovation_mps=np.zeros((1, 2)),
        covariance=np.eye(2)[None] * sigma_mps**2,
        half_view_m=np.array([half_view_m]),
        half_across_m=np.array([half_across_m]),
        view_rad=np.zeros(1),
        top_m=np.array([top_m]),
        bottom_m=np.array([bottom_m]),
        moving=np.array([vx_mps != 0.0 or vy_mps != 0.0]),
        age_s=np.array([age_s]),
        unseen_s=np.zeros(1),
        tracked_s=np.array([age_s]),
    )
