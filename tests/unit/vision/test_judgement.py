"""Each rule of the verdict by itself, on evidence made by hand.

The camera looks along z, the track is 3 m away. Settings: 4 sigmas (16 squared), slowest speed 0.15 m/s and
0.02 m/s for each metre of distance, 0.21 m/s at 3 m.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config.perception import MotionSettings
from hal.types import FloatArray
from vision.judgement import MotionEvidence, Verdict, judge
from vision.line_of_sight import split, squared_sigmas

SETTINGS = MotionSettings(max_speed_mps=1.5, min_speed_mps=0.15, sigmas=4.0)
DT_S = 0.05
SURE = 0.01  # (m/s)^2: 0.8 m/s are 7.7 sigmas
UNKNOWN = 9.0
ACROSS = (0.8, 0.0, 0.0)
ALONG = (0.0, 0.0, -0.8)
STILL = (0.0, 0.0, 0.0)
Speed = tuple[float, float, float]


def covariance(variance: float) -> FloatArray:
    return variance * np.eye(3)[None]


def one(velocity: Speed = STILL, **changes: Any) -> MotionEvidence:
    """A track of which fragments, surface and arrivals say nothing; velocity is the filter's."""
    plain = MotionEvidence(
        sight=np.array([[0.0, 0.0, 1.0]]),
        distance_m=np.array([3.0]),
        velocity=np.array([velocity]),
        covariance=covariance(SURE),
        own_velocity=np.zeros((1, 3)),
        own_covariance=covariance(UNKNOWN),
        surface_velocity=np.zeros((1, 3)),
        surface_covariance=covariance(UNKNOWN),
        ends=np.array([0]),
        agreement=np.array([0.0]),
        restless=np.array([False]),
        arrived=np.array([0]),
        cells=np.array([100]),
        size_m=np.array([0.8]),
        clean_s=np.array([0.0]),
        view_radps=np.array([0.0]),
        growth_mps=np.array([0.0]),
        trusted=True,
        reckoned=True,
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


def test_nothing_said_is_nothing_proved() -> None:
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


def test_what_creeps_is_static_however_sure() -> None:
    sure: dict[str, Any] = {"covariance": covariance(1e-4), "own_covariance": covariance(1e-4)}
    assert not rises(by_fragments((0.20, 0.0, 0.0), 20, **sure))
    assert rises(by_fragments((0.22, 0.0, 0.0), 20, **sure))
    assert not rises(by_fragments((0.22, 0.0, 0.0), 20, **sure, distance_m=np.array([5.0])))


def test_a_surface_that_contradicts_denies_a_motion_across_unless_many_ends_agree() -> None:
    stands = surface(STILL, 0.08)  # 0.64 / (0.01 + 0.08 + 0.0009) = 7.04, more than 2.5 squared
    assert not rises(by_fragments(ACROSS, 7, **stands))
    assert rises(by_fragments(ACROSS, 8, **stands))
    assert rises(by_fragments(ACROSS, 4, **surface(STILL, 0.106)))  # 5.5: too unsure to contradict


def test_along_the_line_of_sight_eight_ends_must_agree() -> None:
    assert rises(by_fragments(ALONG, 8))
    assert not rises(by_fragments(ALONG, 7))


def test_a_surface_that_contradicts_denies_a_motion_along_whatever_the_number_of_ends() -> None:
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


def by_surface(velocity: Speed, clean_s: float, **changes: Any) -> MotionEvidence:
    """No fragment at all: a plain surface that goes."""
    return one(velocity, **{**surface(velocity, SURE), "clean_s": np.array([clean_s]), **changes})


def test_a_surface_seen_long_enough_without_a_break_proves_by_itself() -> None:
    assert rises(by_surface(ACROSS, 0.25))
    assert not rises(by_surface(ACROSS, 0.2))
    assert rises(by_surface(ALONG, 0.5))
    assert not rises(by_surface(ALONG, 0.45))  # noise of depth is shared by neighbours: longer


@pytest.mark.parametrize(("looks", "proves"), [(2, False), (3, True)])
@pytest.mark.parametrize("velocity", [ACROSS, ALONG])
def test_a_surface_proves_only_after_three_looks_however_few_frames_there_are(
    velocity: Speed, looks: int, proves: bool
) -> None:
    dt_s = 0.4
    seen = by_surface(velocity, looks * dt_s)
    rising = judge(seen, np.array([0.0]), np.array([False]), dt_s, SETTINGS).evidence[0] > 0.0
    assert rising == proves


def test_a_surface_proves_only_if_it_is_compact() -> None:
    assert rises(by_surface(ACROSS, 1.0, size_m=np.array([2.1])))
    assert not rises(by_surface(ACROSS, 1.0, size_m=np.array([2.3])))


def test_a_surface_proves_only_beyond_its_doubt() -> None:
    assert not rises(by_surface(ACROSS, 1.0, **surface(ACROSS, 0.042)))


def test_a_new_viewpoint_makes_the_middle_of_a_static_surface_wander() -> None:
    # 0.21 + 0.5 * 1.4 rad/s * 0.8 m = 0.77, with 1.6 rad/s 0.85: faster than 0.8 m/s
    assert rises(by_surface(ACROSS, 1.0, view_radps=np.array([1.4])))
    assert not rises(by_surface(ACROSS, 1.0, view_radps=np.array([1.6])))


def test_a_surface_that_comes_to_be_seen_makes_its_middle_wander_too() -> None:
    assert rises(by_surface(ACROSS, 1.0, growth_mps=np.array([0.55])))
    assert not rises(by_surface(ACROSS, 1.0, growth_mps=np.array([0.62])))


def test_what_stands_where_space_was_free_has_come() -> None:
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


EVIDENT = {
    "fragments across": by_fragments(ACROSS, 20),
    "fragments along": by_fragments(ALONG, 20),
    "surface": by_surface(ACROSS, 1.0),
    "arrival": one(ACROSS, arrived=np.array([10])),
    "much has come": one(STILL, arrived=np.array([60])),
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
        verdict = Verdict(evidence, moving, evidence)
        frames[reckoned] = 0
        while not verdict.moving[0]:
            known = replace(seen, reckoned=reckoned)
            verdict = judge(known, verdict.evidence, verdict.moving, 1.0 / 30.0, SETTINGS)
            frames[reckoned] += 1
    assert frames == {True: 2, False: 3}


def test_many_ends_that_deny_standing_still_prove_a_motion_though_they_disagree() -> None:
    assert rises(by_fragments(ACROSS, 12, 0.1, restless=np.array([True])))
    assert not rises(by_fragments(ACROSS, 12, 0.1))


def test_what_was_shown_is_not_forgotten_while_one_fragment_still_shows_it() -> None:
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
    assert verdict(one(), 0.2, True).moving[0]
    assert not verdict(one(), 0.1, True).moving[0]


def test_evidence_has_a_ceiling() -> None:
    assert verdict(by_fragments(ACROSS, 40), 1.4, True).evidence[0] == 1.5


def test_without_new_proof_a_fast_mover_is_held_for_long() -> None:
    assert verdict(one(ACROSS), 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 2.0)


@pytest.mark.parametrize(
    "seen",
    [one((0.12, 0.0, 0.0)), one(ACROSS, covariance=covariance(0.2))],
    ids=["slow", "doubtful"],
)
def test_a_mover_that_is_slow_or_doubtful_is_not_held(seen: MotionEvidence) -> None:
    assert verdict(seen, 1.0, True).evidence[0] == pytest.approx(1.0 - DT_S / 0.3)


def test_what_does_not_move_yet_is_not_held() -> None:
    assert verdict(one(ACROSS), 0.5, False).evidence[0] == pytest.approx(0.5 - DT_S / 0.3)


def test_unrest_of_many_ends_proves_what_the_filter_says_by_half() -> None:
    """Limbs: none agrees with another, and hardly any stands still. 0.64 / 0.0759 = 8.4, more than 8."""
    half = {"covariance": covariance(0.075), "ends": np.array([8]), "restless": np.array([True])}
    assert rises(one(ALONG, **half))
    assert not rises(one(ALONG, **{**half, "restless": np.array([False])}))
    assert not rises(one(ALONG, **{**half, "ends": np.array([7])}))
    assert not rises(one(ALONG, **{**half, "covariance": covariance(0.085)}))  # 7.4
    assert not rises(one((0.0, 0.0, -0.2), **half, trusted=False))


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


def test_fragments_that_stand_still_overrule_every_other_proof() -> None:
    stands = {"own_velocity": np.zeros((1, 3)), "own_covariance": covariance(0.0025)}
    seen = by_surface(ACROSS, 1.0, **stands, ends=np.array([4]), agreement=np.array([1.0]))
    assert not rises(seen)
    assert rises(replace(seen, ends=np.array([3])))


def test_confidence_by_hand() -> None:
    # 0.64 / (0.01 + 0.0009) = 58.7
    assert verdict(one(ACROSS)).confidence[0] == pytest.approx(1.0 - np.exp(-(0.64 / 0.0109) / 30.0))
    assert verdict(one()).confidence[0] == 0.0


def test_tracks_are_judged_each_by_itself() -> None:
    all_of = [*EVIDENT.values(), one(ACROSS), by_fragments(ACROSS, 3)]
    names = [name for name in MotionEvidence.__slots__ if name not in ("trusted", "reckoned")]
    together = MotionEvidence(
        **{name: np.concatenate([getattr(seen, name) for seen in all_of]) for name in names},
        trusted=True,
        reckoned=True,
    )
    count = len(all_of)
    joint = judge(together, np.full(count, 0.6), np.ones(count, np.bool_), DT_S, SETTINGS)
    for k, seen in enumerate(all_of):
        alone = verdict(seen, 0.6, True)
        assert joint.evidence[k] == pytest.approx(alone.evidence[0])
        assert joint.moving[k] == alone.moving[0]
        assert joint.confidence[k] == pytest.approx(alone.confidence[0])


def test_squared_sigmas_by_hand() -> None:
    """Along x, y, z: 0.3, 0.4, 0.5 m/s with variances 0.0091, 0.0391, 0.2491 and 0.0009 added to each."""
    velocity = np.array([[0.3, 0.4, 0.5]])
    doubt = np.diag([0.0091, 0.0391, 0.2491])[None]
    # 0.09 / 0.01 + 0.16 / 0.04 + 0.25 / 0.25
    assert squared_sigmas(velocity, doubt)[0] == pytest.approx(9.0 + 4.0 + 1.0)
    ahead = split(velocity, doubt, np.array([[0.0, 0.0, 1.0]]))
    assert ahead.along[0] == pytest.approx(1.0)
    assert ahead.across[0] == pytest.approx(13.0)
    aside = split(velocity, doubt, np.array([[1.0, 0.0, 0.0]]))
    assert aside.along[0] == pytest.approx(9.0)
    assert aside.across[0] == pytest.approx(5.0)


def test_many_velocities_are_split_at_once_as_one_by_one() -> None:
    """Two of each of two tracks: the parts along their lines of sight, with variance, and what is left."""
    velocity = np.array([[[0.3, 0.4, 0.5], [0.0, 0.0, 1.0]], [[-0.1, 0.2, 0.0], [1.0, 2.0, 2.0]]])
    doubt = np.array([[0.04 * np.eye(3), 0.09 * np.eye(3)], [0.01 * np.eye(3), 0.25 * np.eye(3)]])
    sight = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    together = split(velocity, doubt, sight)
    np.testing.assert_allclose(together.value, [[0.5, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(together.variance, [[0.04, 0.09], [0.01, 0.25]])
    np.testing.assert_allclose(together.rest[1], [[-0.1, 0.2, 0.0], [0.0, 2.0, 2.0]])
    for k in range(2):
        alone = split(velocity[k], doubt[k], sight)
        np.testing.assert_allclose(together[k].along, alone.along)
        np.testing.assert_allclose(together[k].across, alone.across)
