"""Points transformed from one pose's axes to another's, in single precision, for compiled steps."""

from __future__ import annotations

import numpy as np

from hal.compiled import inlined
from hal.types import Pose

NEAREST_M = np.float32(0.1)  # the projection of a nearer point is meaningless
# One row of the relative transform: three entries of the rotation, and the translation in metres.
Row = tuple[np.float32, np.float32, np.float32, np.float32]


Rows = tuple[Row, Row, Row]


@inlined
def relative_rows(to: Pose, of: Pose) -> Rows:
    """The transform of points from the axes of one pose, of, to those of another, to."""
    return _row(to, of, 0), _row(to, of, 1), _row(to, of, 2)


@inlined
def _row(to: Pose, of: Pose, axis: int) -> Row:
    """The row of the transform that gives the coordinate along axis of to."""
    x, y, z, shift_m = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        along = to.rotation[i, axis]
        x, y = x + along * of.rotation[i, 0], y + along * of.rotation[i, 1]
        z += along * of.rotation[i, 2]
        shift_m += along * (of.translation_m[i] - to.translation_m[i])
    return np.float32(x), np.float32(y), np.float32(z), np.float32(shift_m)


@inlined
def coordinate_m(row: Row, x_m: np.float32, y_m: np.float32, z_m: np.float32) -> np.float32:
    """The coordinate that row gives of a point."""
    return row[0] * x_m + row[1] * y_m + row[2] * z_m + row[3]
