"""Suspects cut out of what connected depth takes for one large thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import detection
from tests.support.grids import CAMERA, COLUMNS, ROWS, block, grid_of, labelled, nearest, plate, wall
from vision.bodies import carving
from vision.bodies.arrivals import Changes
from vision.bodies.cutting import cut_out
from vision.bodies.tracks import Tracks
from vision.depth import regions
from vision.detection import Detection
from vision.motion import least_squares
from vision.motion.velocities import EndResiduals

CONFIG = PerceptionConfig()
FRAME = 12
BACK = wall(4.0)
WHOLE = np.ones((ROWS, COLUMNS), np.bool_)


NOWHERE = block((0, 0), (0, 0))
PERSON = block((20, 50), (30, 42))


def one_track(moving: bool = False, evidence: float = 0.0) -> Tracks:
    tracks = Tracks()
    tracks.start(np.array([[0.0, 0.0, 4.0]]), 0.2, 1.5, evidence, 0)
    tracks.moving[:] = moving
    return tracks


def carve(
    tracks: Tracks,
    arrived: NDArray[np.bool_],
    depth_m: FloatArray = BACK,
    of_track: NDArray[np.bool_] = WHOLE,
    seen: Detection | None = None,
    stayed: NDArray[np.bool_] = NOWHERE,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The labels before and after; the one track has of_track."""
    grid = grid_of(depth_m)
    labels = labelled(of_track)
    measured = regions.measure(grid, labels, 1)
    looked = detection(grid, FRAME) if seen is None else replace(seen, grid=grid)
    velocities = least_squares.fragment_velocities(looked.motion, CONFIG.motion.max_speed_mps)
    changes = Changes(arrived, arrived.ravel().nonzero()[0], stayed, 0.5)
    cuts = carving.cuts(tracks, looked, labels, measured, changes, velocities, CONFIG)
    after, _ = cut_out(tracks, looked, labels, measured, cuts, CONFIG.motion.max_speed_mps)
    return labels, after


def test_arrived_surface_before_a_wall_is_cut_out_as_a_suspect() -> None:
    tracks = one_track()
    _, labels = carve(tracks, PERSON)
    assert len(tracks) == 2
    assert (labels[PERSON] == 2).all()
    cut = np.count_nonzero(labels == 2)
    assert np.count_nonzero(PERSON) <= cut <= np.count_nonzero(block((19, 51), (29, 43)))  # one cell around
    assert (labels[~block((19, 51), (29, 43))] == 1).all()
    assert 0.0 < tracks.evidence[1] < 1.0  # neither known as moving nor forgotten
    assert not tracks.moving[1]
    # Its middle: columns 30 to 41 and rows 20 to 49 at 4 m.
    x = (1.5 + 4 * 35.5 - CAMERA.cx) / CAMERA.fx * 4.0
    y = (1.5 + 4 * 34.5 - CAMERA.cy) / CAMERA.fy * 4.0
    np.testing.assert_allclose(tracks.state[1, :3], [x, y, 4.0], atol=0.03)


def test_without_evidence_the_labels_stay_the_same() -> None:
    tracks = one_track()
    before, after = carve(tracks, NOWHERE)
    assert (after == before).all()
    assert len(tracks) == 1


def test_finding_the_cuts_starts_no_track() -> None:
    tracks, grid, labels = one_track(), grid_of(BACK), labelled(WHOLE)
    looked, measured = detection(grid, FRAME), regions.measure(grid, labels, 1)
    velocities = least_squares.fragment_velocities(looked.motion, CONFIG.motion.max_speed_mps)
    changes = Changes(PERSON, PERSON.ravel().nonzero()[0], NOWHERE, 0.5)
    (cut,) = carving.cuts(tracks, looked, labels, measured, changes, velocities, CONFIG)
    assert (len(tracks), labels.max(), cut.evidence) == (1, 1, carving.SUSPECT_EVIDENCE)
    assert np.isin(np.flatnonzero(PERSON), cut.cells).all()


def test_a_few_cells_are_no_suspect() -> None:
    tracks = one_track()
    before, after = carve(tracks, block((20, 21), (30, 31)))  # nine with those around
    assert (after == before).all()
    assert len(tracks) == 1


def test_nothing_is_cut_out_of_suspects() -> None:
    before, after = carve(one_track(False, 0.2), PERSON)
    assert (after == before).all()


def test_a_mover_grown_over_a_wall_keeps_what_there_is_evidence_of_and_as_much_as_one_body_has() -> None:
    tracks = one_track(True, 1.0)
    before, after = carve(tracks, PERSON)
    assert (after[PERSON] == 1).all()
    x_m = grid_of(BACK).x * 4.0
    middle_m = np.median(x_m[29:43])
    beside = np.broadcast_to(np.abs(x_m - middle_m) > 0.5 * 0.85, before.shape)
    assert (after[(before == 1) & ~beside] == 1).all()
    assert (after[(before == 1) & beside & ~block((19, 51), (29, 43))] == 2).all()
    assert tracks.moving.tolist() == [True, False]
    assert tracks.evidence.tolist() == [1.0, 0.0]  # the wall has to prove its motion itself


def test_leg_without_evidence_is_not_cut_off_with_the_post_behind() -> None:
    """A person has grown over a post two metres behind; his legs show no motion in this frame."""
    body, post = block((10, 50), (30, 40)), block((5, 60), (40, 44))
    depth_m = np.where(body, 4.0, np.where(post, 6.0, 0.0))
    tracks = one_track(True, 1.0)
    _, after = carve(tracks, block((10, 30), (30, 40)), depth_m, body | post)
    assert (after[body] == 1).all()
    assert (after[post & ~block((9, 31), (29, 41))] == 2).all()


def test_bystander_who_has_stayed_is_cut_off_from_who_walks_by() -> None:
    walker, bystander = block((10, 50), (30, 40)), block((10, 50), (40, 46))
    wall_beside = block((5, 60), (50, 79))
    own = walker | bystander | block((30, 32), (46, 50)) | wall_beside
    _, after = carve(one_track(True, 1.0), walker, np.where(own, 4.0, 0.0), own, stayed=bystander)
    assert (after[walker] == 1).all()
    assert (after[bystander & ~block((9, 51), (29, 41))] == 2).all()


def test_a_mover_as_large_as_a_body_is_not_cut_back() -> None:
    body = plate(4.0, (-0.7, 0.7), (-0.8, 0.8))
    before, after = carve(one_track(True, 1.0), PERSON, body, body > 0.0)
    assert (after == before).all()


def test_a_mover_without_evidence_in_this_frame_is_not_cut_back() -> None:
    tracks = one_track(True, 1.0)
    _, after = carve(tracks, block((20, 21), (30, 31)))  # nine with those around: too few to go on with
    assert (after == 1).all()
    assert len(tracks) == 1


def test_nothing_is_cut_out_of_something_compact() -> None:
    """1.4 m wide: what has arrived there is all of it."""
    small = plate(4.0, (-0.7, 0.7), (-0.8, 0.8))
    tracks = one_track()
    before, after = carve(tracks, PERSON, small, small > 0.0)
    assert (after == before).all()
    large = plate(4.0, (-0.9, 0.9), (-0.8, 0.8))
    _, after = carve(tracks, PERSON, large, large > 0.0)
    assert (after == 2).any()


@pytest.mark.parametrize(
    ("width_m", "stands", "no_evidence_s", "cut"),
    [
        (1.4, True, np.inf, True),
        (1.4, True, 0.9, True),
        (1.4, True, 0.85, False),
        (1.4, False, 2.0, False),
        (1.0, True, 2.0, True),
        (0.8, True, 2.0, False),
    ],
)
def test_person_who_walks_up_to_a_static_table_is_cut_out_of_it(
    width_m: float, stands: bool, no_evidence_s: float, cut: bool
) -> None:
    """What has come to rest a moment ago is where free space was, too: that one is left whole, and so is who
    begins to go and is no wider than a body."""
    table = plate(4.0, (-0.5 * width_m, 0.5 * width_m), (-0.8, 0.8))
    tracks = one_track()
    tracks.surely_static[:], tracks.no_evidence_s[:] = stands, no_evidence_s
    _, after = carve(tracks, PERSON & (table > 0.0), table, table > 0.0)
    assert (after == 2).any() == cut


def test_two_who_arrive_apart_are_two_suspects() -> None:
    tracks = one_track()
    _, labels = carve(tracks, PERSON | block((20, 50), (55, 65)))
    assert len(tracks) == 3
    assert len(np.unique(labels[PERSON])) == 1
    assert labels[30, 35] != labels[30, 60]


def test_without_tracks_there_is_nothing_to_cut() -> None:
    labels = np.zeros((ROWS, COLUMNS), np.int32)
    grid = grid_of(BACK)
    measured = regions.measure(grid, labels, 0)
    looked = detection(grid, FRAME)
    velocities = least_squares.fragment_velocities(looked.motion, CONFIG.motion.max_speed_mps)
    changes = Changes(PERSON, PERSON.ravel().nonzero()[0], NOWHERE, 0.5)
    assert carving.cuts(Tracks(), looked, labels, measured, changes, velocities, CONFIG) == []


def fragments(columns: list[int], speed_mps: float, chi2: float) -> Detection:
    """Upright fragments in the middle of the wall at 4 m that go sideways with speed_mps."""
    count = len(columns)
    ends_px = np.array([[[c, 100.0], [c, 120.0]] for c in columns], np.float32)
    x = (ends_px.reshape(-1, 2)[:, 0].astype(float) - CAMERA.cx) / CAMERA.fx
    y = (ends_px.reshape(-1, 2)[:, 1].astype(float) - CAMERA.cy) / CAMERA.fy
    ray = np.stack((x, y), axis=1)
    lag_s = np.full(2 * count, 0.2)
    miss = np.stack((np.full(2 * count, speed_mps * 0.2), np.zeros(2 * count)), axis=1)
    motion = EndResiduals(
        static_m=np.column_stack((ray * 4.0 - miss, np.full(2 * count, 4.0))),
        ray=ray,
        lag_s=lag_s,
        residual_m=miss,
        covariance=np.tile([1e-5, 0.0, 1e-5], (2 * count, 1)),
        depth_effect=np.zeros((2 * count, 2)),
        depth_step_m=np.zeros(2 * count),
        depth_step_sigma_m=np.full(2 * count, 0.1),
        depth_lag_s=lag_s,
        static_chi2=np.full(2 * count, chi2),
        usable=np.ones(2 * count, np.bool_),
    )
    return replace(
        detection(grid_of(BACK), FRAME),
        ids=np.arange(count),
        ends_px=ends_px,
        near_m=np.full((count, 2), 4.0, np.float32),
        age_frames=np.full(count, 6, np.intp),
        motion=motion,
    )


def test_around_fragments_that_move_in_company_a_suspect_is_cut_out() -> None:
    tracks = one_track()
    seen = fragments([150, 166], 0.8, 60.0)
    _, labels = carve(tracks, NOWHERE, seen=seen)
    assert len(tracks) == 2
    # 0.2 m around the ends at 4 m are 15 px.
    columns = np.flatnonzero((labels == 2).any(axis=0)) * 4 + 1.5
    assert columns.min() == pytest.approx(150 - 15, abs=8)
    assert columns.max() == pytest.approx(166 + 15, abs=8)


def test_a_single_moving_fragment_cuts_nothing_out_at_first() -> None:
    """6 frames of 30 a second are 0.2 s."""
    before, after = carve(one_track(), NOWHERE, seen=fragments([150], 0.8, 60.0))
    assert (after == before).all()


@pytest.mark.parametrize(
    ("frames", "speed_mps", "upwards", "sigma_m", "cut"),
    [
        (8, 0.8, 0.0, 0.003, True),
        (7, 0.8, 0.0, 0.003, False),  # 0.23 s
        (30, 0.39, 0.0, 0.003, False),
        (30, 2.5, 0.0, 0.003, False),  # faster than is believed
        (30, 0.8, 0.35, 0.003, False),  # a fourth of it, and more, upwards
        (30, 0.8, 0.0, 0.1, False),  # not surely so fast
    ],
)
def test_a_single_fragment_that_has_gone_one_way_for_a_while_is_enough(
    frames: int, speed_mps: float, upwards: float, sigma_m: float, cut: bool
) -> None:
    """Somebody in plain clothes walks along a wall: depth cannot tell him from it."""
    seen = fragments([150], speed_mps, 60.0)
    residual_m = seen.motion.residual_m.copy()
    residual_m[:, 1] = -upwards * residual_m[:, 0]
    covariance = np.tile([sigma_m**2, 0.0, sigma_m**2], (2, 1))
    motion = replace(seen.motion, residual_m=residual_m, covariance=covariance)
    seen = replace(seen, motion=motion, age_frames=np.full(1, frames, np.intp))
    tracks = one_track()
    before, after = carve(tracks, NOWHERE, seen=seen)
    assert (after != before).any() == cut
    assert tracks.evidence.tolist() == ([0.0, carving.SUSPECT_EVIDENCE] if cut else [0.0])


def test_fragments_that_something_static_explains_cut_nothing_out() -> None:
    before, after = carve(one_track(), NOWHERE, seen=fragments([150, 158, 166], 0.8, 5.0))
    assert (after == before).all()


def test_nothing_is_cut_out_at_another_depth_than_the_fragments() -> None:
    """A person's fragments at 4 m; the cells around them belong to a wall at 6 m."""
    seen = fragments([150, 158, 166], 0.8, 60.0)
    before, after = carve(one_track(), NOWHERE, wall(6.0), seen=seen)
    assert (after == before).all()
    _, after = carve(
        one_track(), NOWHERE, nearest(wall(6.0), plate(4.2, (-0.4, 0.4), (-0.6, 0.6))), seen=seen
    )
    assert (after == 2).any()
