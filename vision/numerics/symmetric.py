"""Inverses of symmetric 3x3 matrices, many at once, by their cofactors.

For a dozen or a few hundred of them that is far faster than a general solver, which is called for each.
"""

from __future__ import annotations

import numpy as np

from hal.types import FloatArray

# Where the six different entries 00, 01, 02, 11, 12, 22 stand among the nine, and the nine among the six.
_UPPER = np.array([0, 1, 2, 4, 5, 8])
_ALL = np.array([0, 1, 2, 1, 3, 4, 2, 4, 5])
# Which entries a, b, c, d make the six cofactors a b - c d.
_COFACTORS = np.array([[3, 2, 1, 0, 1, 0], [5, 4, 4, 5, 2, 3], [4, 1, 2, 2, 0, 1], [4, 5, 3, 2, 4, 1]])


def whole(entries: FloatArray) -> FloatArray:
    """(3, 3, N) matrices of their entries (6, N): 00, 01, 02, 11, 12, 22."""
    result: FloatArray = entries.take(_ALL, axis=0).reshape(3, 3, -1)
    return result


def inverse_entries(entries: FloatArray) -> FloatArray:
    """(6, N) of the inverses of matrices with entries (6, N)."""
    a, b, c, d = entries.take(_COFACTORS, axis=0)
    cofactors = a * b - c * d
    determinant = (entries[:3] * cofactors[:3]).sum(axis=0)
    result: FloatArray = cofactors / determinant
    return result


def inverse(matrices: FloatArray) -> FloatArray:
    """(..., 3, 3) inverses of symmetric matrices (..., 3, 3)."""
    entries = matrices.reshape(-1, 9).take(_UPPER, axis=1).T
    result: FloatArray = inverse_entries(entries).T.take(_ALL, axis=1).reshape(matrices.shape)
    return result
