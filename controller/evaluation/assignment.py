"""One-to-one assignment of detections to true objects: as many pairs as possible, then the least cost."""

from __future__ import annotations

import numpy as np

from hal.types import FloatArray

Pairs = tuple[tuple[int, int], ...]


def assign(cost: FloatArray) -> Pairs:
    """Pairs (row, column), sorted. cost: (N, M), inf where a pair is impossible.

    Exact: no other assignment has more pairs, and none with as many pairs has a smaller sum (Kuhn-Munkres
    with potentials, O(n^3)). Raises ValueError for a cost that is negative or NaN.
    """
    rows, columns = cost.shape
    if np.isnan(cost).any() or (cost < 0.0).any():
        raise ValueError("costs must be zero or more, or inf where a pair is impossible")
    if rows == 0 or columns == 0:
        return ()
    possible = np.isfinite(cost)
    # An impossible pair costs more than all possible ones together, so the number of pairs comes first.
    never = 1.0 + 2.0 * float(np.where(possible, cost, 0.0).sum())
    whole = np.where(possible, cost, never)
    chosen = _kuhn_munkres(whole) if rows <= columns else _kuhn_munkres(whole.T)
    pairs = enumerate(chosen) if rows <= columns else ((row, column) for column, row in enumerate(chosen))
    return tuple(sorted((row, column) for row, column in pairs if possible[row, column]))


def _kuhn_munkres(cost: FloatArray) -> list[int]:
    """For each row the column of the cheapest complete assignment; rows <= columns."""
    rows, columns = cost.shape
    row_potential, column_potential = np.zeros(rows + 1), np.zeros(columns + 1)
    row_of = np.zeros(columns + 1, dtype=np.intp)  # row assigned to each column, both from 1; 0: free
    for row in range(1, rows + 1):
        row_of[0] = row
        came_from = np.zeros(columns + 1, dtype=np.intp)
        slack = np.full(columns + 1, np.inf)
        done = np.zeros(columns + 1, dtype=np.bool_)
        column = 0
        while row_of[column] != 0:
            done[column] = True
            here = row_of[column]
            reduced = cost[here - 1] - row_potential[here] - column_potential[1:]
            better = ~done[1:] & (reduced < slack[1:])
            slack[1:][better] = reduced[better]
            came_from[1:][better] = column
            following = int(np.argmin(np.where(done, np.inf, slack)))
            delta = slack[following]
            row_potential[row_of[done]] += delta
            column_potential[done] -= delta
            slack[~done] -= delta
            column = following
        while column != 0:
            row_of[column] = row_of[came_from[column]]
            column = int(came_from[column])
    chosen = [0] * rows
    for column in range(1, columns + 1):
        if row_of[column] != 0:
            chosen[row_of[column] - 1] = column - 1
    return chosen
