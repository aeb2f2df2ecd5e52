"""How fast a verdict comes, how long it is held, and what ends it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.support.judging import (
    ACROSS,
    DT_S,
    SETTINGS,
    STILL,
    by_fragments,
    by_surface,
    covariance,
    one,
    rises,
    verdict,
)
from vision.bodies.judgement import Verdict, judge
from vision.bodies.motion_evidence import MotionEvidence


def rise_s(seen: MotionEvidence) -> float:
    """How long this evidence takes to a verdict, in frames too short for the limit of one frame."""
    brief = judge(seen, np.zeros(1), np.zeros(1, np.bool_), 0.01, SETTINGS)
    return 0.01 / float(brief.evidence[0])


PLAIN_S = rise_s(by_fragments(ACROSS, 4))


def test_a_verdict_takes_about_a_tenth_of_a_second_of_proof() -> None:
    assert 0.05 <= PLAIN_S <= 0.12


def test_a_verdict_comes_sooner_with_overwhelming_proof() -> None:
    """Half as many ends again: one and a half times as fast; never more than two and a half times."""
    assert rise_s(by_fragments(ACROSS, 6)) == pytest.approx(PLAIN_S / 1.5)
    assert rise_s(by_fragments(ACROSS, 40)) == pytest.approx(PLAIN_S / 2.5)


def test_at_thirty_hertz_two_frames_are_enough_with_odometry_and_three_are_needed_without() -> None:
    seen, evidence, moving = by_fragments(ACROSS, 4), np.zeros(1), np.zeros(1, np.bool_)
    frames = {}
    for reckoned in (True, False):
        verdict = Verdict(evidence, moving, evidence, moving, moving)
        frames[reckoned] = 0
        while not verdict.moving[0]:
            known = replace(seen, reckoned=reckoned)
            verdict = judge(known, verdict.evidence, verdict.moving, 1.0 / 30.0, SETTINGS)
            frames[reckoned] += 1
    assert frames == {True: 2, False: 3}


def test_proof_counts_by_how_well_the_cameras_own_motion_is_borne_out() -> None:
    seen = by_fragments(ACROSS, 40)
    assert rise_s(replace(seen, borne_out=0.25)) == pytest.approx(4.0 * rise_s(seen))
    assert verdict(seen).evidence[0] == 0.5
    assert verdict(replace(seen, borne_out=0.25)).evidence[0] == 0.125


def test_evidence_falls_slowly_while_one_fragment_still_moves() -> None:
    half = 0.5
    waiting = judge(by_fragments(ACROSS, 2), np.full(1, half), np.zeros(1, np.bool_), 0.03, SETTINGS)
    assert half - 0.02 < waiting.evidence[0] < half  # two seconds for all of it
    nothing = judge(one(ACROSS), np.full(1, half), np.zeros(1, np.bool_), 0.03, SETTINGS)
    assert nothing.evidence[0] < half - 0.09


def test_one_frame_alone_proves_nothing_however_long_ago_the_one_before_was() -> None:
    slow = judge(by_fragments(ACROSS, 40), np.zeros(1), np.zeros(1, np.bool_), 0.4, SETTINGS)
    assert slow.evidence[0] == 0.5
    assert not slow.moving[0]


@pytest.mark.parametrize("name", ["covariance", "own_covariance"])
def test_pace_is_limited_by_the_weaker_of_filter_and_frame(name: str) -> None:
    """0.64 / (0.0191 + 0.0009) = 32, twice the threshold."""
    changes: dict[str, Any] = {name: covariance(0.0191)}
    assert rise_s(by_fragments(ACROSS, 40, **changes)) == pytest.approx(PLAIN_S / 2.0)


def test_pace_without_fragments_is_the_plain_one() -> None:
    assert rise_s(by_surface(ACROSS, 1.0)) == pytest.approx(PLAIN_S)


def test_moving_from_full_evidence_on_until_none_is_left() -> None:
    few, step = by_fragments(ACROSS, 4), min(DT_S / PLAIN_S, 0.5)
    assert not verdict(few, 0.99 - step).moving[0]
    assert verdict(few, 1.01 - step).moving[0]
    doubtful = one(ACROSS, covariance=covariance(0.2))
    assert verdict(doubtful, 0.2, True).moving[0]
    assert not verdict(doubtful, 0.1, True).moving[0]


def test_evidence_has_a_ceiling() -> None:
    assert verdict(by_fragments(ACROSS, 40), 1.4, True).evidence[0] == 1.5


def test_without_new_proof_a_fast_mover_is_held_for_long() -> None:
    assert verdict(one(ACROSS), 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 2.0)


@pytest.mark.parametrize(
    "seen",
    [one((0.13, 0.0, 0.0)), one(ACROSS, covariance=covariance(0.2))],
    ids=["slow", "doubtful"],
)
def test_a_mover_that_is_slow_or_doubtful_is_not_held(seen: MotionEvidence) -> None:
    assert verdict(seen, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.3)


def test_a_mover_whose_centre_does_not_go_is_not_held() -> None:
    """Its place in the grid has fallen to the wall that it went by, its velocity goes on."""
    stays = one(ACROSS, advances=np.array([False]))
    assert verdict(stays, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.3)
    came = replace(stays, arrived=np.array([10]), covariance=covariance(0.2))
    assert verdict(came, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 2.0)


def test_evidence_of_a_static_track_is_not_held() -> None:
    assert verdict(one(ACROSS), 0.5, False).evidence[0] == pytest.approx(0.5 - DT_S / 0.3)


def test_a_restless_suspect_is_not_forgotten() -> None:
    restless = one(restless=np.array([True]))
    assert verdict(restless, 0.3).evidence[0] == pytest.approx(0.3 - DT_S / 2.0)
    assert verdict(one(), 0.3).evidence[0] == pytest.approx(0.3 - DT_S / 0.3)


def test_an_arrival_holds_a_doubtful_mover() -> None:
    seen = one(ACROSS, covariance=covariance(0.2), arrived=np.array([10]))
    assert verdict(seen, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 2.0)


def test_fragments_that_stand_still_end_a_motion_fastest() -> None:
    stands = {"own_velocity": np.zeros((1, 3)), "own_covariance": covariance(0.0025)}
    stopped = one(ACROSS, **stands, ends=np.array([4]), agreement=np.array([1.0]))
    assert verdict(stopped, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.12)
    for changes in (
        {"ends": np.array([3])},
        {"own_covariance": covariance(0.005)},  # sigma 0.12, more than half of 0.21
        {"own_velocity": np.array([[0.13, 0.0, 0.0]])},  # more than 0.6 of 0.21
    ):
        assert verdict(replace(stopped, **changes), 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 2.0)


def test_a_filter_that_knows_that_it_stands_ends_a_motion_as_fast() -> None:
    stopped = one((0.12, 0.0, 0.0), covariance=covariance(0.05))  # sigma 0.39 m/s, less than twice 0.21
    assert verdict(stopped, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.12)
    for changes in (
        {"velocity": np.array([[0.13, 0.0, 0.0]])},  # more than 0.6 of 0.21
        {"covariance": covariance(0.065)},  # sigma 0.44 m/s
    ):
        assert verdict(replace(stopped, **changes), 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.3)
    assert verdict(stopped, 0.5, False).evidence[0] == pytest.approx(0.5 - DT_S / 0.3)  # it never went


def test_nothing_holds_a_mover_that_nothing_tells_from_what_stands_around_it() -> None:
    """Its cells would go on over the wall that it went by, and bear out the velocity that has them go."""
    ghost = one(ACROSS, border_is_guess=np.array([True]))
    assert verdict(ghost, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.12)
    told = replace(ghost, ends=np.array([2]), agreement=np.array([1.0]))
    for seen in (told, replace(ghost, arrived=np.array([10])), one(ACROSS)):
        assert verdict(seen, 1.0, True).evidence[0] >= 1.0 - DT_S / 2.0 - 1e-9
    assert verdict(ghost, 0.5, False).evidence[0] == pytest.approx(0.5 - DT_S / 0.3)


def test_a_verdict_tells_who_stands_for_sure() -> None:
    stands = {"own_velocity": np.zeros((1, 3)), "own_covariance": covariance(0.0025)}
    seen = one(STILL, **stands, ends=np.array([4]), agreement=np.array([1.0]))
    assert verdict(seen).surely_static[0]
    assert not verdict(replace(seen, ends=np.array([3]))).surely_static[0]


def test_fragments_that_stand_still_overrule_every_other_proof() -> None:
    stands = {"own_velocity": np.zeros((1, 3)), "own_covariance": covariance(0.0025)}
    seen = by_surface(ACROSS, 1.0, **stands, ends=np.array([4]), agreement=np.array([1.0]))
    assert not rises(seen)
    assert rises(replace(seen, ends=np.array([3])))


def test_confidence_by_hand() -> None:
    # 0.64 / (0.01 + 0.0009) = 58.7
    assert verdict(one(ACROSS)).confidence[0] == pytest.approx(1.0 - np.exp(-(0.64 / 0.0109) / 30.0))
    assert verdict(one()).confidence[0] == 0.0
