"""Each kind of proof by itself, on evidence made by hand (tests/support/judging.py)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.support.judging import (
    ACROSS,
    ALONG,
    DT_S,
    LEVEL_UP,
    SETTINGS,
    STILL,
    UPWARDS,
    Speed,
    by_fragments,
    by_rim,
    by_surface,
    covariance,
    one,
    rises,
    surface,
    verdict,
)
from vision.bodies.judgement import judge
from vision.bodies.motion_evidence import MotionEvidence


def test_frame_without_evidence_proves_nothing() -> None:
    assert not rises(one())
    assert not rises(one(ACROSS))  # a fast filter that nothing stands behind


def test_four_agreeing_ends_prove_a_motion_across() -> None:
    assert rises(by_fragments(ACROSS, 4))
    assert not rises(by_fragments(ACROSS, 3))


def test_ends_count_by_how_many_agree() -> None:
    assert rises(by_fragments(ACROSS, 8, 0.5))
    assert not rises(by_fragments(ACROSS, 8, 0.45))  # 3.6 of them
    assert not rises(by_fragments(ACROSS, 40, 0.15))  # 6 of them, but of many that do not
    assert rises(by_fragments(ACROSS, 40, 0.3))


def test_this_frames_fragments_must_bear_out_the_filter() -> None:
    weak = np.array([[0.25, 0.0, 0.0]])  # 0.0625 / 0.0109 = 5.7, less than half of 16
    assert not rises(by_fragments(ACROSS, 6, own_velocity=weak))
    enough = np.array([[0.32, 0.0, 0.0]])  # 9.4
    assert rises(by_fragments(ACROSS, 6, own_velocity=enough))


def test_the_filters_speed_must_be_four_sigmas() -> None:
    # 0.64 / (0.037 + 0.0009) = 16.9; with 0.042: 14.9
    assert rises(by_fragments(ACROSS, 6, covariance=covariance(0.037)))
    assert not rises(by_fragments(ACROSS, 6, covariance=covariance(0.042)))


def test_a_creeping_track_is_static_however_certain_its_velocity() -> None:
    sure: dict[str, Any] = {"covariance": covariance(1e-4), "own_covariance": covariance(1e-4)}
    assert not rises(by_fragments((0.20, 0.0, 0.0), 20, **sure))
    assert rises(by_fragments((0.22, 0.0, 0.0), 20, **sure))
    assert not rises(by_fragments((0.22, 0.0, 0.0), 20, **sure, distance_m=np.array([5.0])))


def test_up_and_down_eight_ends_must_agree_for_a_pitching_camera_feigns_it() -> None:
    assert not rises(by_fragments(UPWARDS, ends=7))
    assert rises(by_fragments(UPWARDS, ends=8))
    # With half of the proof in what goes level, or nearly all ends against standing still, four will do.
    assert rises(by_fragments((0.32, -0.8, 0.0), ends=4))  # 9.4 squared sigmas
    assert not rises(by_fragments((0.28, -0.8, 0.0), ends=4))  # 7.2
    assert rises(by_fragments(UPWARDS, ends=4, restless=np.array([True])))
    assert rises(by_fragments(UPWARDS, ends=4, up=None))  # where the floor is not known, nor is level


def test_a_surface_that_contradicts_denies_a_motion_across_unless_many_ends_agree() -> None:
    stands = surface(STILL, 0.08)  # 0.64 / (0.01 + 0.08 + 0.0009) = 7.04, more than 2.5 squared
    assert not rises(by_fragments(ACROSS, 7, **stands))
    assert rises(by_fragments(ACROSS, 8, **stands))
    assert rises(by_fragments(ACROSS, 4, **surface(STILL, 0.106)))  # 5.5: too unsure to contradict


def test_along_the_line_of_sight_eight_ends_must_agree() -> None:
    assert rises(by_fragments(ALONG, 8))
    assert not rises(by_fragments(ALONG, 7))


def test_a_contradicting_surface_denies_motion_along_for_any_number_of_ends() -> None:
    assert not rises(by_fragments(ALONG, 40, **surface(STILL, 0.08)))
    assert rises(by_fragments(ALONG, 8, **surface(STILL, 0.106)))


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_fragments_and_surface_that_say_the_same_prove_together(direction: Speed) -> None:
    """Two ends and 0.55 of the threshold: 0.16 / (0.0131 + 0.0009) = 11.4, between 8.8 and 16."""
    x, y, z = direction
    slow: Speed = (0.4 * x, 0.4 * y, 0.4 * z)
    both: dict[str, Any] = {"covariance": covariance(0.0131), "own_covariance": covariance(0.045)}
    agrees = surface(slow, 0.02)  # 0.16 / 0.0209 = 7.7, more than 2.5 squared
    assert rises(by_fragments(slow, 2, **both, **agrees))
    assert not rises(by_fragments(slow, 1, **both, **agrees))
    assert not rises(by_fragments(slow, 2, **both))
    assert not rises(by_fragments(slow, 2, **both, **surface(slow, 0.03)))  # 5.2
    assert not rises(by_fragments(slow, 2, **both, **surface((-slow[0], -slow[1], -slow[2]), 0.02)))
    assert not rises(by_fragments(slow, 2, **{**both, "covariance": covariance(0.019)}, **agrees))  # 8.0
    assert not rises(by_fragments(slow, 2, **{**both, "own_covariance": covariance(0.06)}, **agrees))  # 2.6


def shared(velocity: Speed, **changes: Any) -> MotionEvidence:
    """Two ends and the surface say the same of 0.4 m/s, with just enough proof together."""
    both: dict[str, Any] = {"covariance": covariance(0.0131), "own_covariance": covariance(0.045)}
    return by_fragments(velocity, 2, **{**both, **surface(velocity, 0.02), **changes})


def test_a_surface_whose_area_jumps_confirms_nothing() -> None:
    """As a wrong match of a wall of bricks, which comes and goes."""
    jumps: dict[str, Any] = {"keeps_area": np.array([False])}
    assert not rises(shared((0.0, 0.0, -0.4), **jumps))
    assert not rises(shared((0.4, 0.0, 0.0), **jumps))
    assert rises(by_fragments(ACROSS, 4, **jumps))  # fragments alone prove it as before


def test_a_surface_of_a_few_cells_confirms_no_motion_along_the_line_of_sight() -> None:
    """They move along it together, with the depth noise that they share."""
    assert rises(shared((0.0, 0.0, -0.4), cells=np.array([48])))
    assert not rises(shared((0.0, 0.0, -0.4), cells=np.array([47])))
    assert rises(shared((0.4, 0.0, 0.0), cells=np.array([20])))


@pytest.mark.parametrize(("own_mps", "proves"), [(2.3, True), (2.5, False)])
def test_ends_that_agree_on_an_impossible_velocity_confirm_nothing(own_mps: float, proves: bool) -> None:
    """1.6 times 1.5 m/s are 2.4; 5.3 / 1.5 is more than the 3 squared sigmas that a frame must have."""
    own = {"own_velocity": np.array([[0.0, 0.0, -own_mps]]), "own_covariance": covariance(1.5)}
    assert rises(shared((0.0, 0.0, -0.4), **own)) == proves


def test_a_static_surface_where_space_was_free_has_arrived() -> None:
    """Eight cells, a twentieth of all, and a speed of half the squared sigmas."""
    assert rises(one(ACROSS, arrived=np.array([8])))
    assert not rises(one(ACROSS, arrived=np.array([7])))
    assert rises(one(ACROSS, arrived=np.array([8]), cells=np.array([155])))
    assert not rises(one(ACROSS, arrived=np.array([8]), cells=np.array([165])))
    assert not rises(one(ACROSS, arrived=np.array([8]), covariance=covariance(0.09)))  # 7.0


def test_much_that_has_come_needs_no_speed() -> None:
    assert rises(one(STILL, arrived=np.array([20])))
    assert not rises(one(STILL, arrived=np.array([19]), cells=np.array([90])))
    assert not rises(one(STILL, arrived=np.array([20]), cells=np.array([110])))


def test_much_that_came_before_it_stopped_is_no_proof_that_it_still_goes() -> None:
    came = one(STILL, arrived=np.array([60]))
    assert verdict(came, 1.0, True).evidence[0] < 1.0
    slow = one((0.2, 0.0, 0.0), arrived=np.array([60]))
    assert verdict(slow, 1.0, True).evidence[0] < 1.0
    assert verdict(one((0.22, 0.0, 0.0), arrived=np.array([60])), 1.0, True).evidence[0] > 1.0
    # A speed that is not known is not slow: 0.44 m/s in all, twice the least speed of 0.21 m/s.
    assert verdict(replace(came, covariance=covariance(0.065)), 1.0, True).evidence[0] > 1.0
    assert verdict(replace(came, covariance=covariance(0.055)), 1.0, True).evidence[0] < 1.0


def test_a_part_that_arrives_in_several_frames_is_proof_without_a_known_velocity() -> None:
    unknown = {"covariance": covariance(1.0), "arrived": np.array([8]), "cells": np.array([160])}
    assert rises(one(STILL, **unknown, arriving_s=np.array([0.13])))
    assert not rises(one(STILL, **unknown, arriving_s=np.array([0.12])))
    # Not where nothing arrives in this frame, nor too small a share, nor for what is known to stand still.
    assert not rises(one(STILL, **{**unknown, "arrived": np.array([7])}, arriving_s=np.array([0.2])))
    assert not rises(one(STILL, **{**unknown, "cells": np.array([161])}, arriving_s=np.array([0.2])))
    assert not rises(one(STILL, **{**unknown, "covariance": covariance(0.01)}, arriving_s=np.array([0.2])))


EVIDENT = {
    "fragments across": by_fragments(ACROSS, 20),
    "fragments along": by_fragments(ALONG, 20),
    "surface": by_surface(ACROSS, 1.0),
    "free rims": by_rim(),
    "arrival": one(ACROSS, arrived=np.array([10])),
    "much has come": one(STILL, arrived=np.array([60])),
    "lasting arrival": one(
        STILL, covariance=covariance(1.0), arrived=np.array([10]), arriving_s=np.array([0.2])
    ),
}


@pytest.mark.parametrize("proof", EVIDENT)
def test_no_proof_counts_while_the_cameras_own_motion_is_unknown(proof: str) -> None:
    assert rises(EVIDENT[proof])
    assert not rises(replace(EVIDENT[proof], trusted=False))


@pytest.mark.parametrize("proof", EVIDENT)
def test_no_proof_counts_for_a_wall(proof: str) -> None:
    assert not rises(replace(EVIDENT[proof], size_m=np.array([3.1])))


def test_no_proof_counts_for_a_speed_that_nothing_has() -> None:
    assert rises(by_fragments((2.3, 0.0, 0.0), 20))  # 1.6 times 1.5 m/s are 2.4
    assert not rises(by_fragments((2.5, 0.0, 0.0), 20))


def test_many_ends_that_deny_standing_still_prove_a_motion_though_they_disagree() -> None:
    assert rises(by_fragments(ACROSS, 12, 0.1, restless=np.array([True])))
    assert not rises(by_fragments(ACROSS, 12, 0.1))


def test_unrest_of_many_ends_proves_what_the_filter_says_by_half() -> None:
    """Limbs: none agrees with another, and hardly any stands still. 0.64 / 0.0759 = 8.4, more than 8."""
    half = {"covariance": covariance(0.075), "ends": np.array([8]), "restless": np.array([True])}
    assert rises(one(ALONG, **half))
    assert not rises(one(ALONG, **{**half, "restless": np.array([False])}))
    assert not rises(one(ALONG, **{**half, "ends": np.array([7])}))
    assert not rises(one(ALONG, **{**half, "covariance": covariance(0.085)}))  # 7.4
    assert not rises(one((0.0, 0.0, -0.2), **half, trusted=False))


def test_many_ends_that_deny_for_long_bear_out_a_velocity_that_is_only_likely() -> None:
    slow = {"covariance": covariance(0.14), "ends": np.array([8]), "restless": np.array([True])}  # 4.5
    assert not rises(one(ACROSS, **slow, restless_s=np.array([0.35])))
    assert rises(one(ACROSS, **slow, restless_s=np.array([0.45])))
    unlikely = {**slow, "covariance": covariance(0.17)}  # 3.7
    assert not rises(one(ACROSS, **unlikely, restless_s=np.array([0.45])))
    assert not rises(one(ACROSS, **{**slow, "ends": np.array([7])}, restless_s=np.array([0.45])))


def test_tracks_are_judged_each_by_itself() -> None:
    all_of = [*EVIDENT.values(), one(ACROSS), by_fragments(ACROSS, 3)]
    of_all = ("up", "trusted", "reckoned", "borne_out")
    names = [name for name in MotionEvidence.__slots__ if name not in of_all]
    together = MotionEvidence(
        **{name: np.concatenate([getattr(seen, name) for seen in all_of]) for name in names},
        up=LEVEL_UP,
        trusted=True,
        reckoned=True,
        borne_out=1.0,
    )
    count = len(all_of)
    joint = judge(together, np.full(count, 0.6), np.ones(count, np.bool_), DT_S, SETTINGS)
    for k, seen in enumerate(all_of):
        alone = verdict(seen, 0.6, True)
        assert joint.evidence[k] == pytest.approx(alone.evidence[0])
        assert joint.moving[k] == alone.moving[0]
        assert joint.confidence[k] == pytest.approx(alone.confidence[0])
