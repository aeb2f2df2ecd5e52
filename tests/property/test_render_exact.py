"""The rasteriser against the plainest ray caster there is, on random boxes and tubes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, Intrinsics, PlanarPose, Pose
from sim.models.mesh import Faces, axis_rotation, box, join, normals, prism
from sim.rendering.raster import Rasteriser
from sim.world import Geometry

K = Intrinsics(80, 60, 75.0, 71.0, 38.7, 29.2)

places = st.floats(-3.0, 3.0)
sizes = st.floats(0.05, 2.5)
angles = st.floats(-3.1, 3.1)


@st.composite
def solids(draw: st.DrawFn) -> Faces:
    if draw(st.booleans()):
        shape = box((draw(sizes), draw(sizes), draw(sizes)), "plain/grey")
    else:
        radius = draw(st.floats(0.05, 0.8))
        shape = prism(
            8,
            (radius, 0.7 * radius),
            (0.0, draw(sizes)),
            "plain/grey",
            draw(st.floats(0.6, 1.3)),
            "plain/grey",
        )
    turn = axis_rotation("z", draw(angles)) @ axis_rotation("x", draw(st.floats(-0.6, 0.6)))
    return shape.moved(turn, np.array([draw(st.floats(-0.5, 9.0)), draw(places), draw(st.floats(-0.5, 1.5))]))


def cast(geometry: Geometry, camera: Pose) -> tuple[FloatArray, FloatArray]:
    """Largest inverse depth at each pixel's centre, and how near (in pixels, about) an edge decided it."""
    corners = (geometry.corners_m - camera.translation_m) @ camera.rotation
    v, u = np.mgrid[0 : K.height, 0 : K.width]
    rays = np.stack([(u - K.cx) / K.fx, (v - K.cy) / K.fy, np.ones(u.shape)], axis=-1)
    best, doubt = np.zeros(u.shape), np.full(u.shape, np.inf)
    for face in corners:
        outward = np.cross(face[3] - face[0], face[1] - face[0])
        distance = float(outward @ face[0])
        if distance > -1e-6 * np.linalg.norm(outward):
            continue
        inverse = rays @ outward / distance
        inside = inverse > 0.0
        points = rays / np.where(inside, inverse, 1.0)[..., None]
        for a, b in zip(face, np.roll(face, -1, axis=0), strict=True):
            # In the face's own plane, on the inner side of each edge.
            inward = np.cross(b - a, outward)
            margin = (points - a) @ (inward / np.linalg.norm(inward))
            doubt = np.where(np.abs(margin) * np.abs(inverse) < 1e-7, 0.0, doubt)
            inside &= margin >= 0.0
        best = np.where(inside, np.maximum(best, inverse), best)
    return best, doubt


@settings(max_examples=60, deadline=None)
@given(
    bodies=st.lists(solids(), min_size=1, max_size=6),
    x=st.floats(-1.0, 1.0),
    y=st.floats(-1.0, 1.0),
    heading=st.floats(-0.7, 0.7),
    pitch=st.floats(-0.3, 0.5),
)
def test_depth_is_that_of_the_ray_through_each_pixel(
    bodies: list[Faces], x: float, y: float, heading: float, pitch: float
) -> None:
    faces = join(bodies)
    zeros = np.zeros(len(faces), np.int32)
    geometry = Geometry(
        faces.corners_m, normals(faces.corners_m), faces.windows, zeros, np.ones(len(faces), np.uint16)
    )
    camera = camera_in_floor(PlanarPose(x, y, heading), CameraMount(0.4, 0.1, 0.6, pitch))
    raster = Rasteriser(K)
    drawn = raster.draw(geometry, camera)
    expected, doubt = cast(geometry, camera)
    # What is nearer than the near plane is not drawn by a camera.
    sure = (doubt > 0.0) & (expected < 1.0 / 0.06)
    got = raster.inverse_depth.astype(np.float64)
    assert np.abs(got - expected)[sure].max(initial=0.0) < 2e-5 * max(
        1.0, float(expected[sure].max(initial=0.0))
    )
    assert ((raster.labels > 0) == (got > 0.0)).all()
    assert raster.labels.max() <= len(drawn)
