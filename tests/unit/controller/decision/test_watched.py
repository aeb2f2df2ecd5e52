"""Which bodies are likely to come into the way, and which could."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np

from config.decision import DecisionConfig
from config.robot import Body
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.watched import Watch, Watched
from controller.decision.world_model import WorldModel
from tests.support.floor_bodies import box, line_path

CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))


def known(body: Bodies, *, remembered: bool = False, pausing: bool = False) -> WorldModel:
    """What a robot knows that sees body alone."""
    flags = {"remembered": np.array([remembered]), "pausing": np.array([pausing])}
    return cast(WorldModel, SimpleNamespace(bodies=body, corridor=CORRIDOR, since_s=0.0, **flags))


def step(watch: Watch, model: WorldModel, now_s: float) -> Watched:
    """Of a robot at 0, after a new scene."""
    watch.take_in(model)
    found = watch.step(model, 0.0, now_s)
    assert found is not None
    return found


def new_watch() -> Watch:
    return Watch(DecisionConfig(), np.arange(0.0, 6.0, 0.1))


def watched(body: Bodies, *, remembered: bool = False) -> Watched:
    """By a watch that sees body for the first time."""
    return step(new_watch(), known(body, remembered=remembered), 10.0)


def test_whoever_goes_on_after_a_pause_enters_at_once() -> None:
    """He walked in for 0.4 s and counts as coming in. A pause is no sign of going elsewhere."""
    watch, walks, stands = new_watch(), box(3.0, 1.2, 0.0, -0.8), box(3.0, 1.2)
    entered = [step(watch, known(walks), 0.1 * k).enters.tolist() for k in range(5)]
    assert entered == [[False]] * 3 + [[True]] * 2
    for k in range(5, 25):
        found = step(watch, known(stands, pausing=True), 0.1 * k)
        assert (found.enters.tolist(), found.bodies.moving.tolist()) == ([False], [True])
    assert step(watch, known(walks), 2.5).enters.tolist() == [True]


def test_whoever_walks_into_the_way_could_enter_before_the_debounce_is_over() -> None:
    """The worst case counts him at once: at arm's length there is no time to be sure."""
    found = watched(box(1.0, 1.2, 0.0, -0.8))
    assert found.could_enter.tolist() == [True]
    assert found.enters.tolist() == [False]
    assert watched(box(1.0, 1.2, 0.0, 0.8)).could_enter.tolist() == [False]


def out_of_view(toward_mps: float, faster_mps: float) -> Bodies:
    """2.4 m to the right of the path, last seen 2.4 s ago with this speed towards it, when he was getting
    faster by so much."""
    body = box(1.8, -2.4, -0.3, toward_mps, sigma_mps=0.08)
    return replace(body, unseen_s=np.array([2.4]), innovation_mps=np.array([[0.0, faster_mps]]))


def test_whoever_set_off_as_he_left_the_view_may_walk_by_now() -> None:
    """At the 0.2 m/s of the last sight he would come much later than after 6 s."""
    assert watched(out_of_view(0.2, 0.0), remembered=True).could_enter.tolist() == [False]
    assert watched(out_of_view(0.2, 0.8), remembered=True).could_enter.tolist() == [True]
    # He was slowing down; and whoever goes away does not come back by walking faster.
    assert watched(out_of_view(0.2, -0.8), remembered=True).could_enter.tolist() == [False]
    assert watched(out_of_view(-0.2, -0.8), remembered=True).could_enter.tolist() == [False]
