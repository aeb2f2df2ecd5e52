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


class Demand(NamedTuple):
    """What is asked of a proof of one track's motion.

    least_mps: a slower track does not move. fastest_mps: no body is faster. threshold: squared standard
    deviations of a clear velocity. dt_s: since the frame before; what lasts has to last for some frames.
    """

    least_mps: float
    fastest_mps: float
    threshold: float
    dt_s: float


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
    """Ends of one track's fragments.

    alike: how many agree with the velocity of the fragments. agreeing: the same, but 0 if they are too small
    a share, or if no body is that fast.
    """

    all: int
    alike: float
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


class Approach(NamedTuple):
    """Motion of one track's surface towards the camera, and for how long it has been shown.

    wander_mps: how much of it the viewpoint may explain.
    """

    speed_mps: float
    shown_s: float
    wander_mps: float


class Arrival(NamedTuple):
    """How much of the surface of one track has arrived. lasting: in successive frames."""

    some: bool
    lasting: bool
    much: bool


class Shown(NamedTuple):
    """What one frame shows of one track: velocities by filter, fragments and surface, and all other signs."""

    filtered: Velocity
    frame: Velocity
    centre: Velocity
    opinion: Opinion
    ends: Ends
    surface: Surface
    rim: Rim
    approach: Approach
    arrival: Arrival


@inlined
def arrival_of(arrived: int, arriving_s: float, cells: int, dt_s: float) -> Arrival:
    """arrived of cells have arrived in this frame, and enough of them for arriving_s."""
    some = arrived >= ARRIVED_CELLS and arrived >= ARRIVED_SHARE * cells
    lasting = some and arriving_s >= max(_LASTING_ARRIVAL_S, _MEASURED_FRAMES * dt_s)
    much = arrived >= MUCH_ARRIVED_CELLS and arrived >= MUCH_ARRIVED_SHARE * cells
    return Arrival(some=some, lasting=lasting, much=much)


@inlined
def by_fragments(shown: Shown, asked: Demand) -> bool:
    """Whether filter and fragments show a velocity that the surface does not contradict, or confirms."""
    return (
        _across_the_sight(shown, asked.threshold)
        or _along_the_sight(shown, asked.threshold)
        or _shared_with_surface(shown, asked.threshold)
    )


@inlined
def _across_the_sight(shown: Shown, threshold: float) -> bool:
    """Many ends show it by themselves. Fewer do if the motion is level and the surface does not deny it."""
    ends = shown.ends
    if not shown_across(shown, threshold):
        return False
    if ends.agreeing >= _ENDS_ALONG:
        return True
    enough = ends.agreeing >= ENDS_ACROSS or ends.restless
    level = shown.filtered.level > _LEVEL_SHARE * threshold or ends.restless
    return enough and level and not shown.opinion.denies_across


@inlined
def _along_the_sight(shown: Shown, threshold: float) -> bool:
    """Only many ends show it, if the surface does not deny it."""
    clear = shown.filtered.along > threshold and shown.frame.along > 0.5 * threshold
    return clear and shown.ends.agreeing >= _ENDS_ALONG and not shown.opinion.denies_along


@inlined
def _shared_with_surface(shown: Shown, threshold: float) -> bool:
    """Less proof will do for a component that the surface confirms."""
    filtered, frame, opinion, less = shown.filtered, shown.frame, shown.opinion, _SHARED_PROOF * threshold
    along = filtered.along > less and opinion.confirms_along and frame.along > _FRAME_PROOF
    across = filtered.across > less and opinion.confirms_across and frame.across > _FRAME_PROOF
    return (along or across) and (shown.ends.agreeing >= 2 or shown.ends.restless)


@inlined
def shown_across(shown: Shown, threshold: float) -> bool:
    """Whether filter and fragments show motion across the line of sight, by however few fragments."""
    return shown.filtered.across > threshold and shown.frame.across > 0.5 * threshold


@inlined
def by_unrest(shown: Shown, asked: Demand) -> bool:
    """Whether many ends contradict standing still, even in different ways, and the filter shows a velocity.

    That of a slow body with swinging limbs never becomes clear: after _LASTING_UNREST_S a likely one will do.
    """
    ends = shown.ends
    share = _LIKELY_SHARE if ends.restless_s >= _LASTING_UNREST_S else _UNREST_SHARE
    return ends.restless and ends.all >= _ENDS_ALONG and shown.filtered.total > share * asked.threshold


@inlined
def by_arrival(shown: Shown, asked: Demand) -> bool:
    """Whether arrived cells support the filtered velocity."""
    return shown.arrival.some and shown.filtered.total > 0.5 * asked.threshold


@inlined
def by_surface(shown: Shown, asked: Demand) -> bool:
    """Whether the centre of a whole, compact surface moves for too long and too clearly to be chance.

    Up to wander_mps proves nothing: the centre of a static thing moves as the viewpoint changes, and as more
    of it becomes visible. Nor does motion of a few cells along the line of sight: a wall seen through a chair
    has few. Along it a longer time is needed, unless the displacement is far beyond the error of depth.
    """
    centre, surface, frames_s = shown.centre, shown.surface, _MEASURED_FRAMES * asked.dt_s
    far = abs(centre.value) * surface.velocity_measured_s >= _CLEAR_WAY * surface.depth_sigma_m
    long_s = max(_MEASURED_ACROSS_S if far else _MEASURED_ALONG_S, frames_s)
    clear = centre.across > asked.threshold
    clear = clear and surface.velocity_measured_s >= max(_MEASURED_ACROSS_S, frames_s)
    even = surface.cells >= EVEN_CELLS
    clear = clear or (even and centre.along > asked.threshold and surface.velocity_measured_s >= long_s)
    return clear and surface.size_m <= _COMPACT_M and centre.speed_mps > asked.least_mps + surface.wander_mps


@inlined
def by_rim(shown: Shown, asked: Demand) -> bool:
    """Whether the free rims of a compact body go one way for too long to be chance, or confirm the filter.

    Of what is static, rims jump where other cells join it, but they do not go on. The filter takes up only a
    part of the rims of one frame, so these are very clear, or something else shows the motion, too. Up to
    wander_mps proves nothing: as the viewpoint changes, another side of a static thing becomes its outline.
    """
    rim = shown.rim
    lasting = rim.shown_s >= max(_LASTING_RIM_S, _MEASURED_FRAMES * asked.dt_s)
    confirms = rim.sigmas > CONFIRMING_SIGMAS and shown.filtered.level > _LEVEL_SHARE * asked.threshold
    compact = shown.surface.size_m <= _COMPACT_M
    plausible = asked.least_mps + rim.wander_mps < rim.speed_mps <= asked.fastest_mps
    return (lasting or confirms) and compact and plausible


@inlined
def by_approach(shown: Shown, asked: Demand) -> bool:
    """Whether the surface has come nearer for too long to be chance.

    Up to wander_mps proves nothing: as the viewpoint changes, an error of the camera's own turn moves a
    static surface that is seen aslant.
    """
    approach = shown.approach
    lasting = approach.shown_s >= max(_LASTING_APPROACH_S, _MEASURED_FRAMES * asked.dt_s)
    return lasting and approach.speed_mps > asked.least_mps + approach.wander_mps


@inlined
def is_evident(shown: Shown, asked: Demand) -> bool:
    """Whether any of the rules above proves a motion that is fast enough."""
    return (
        by_fragments(shown, asked)
        or by_unrest(shown, asked)
        or by_arrival(shown, asked)
        or by_surface(shown, asked)
        or by_approach(shown, asked)
        or by_rim(shown, asked)
    )


@inlined
def seems_to_move(shown: Shown, advances: bool, asked: Demand) -> bool:
    """Whether a mover still seems to move, though nothing new proves it. advances: see MotionEvidence."""
    filtered = shown.filtered
    going = (advances and filtered.total > _HOLDING_SQUARED_SIGMAS) or shown.arrival.some
    return going and filtered.speed_mps > STANDING_SHARE * asked.least_mps


@inlined
def stands_surely(shown: Shown, asked: Demand) -> bool:
    """Whether this frame's fragments are sure that the track stands still."""
    frame = shown.frame
    slow = frame.speed_mps < STANDING_SHARE * asked.least_mps
    return slow and frame.sigma_mps < 0.5 * asked.least_mps and shown.ends.agreeing >= ENDS_ACROSS
