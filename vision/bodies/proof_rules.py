"""The rules of proof: what velocities, fragments, surface and arrival of one track prove in one frame.

One function for each kind of proof, inlined into the compiled step of vision/bodies/proof.py.
"""

from __future__ import annotations

from typing import NamedTuple

from hal.compiled import inlined
from vision.bodies.arrivals import ARRIVED_CELLS, ARRIVED_SHARE, MUCH_ARRIVED_CELLS, MUCH_ARRIVED_SHARE
from vision.motion.line_of_sight import CONFIRMING_SIGMAS

_HOLDING_SQUARED_SIGMAS = 4.0  # two sigmas: with more, a mover still seems to move
ENDS_ACROSS = 4  # two fragments: across the line of sight the position of each end is a measurement
_ENDS_ALONG = 8  # four fragments: along it only the distance between two ends is, and ends slide
_LEVEL_SHARE = 0.5  # of the threshold: with less level motion across, as many ends are needed as along
_UNREST_SHARE = 0.5  # of the threshold, for the filtered velocity of a restless body
_LASTING_UNREST_S = 0.4  # longer than a limb swings one way
_LIKELY_SHARE = 0.25  # of the threshold, 2 of 4 sigmas: a slow machine on legs reaches 2.5 at most
_FRAME_PROOF = 3.0  # squared sigmas of this frame, so that the proof does not rest on the past only
_SHARED_PROOF = 0.55  # of the threshold, where the surface confirms the velocity of the fragments
_LASTING_ARRIVAL_S = 0.12  # of no static surface do enough cells arrive in two successive frames
STANDING_SHARE = 0.6  # of the minimum speed: a slower track stands still
_LASTING_RIM_S = 0.12  # rims of static surfaces seldom show motion in three successive frames, never in five
_MEASURED_ACROSS_S = 0.25  # static surfaces seldom show a false speed across the line of sight for longer
_MEASURED_ALONG_S = 0.5  # somewhat longer along it, where neighbours share the noise of depth
_CLEAR_WAY = 4.0  # times the depth noise of one pixel: shared noise never shows so large a displacement
# Depth of what is static seldom seems to change towards the camera in one frame, never for so long.
_LASTING_APPROACH_S = 0.12
_MEASURED_FRAMES = 2.5  # frame intervals: at least three frames at a low frame rate
EVEN_CELLS = 48  # fewer cells lie on 2 or 3 patches of depth noise, and move back and forth with them
LARGEST_M = 3.0  # wider parts are walls and racks; movers in front of them are carved out
_COMPACT_M = 2.2  # a tall person; larger things are seen in part only, and their centre wanders


class Velocity(NamedTuple):
    """A velocity of one track and its components; see Split."""

    speed_mps: float
    sigma_mps: float
    value: float
    along: float
    across: float
    total: float
    level: float


class Opinion(NamedTuple):
    """What the surface's velocity says of the fragments' velocity; see SecondOpinion.

    confirms_along is False for a surface of fewer than EVEN_CELLS.
    """

    denies_along: bool
    denies_across: bool
    confirms_along: bool
    confirms_across: bool


class Ends(NamedTuple):
    """Ends of one track's fragments: all, and agreeing, which is 0 if they are too small a share."""

    all: int
    agreeing: float
    restless: bool
    restless_s: float


class Surface(NamedTuple):
    """Visible surface of one track. wander_mps: how fast its centre may move while the body is static."""

    cells: int
    size_m: float
    velocity_measured_s: float
    wander_mps: float
    depth_sigma_m: float


class Rim(NamedTuple):
    """Motion of one track's free rims.

    sigmas: standard deviations of its speed from zero, in this frame. shown_s: for how long it has been
    clear. wander_mps: how fast they may move while the body is static.
    """

    speed_mps: float
    sigmas: float
    shown_s: float
    wander_mps: float


class Arrival(NamedTuple):
    """How much of the surface of one track has arrived. lasting: in successive frames."""

    some: bool
    lasting: bool
    much: bool


@inlined
def arrival_of(arrived: int, arriving_s: float, cells: int, dt_s: float) -> Arrival:
    """arrived of cells have arrived in this frame, and enough of them for arriving_s."""
    some = arrived >= ARRIVED_CELLS and arrived >= ARRIVED_SHARE * cells
    lasting = some and arriving_s >= max(_LASTING_ARRIVAL_S, _MEASURED_FRAMES * dt_s)
    much = arrived >= MUCH_ARRIVED_CELLS and arrived >= MUCH_ARRIVED_SHARE * cells
    return Arrival(some=some, lasting=lasting, much=much)


@inlined
def by_fragments(filtered: Velocity, frame: Velocity, second: Opinion, ends: Ends, threshold: float) -> bool:
    """Whether filter and fragments show a velocity that the surface does not contradict, or confirms."""
    return (
        _across_the_sight(filtered, frame, second, ends, threshold)
        or _along_the_sight(filtered, frame, second, ends, threshold)
        or _shared_with_surface(filtered, frame, second, ends, threshold)
    )


@inlined
def _across_the_sight(
    filtered: Velocity, frame: Velocity, second: Opinion, ends: Ends, threshold: float
) -> bool:
    """Many ends show it by themselves. Fewer do if the motion is level and the surface does not deny it."""
    if not shown_across(filtered, frame, threshold):
        return False
    if ends.agreeing >= _ENDS_ALONG:
        return True
    enough = ends.agreeing >= ENDS_ACROSS or ends.restless
    level = filtered.level > _LEVEL_SHARE * threshold or ends.restless
    return enough and level and not second.denies_across


@inlined
def _along_the_sight(
    filtered: Velocity, frame: Velocity, second: Opinion, ends: Ends, threshold: float
) -> bool:
    """Only many ends show it, if the surface does not deny it."""
    shown = filtered.along > threshold and frame.along > 0.5 * threshold
    return shown and ends.agreeing >= _ENDS_ALONG and not second.denies_along


@inlined
def _shared_with_surface(
    filtered: Velocity, frame: Velocity, second: Opinion, ends: Ends, threshold: float
) -> bool:
    """Less proof will do for a component that the surface confirms."""
    less = _SHARED_PROOF * threshold
    along = filtered.along > less and second.confirms_along and frame.along > _FRAME_PROOF
    across = filtered.across > less and second.confirms_across and frame.across > _FRAME_PROOF
    return (along or across) and (ends.agreeing >= 2 or ends.restless)


@inlined
def shown_across(filtered: Velocity, frame: Velocity, threshold: float) -> bool:
    """Whether filter and fragments show motion across the line of sight, by however few fragments."""
    return filtered.across > threshold and frame.across > 0.5 * threshold


@inlined
def by_unrest(filtered: Velocity, ends: Ends, threshold: float) -> bool:
    """Whether many ends contradict standing still, even in different ways, and the filter shows a velocity.

    That of a slow body with swinging limbs never becomes clear: after _LASTING_UNREST_S a likely one will do.
    """
    share = _LIKELY_SHARE if ends.restless_s >= _LASTING_UNREST_S else _UNREST_SHARE
    return ends.restless and ends.all >= _ENDS_ALONG and filtered.total > share * threshold


@inlined
def by_arrival(filtered: Velocity, arrived: bool, threshold: float) -> bool:
    """Whether arrived cells support the filtered velocity."""
    return arrived and filtered.total > 0.5 * threshold


@inlined
def by_surface(centre: Velocity, seen: Surface, least_mps: float, dt_s: float, threshold: float) -> bool:
    """Whether the centre of a whole, compact surface moves for too long and too clearly to be chance.

    Up to wander_mps proves nothing: the centre of a static thing moves as the viewpoint changes, and as more
    of it becomes visible. Nor does motion of a few cells along the line of sight: a wall seen through a chair
    has few. Along it a longer time is needed, unless the displacement is far beyond the error of depth.
    """
    frames_s = _MEASURED_FRAMES * dt_s
    far = abs(centre.value) * seen.velocity_measured_s >= _CLEAR_WAY * seen.depth_sigma_m
    long_s = max(_MEASURED_ACROSS_S if far else _MEASURED_ALONG_S, frames_s)
    clear = centre.across > threshold and seen.velocity_measured_s >= max(_MEASURED_ACROSS_S, frames_s)
    even = seen.cells >= EVEN_CELLS
    clear = clear or (even and centre.along > threshold and seen.velocity_measured_s >= long_s)
    return clear and seen.size_m <= _COMPACT_M and centre.speed_mps > least_mps + seen.wander_mps


@inlined
def by_rim(
    rim: Rim, filtered: Velocity, size_m: float, least_mps: float, dt_s: float, threshold: float
) -> bool:
    """Whether the free rims of a compact body go one way for too long to be chance, or confirm the filter.

    Of what is static, rims jump where other cells join it, but they do not go on. The filter takes up only a
    part of the rims of one frame, so these are very clear, or something else shows the motion, too. Up to
    wander_mps proves nothing: as the viewpoint changes, another side of a static thing becomes its outline.
    """
    lasting = rim.shown_s >= max(_LASTING_RIM_S, _MEASURED_FRAMES * dt_s)
    confirms = rim.sigmas > CONFIRMING_SIGMAS and filtered.level > _LEVEL_SHARE * threshold
    compact = size_m <= _COMPACT_M
    return (lasting or confirms) and compact and rim.speed_mps > least_mps + rim.wander_mps


@inlined
def by_approach(approach_mps: float, shown_s: float, least_mps: float, dt_s: float) -> bool:
    """Whether the surface has come nearer for too long to be chance, at approach_mps.

    least_mps: more where the viewpoint changes: an error of the camera's own turn moves a static surface that
    is seen aslant.
    """
    return shown_s >= max(_LASTING_APPROACH_S, _MEASURED_FRAMES * dt_s) and approach_mps > least_mps


@inlined
def seems_to_move(filtered: Velocity, advances: bool, arrived: bool, least_mps: float) -> bool:
    """Whether a mover still seems to move, though nothing new proves it."""
    going = (advances and filtered.total > _HOLDING_SQUARED_SIGMAS) or arrived
    return going and filtered.speed_mps > STANDING_SHARE * least_mps


@inlined
def stands_surely(frame: Velocity, agreeing: float, least_mps: float) -> bool:
    """Whether this frame's fragments are sure that the track stands still."""
    slow = frame.speed_mps < STANDING_SHARE * least_mps
    return slow and frame.sigma_mps < 0.5 * least_mps and agreeing >= ENDS_ACROSS
