"""The envelope report: the paper's three numbers, and every further term by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

import config
from config.app import load_app
from config.robot import Limits
from controller.cli.envelope import Latency, describe_envelope, envelope, envelope_of

TAU = Latency(0.06, 0.02, 0.12)


def test_the_papers_distances_and_time_follow_from_its_limits() -> None:
    paper = envelope(Limits(), 10.0, TAU, 0.3).paper
    assert (paper.s_r_m, paper.t_t_s, paper.s_n_m) == pytest.approx((3.75, 5.0, 11.25))


def test_every_term_of_comfort_by_hand() -> None:
    terms = envelope(Limits(), 10.0, TAU, 0.3).comfort
    assert (terms.stop_m, terms.stop_s) == pytest.approx((4.125, 5.5))
    assert (terms.jerk_m, terms.jerk_s) == pytest.approx((0.375, 0.5))
    assert terms.latency_m == pytest.approx(3.0 * 0.2)
    assert terms.approach_m == pytest.approx(8.25)
    assert terms.s_n_m == pytest.approx(0.6 + 4.125 + 8.25 + 0.3)


def test_the_speed_that_the_range_admits() -> None:
    """10 m, V_o 1.5, A 0.3, J 0.6, tau 0.2, margin 0.3: v^2/0.6 + 5.45 v + 1.05 + 0.3 = 10."""
    terms = envelope(Limits(), 10.0, TAU, 0.3).comfort
    v = terms.admits_mps
    assert v**2 / 0.6 + 5.45 * v + 1.35 == pytest.approx(10.0)
    assert v == pytest.approx(1.170, abs=0.001)
    static = terms.admits_static_mps
    assert static**2 / 0.6 + 0.45 * static + 0.3 == pytest.approx(10.0)


def test_emergency_braking_fits_the_range_at_top_speed() -> None:
    terms = envelope(Limits(), 10.0, TAU, 0.3).emergency
    assert terms.s_n_m == pytest.approx(0.6 + (2.25 / 1.4 + 1.5 * 0.175) + 1.5 * (1.5 / 0.7 + 0.35) + 0.3)
    assert terms.s_n_m < 10.0
    assert terms.admits_mps > 1.5


def shipped(name: str) -> list[str]:
    return list(describe_envelope(load_app(Path(config.__file__).parent / name)))


def test_the_report_shows_the_paper_and_claims_no_rating() -> None:
    text = "\n".join(shipped("sim.yaml"))
    for number in ("3.75 m", "5 s", "11.25 m"):
        assert number in text
    assert "Not covered: the sides and the rear" in text
    assert "no safety rating" in text
    assert "BEYOND" in text  # comfort alone does not fit a 10 m range


def test_real_time_counts_the_oldest_scene_that_is_admitted() -> None:
    app = load_app(Path(config.__file__).parent / "robot-bunker.yaml")
    assert envelope_of(app).latency.scene_s == app.decision.sight.stale_s


def test_range_counts_from_the_front() -> None:
    app = load_app(Path(config.__file__).parent / "sim.yaml")
    front = app.robot.body.front_m - app.robot.camera_mount.forward_m
    assert envelope_of(app).range_m == pytest.approx(10.0 - front)
    assert envelope_of(app).latency.scene_s == 0.06
