from __future__ import annotations

import numpy as np
import pytest

from hal.types import FloatArray
from vision.numerics import kalman

ONE = np.zeros(1, np.intp)  # the index of the only track


def test_prediction_by_hand() -> None:
    state = np.array([[1.0, 0.0, 4.0, 2.0, 0.0, -1.0]])
    moved, covariance = kalman.predict(state, np.eye(6)[None], dt_s=0.5, accel_density=3.0)
    np.testing.assert_allclose(moved, [[2.0, 0.0, 3.5, 2.0, 0.0, -1.0]])
    # 1 + dt^2 + q dt^3 / 3, dt + q dt^2 / 2, 1 + q dt
    expected = np.zeros((6, 6))
    expected[:3, :3] = np.eye(3) * (1.0 + 0.25 + 0.125)
    expected[:3, 3:] = expected[3:, :3] = np.eye(3) * (0.5 + 0.375)
    expected[3:, 3:] = np.eye(3) * (1.0 + 1.5)
    np.testing.assert_allclose(covariance[0], expected)


def coupled_covariance() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    covariance = np.eye(6)
    covariance[:3, 3:] = covariance[3:, :3] = 0.5 * np.eye(3)
    return covariance[None]


def test_a_measured_position_moves_the_velocity_with_it() -> None:
    state, covariance = kalman.update(
        np.zeros((1, 6)), coupled_covariance(), ONE, np.array([[2.0, 0.0, -4.0]]), np.eye(3)[None], 0
    )
    # Gain 1 / (1 + 1) for the position, 0.5 / (1 + 1) for the velocity.
    np.testing.assert_allclose(state, [[1.0, 0.0, -2.0, 0.5, 0.0, -1.0]])
    # 1 - 1/2, 0.5 - 0.5/2, 1 - 0.25/2
    np.testing.assert_allclose(np.diag(covariance[0]), [0.5] * 3 + [0.875] * 3)
    np.testing.assert_allclose(np.diag(covariance[0][:3, 3:]), [0.25] * 3)


def test_a_measured_velocity_moves_the_position_with_it() -> None:
    state, _ = kalman.update(
        np.zeros((1, 6)), coupled_covariance(), ONE, np.array([[1.0, 0.0, 0.0]]), 3.0 * np.eye(3)[None], 3
    )
    np.testing.assert_allclose(state, [[0.125, 0.0, 0.0, 0.25, 0.0, 0.0]])


def test_putting_a_track_elsewhere_says_nothing_about_its_velocity() -> None:
    before = np.array([[1.0, 2.0, 3.0, 0.4, 0.5, 0.6]])
    noise = 0.2 * np.eye(3)[None]
    state, covariance = kalman.reset_position(
        before, coupled_covariance(), ONE, np.array([[2.0, 0.0, 5.0]]), noise
    )
    np.testing.assert_allclose(state, [[2.0, 0.0, 5.0, 0.4, 0.5, 0.6]])
    np.testing.assert_allclose(covariance[0], np.diag([0.2] * 3 + [1.0] * 3))
    np.testing.assert_allclose(before[0, :3], [1.0, 2.0, 3.0])


def test_many_measurements_of_a_steady_walk_find_its_speed() -> None:
    state = np.array([[0.0, 0.0, 5.0, 0.0, 0.0, 0.0]])
    covariance = np.diag([0.04] * 3 + [2.25] * 3)[None]
    noise = 1e-4 * np.eye(3)[None]
    for k in range(1, 31):
        state, covariance = kalman.predict(state, covariance, 0.1, 0.3)
        where = np.array([[0.08 * k, 0.0, 5.0 - 0.05 * k]])
        state, covariance = kalman.update(state, covariance, ONE, where, noise, 0)
    np.testing.assert_allclose(state[0, 3:], [0.8, 0.0, -0.5], atol=1e-3)
    assert (np.linalg.eigvalsh(covariance[0]) > 0).all()


UPRIGHT = np.array([0.0, -1.0, 0.0])


def test_a_vertical_velocity_decays_in_a_tenth_of_a_second_and_a_level_one_stays() -> None:
    state = np.array([[0.0, 0.0, 4.0, 0.6, 1.0, -0.8]])
    moved, _ = kalman.predict(state, np.eye(6)[None], 0.1, 0.0, UPRIGHT)
    np.testing.assert_allclose(moved[0, 3:], [0.6, np.exp(-1.0), -0.8])
    np.testing.assert_allclose(moved[0, :3], [0.06, 0.1, 3.92])
    unknown, _ = kalman.predict(state, np.eye(6)[None], 0.1, 0.0, None)
    np.testing.assert_allclose(unknown[0, 3:], state[0, 3:])


def test_upright_is_along_the_floors_normal_however_the_camera_is_held() -> None:
    tilted = np.array([0.36, -0.8, -0.48])
    along = 0.9 * tilted
    level = np.array([0.8, 0.36, 0.0])  # at right angles to it
    state = np.concatenate((np.zeros(3), along + level))[None]
    moved, _ = kalman.predict(state, np.eye(6)[None], 0.2, 0.0, tilted)
    np.testing.assert_allclose(moved[0, 3:], level + along * np.exp(-2.0), atol=1e-12)
    other, _ = kalman.predict(state, np.eye(6)[None], 0.2, 0.0, -tilted)
    np.testing.assert_allclose(other, moved)


def test_in_two_steps_as_in_one() -> None:
    state = np.array([[0.0, 0.0, 4.0, 0.6, 1.0, -0.8]])
    covariance = np.eye(6)[None]
    once, _ = kalman.predict(state, covariance, 0.2, 0.0, UPRIGHT)
    half, between = kalman.predict(state, covariance, 0.1, 0.0, UPRIGHT)
    twice, _ = kalman.predict(half, between, 0.1, 0.0, UPRIGHT)
    np.testing.assert_allclose(twice[0, 3:], once[0, 3:])


def test_with_the_floor_known_the_covariance_stays_symmetric_and_positive() -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(5, 6, 6))
    covariance = root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(6)
    state = rng.normal(size=(5, 6))
    tilted = np.array([0.36, -0.8, -0.48])
    for _ in range(60):
        state, covariance = kalman.predict(state, covariance, 1.0 / 30.0, 0.2, tilted)
        np.testing.assert_allclose(covariance, covariance.transpose(0, 2, 1), rtol=1e-9, atol=1e-12)
        assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    # Upwards hardly anything is left to be unsure of; along the floor doubt grows.
    upward = tilted @ covariance[:, 3:, 3:] @ tilted
    across = np.array([0.8, 0.36, 0.0]) / np.hypot(0.8, 0.36)
    assert (upward < 0.05).all()
    assert (np.einsum("i,tij,j->t", across, covariance[:, 3:, 3:], across) > 0.4).all()


def any_tracks(count: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(6)
    root = rng.normal(size=(count, 6, 6))
    return rng.normal(size=(count, 6)), root @ root.transpose(0, 2, 1) + 0.1 * np.eye(6)


def test_several_tracks_are_predicted_as_by_the_matrix_of_their_motion() -> None:
    state, covariance = any_tracks(4)
    up = np.array([0.36, -0.8, -0.48])
    move = np.eye(6)
    move[:3, 3:] = 0.2 * np.eye(3)
    move[3:, 3:] -= (1.0 - np.exp(-2.0)) * np.outer(up, up)
    moved, spread = kalman.predict(state, covariance, 0.2, 0.0, up)
    np.testing.assert_allclose(moved, state @ move.T)
    np.testing.assert_allclose(spread, move @ covariance @ move.T, atol=1e-12)


@pytest.mark.parametrize("first", [0, 3])
def test_several_tracks_are_updated_as_by_the_equations_of_a_general_filter(first: int) -> None:
    state, covariance = any_tracks(5)
    rng = np.random.default_rng(7)
    root = rng.normal(size=(4, 3, 3))
    measured, noise = rng.normal(size=(4, 3)), root @ root.transpose(0, 2, 1) + 0.1 * np.eye(3)
    index = np.array([4, 0, 3, 1])
    state_after, covariance_after = kalman.update(state, covariance, index, measured, noise, first)
    np.testing.assert_array_equal(state_after[2], state[2])
    np.testing.assert_array_equal(covariance_after[2], covariance[2])
    select = np.eye(6)[first : first + 3]
    state, covariance = state[index], covariance[index]
    found, spread = state_after[index], covariance_after[index]
    for k in range(4):
        gain = covariance[k] @ select.T @ np.linalg.inv(select @ covariance[k] @ select.T + noise[k])
        np.testing.assert_allclose(found[k], state[k] + gain @ (measured[k] - select @ state[k]))
        np.testing.assert_allclose(spread[k], (np.eye(6) - gain @ select) @ covariance[k], atol=1e-9)


def test_no_tracks_give_nothing_to_filter() -> None:
    state, covariance = np.empty((0, 6)), np.empty((0, 6, 6))
    assert kalman.predict(state, covariance, 0.1, 0.3)[1].shape == (0, 6, 6)
    assert kalman.update(state, covariance, ONE[:0], np.empty((0, 3)), np.empty((0, 3, 3)), 3)[0].shape == (
        0,
        6,
    )
