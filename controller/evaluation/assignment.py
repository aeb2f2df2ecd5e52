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
    impossible_cost = 1.0 + 2.0 * float(np.where(possible, cost, 0.0).sum())
    padded_cost = np.where(possible, cost, impossible_cost)
    assigned = _kuhn_munkres(padded_cost) if rows <= columns else _kuhn_munkres(padded_cost.T)
    pairs = enumerate(assigned) if rows <= columns else ((row, column) for column, row in enumerate(assigned))
    return tuple(sorted((row, column) for row, column in pairs if possible[row, column]))


def _kuhn_munkres(cost: FloatArray) -> list[int]:
    """For each row the column of the cheapest complete assignment; rows <= columns."""
    rows, columns = cost.shape
    row_potential, column_potential = np.zeros(rows + 1), np.zeros(columns + 1)
    row_of_column = np.zeros(columns + 1, dtype=np.intp)  # row assigned to each column, both from 1; 0: free
    for row in range(1, rows + 1):
        row_of_column[0] = row
        previous_column = np.zeros(columns + 1, dtype=np.intp)
        slack = np.full(columns + 1, np.inf)
        visited = np.zeros(columns + 1, dtype=np.bool_)
        column = 0
        while row_of_column[column] != 0:
            visited[column] = True
            current_row = row_of_column[column]
            reduced = cost[current_row - 1] - row_potential[current_row] - column_potential[1:]
            better = ~visited[1:] & (reduced < slack[1:])
            slack[1:][better] = reduced[better]
            previous_column[1:][better] = column
            next_column = int(np.argmin(np.where(visited, np.inf, slack)))
            delta = slack[next_column]
            row_potential[row_of_column[visited]] += delta
            column_potential[visited] -= delta
            slack[~visited] -= delta
            column = next_column
        while column != 0:
            row_of_column[column] = row_of_column[previous_column[column]]
            column = int(previous_column[column])
    assigned = [0] * rows
    for column in range(1, columns + 1):
        if row_of_column[column] != 0:
            assigned[row_of_column[column] - 1] = column - 1
    return assigned
