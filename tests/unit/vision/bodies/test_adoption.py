"""Which fragments belong to which track."""

from __future__ import annotations

import numpy as np

from vision.bodies.adoption import inherited

NONE = np.empty(0, np.int64)


def test_a_fragment_belongs_to_the_track_of_the_frame_before_if_both_are_still_there() -> None:
    known, owner = np.array([3, 5, 8, 9]), np.array([2, 7, -1, 4])
    # 4, 7 and 10 are new; 8 had no track; the track of 9 is gone.
    ids, tracks = np.array([3, 4, 5, 7, 8, 9, 10]), np.array([2, 3, 7])
    np.testing.assert_array_equal(inherited(known, owner, ids, tracks), [2, -1, 7, -1, -1, -1, -1])
    np.testing.assert_array_equal(inherited(known, owner, ids, NONE), np.full(7, -1))
    np.testing.assert_array_equal(inherited(NONE, NONE, ids, tracks), np.full(7, -1))
    assert len(inherited(known, owner, NONE, tracks)) == 0
