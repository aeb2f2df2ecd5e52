"""Two sensors of one motion, compared second by second."""

from __future__ import annotations

from hal.chassis.disagreement import Disagreement

MS = 1_000_000


def fed(expected_m: float, measured_m: float, steps: int) -> Disagreement:
    """Every 20 ms so much by each."""
    disagreement = Disagreement("they disagree", "m", slack=0.1, ratio=0.5)
    for k in range(steps):
        disagreement.expect(expected_m)
        disagreement.compare(measured_m, k * 20 * MS)
    return disagreement


def test_nothing_is_said_before_a_second_is_full() -> None:
    assert fed(1.0, 0.0, 50).sentence == ""
    assert fed(1.0, 0.0, 51).sentence == "they disagree: 0.00 m against 50.00 m"


def test_the_slack_and_the_share_may_be_apart() -> None:
    assert fed(0.02, 0.031, 60).sentence == "", "0.58 m apart in 1 m, and 0.6 m is allowed"
    assert fed(0.02, 0.0325, 60).sentence != ""
    assert fed(0.0, 0.0019, 60).sentence == ""
    assert fed(0.0, -0.0022, 60).sentence != ""


def test_disagreement_is_withdrawn_when_both_agree_again() -> None:
    disagreement = fed(1.0, 0.0, 51)
    for k in range(51, 110):
        disagreement.expect(0.01)
        disagreement.compare(0.01, k * 20 * MS)
    assert disagreement.sentence == ""


def test_beginning_anew_forgets_what_was_apart() -> None:
    disagreement = fed(1.0, 0.0, 50)
    disagreement.restart(50 * 20 * MS)
    for k in range(51, 110):
        disagreement.expect(0.01)
        disagreement.compare(0.01, k * 20 * MS)
    assert disagreement.sentence == ""
