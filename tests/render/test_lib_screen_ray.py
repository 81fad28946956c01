# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/screen_ray.glsl`: rays as lines in a picture, against projections in float64."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.rooms import camera_at
from tests.render.shader_functions import evaluate
from vlm_addon.core.scene import ORTHOGRAPHIC, PERSPECTIVE, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.view import View, make_view

FILE = "lib/screen_ray.glsl"
SIZE = (120, 80)
NEAR = 0.5
COUNT = 400


def view_of(kind: str) -> View:
    camera = camera_at((1.0, -6.0, 2.0), (0.0, 0.0, 0.0), kind=kind, clip_start=NEAR, ortho_scale=5.0)
    return make_view(camera, *SIZE, np.zeros(3), (0.2, -0.3))


def preamble(view: View) -> str:
    """made(origin, direction): a ray of reach 20."""
    numbers = ", ".join(f"{float(number):.9e}" for number in view.clip_from_local.T.ravel())
    near = 1.0 if view.is_orthographic else NEAR
    return (
        "ScreenRay made(vec3 p, vec3 d) {"
        f" return make_screen_ray(mat4({numbers}), vec2({SIZE[0]}.0, {SIZE[1]}.0), p, d, 20.0, {near}); }}"
    )


def seen_rays(view: View) -> tuple[Float64, Float64]:
    """Origins that the view shows, and directions."""
    random = np.random.default_rng(4)
    origins = random.uniform(-0.8, 0.8, (COUNT, 3))
    directions = random.normal(size=(COUNT, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def projected(view: View, points: Float64) -> tuple[Float64, Float64]:
    """Pixels from the lower left corner, and the homogeneous coordinate."""
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ view.clip_from_local.T
    return (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * SIZE, clip[:, 3]


@pytest.mark.parametrize("kind", [PERSPECTIVE, ORTHOGRAPHIC])
def test_places_along_the_line_are_those_of_the_ray(device: Device, kind: str) -> None:
    view = view_of(kind)
    origins, directions = seen_rays(view)
    shares = np.random.default_rng(5).random(COUNT)
    inputs = {"p": origins, "d": directions, "s": shares}
    text = preamble(view)
    distance = evaluate(device, FILE, "ray_distance(made(p, d), s)", inputs, 1, text).astype(float)
    line = evaluate(device, FILE, "vec4(made(p, d).start, made(p, d).span)", inputs, 4, text).astype(float)
    place, scale = projected(view, origins + distance[:, None] * directions)
    # What comes to within a tenth of the near plane is far beside the picture, and as far off.
    plain = (scale > 1.1 * NEAR) & (np.abs(line[:, 2:]).max(axis=1) < 1e4)
    assert plain.mean() > 0.7
    np.testing.assert_allclose((line[:, :2] + shares[:, None] * line[:, 2:])[plain], place[plain], atol=0.03)


@pytest.mark.parametrize("kind", [PERSPECTIVE, ORTHOGRAPHIC])
def test_lines_end_at_the_pictures_edge_the_near_plane_or_the_reach(device: Device, kind: str) -> None:
    view = view_of(kind)
    origins, directions = seen_rays(view)
    inputs = {"p": origins, "d": directions}
    end, reach = (
        evaluate(device, FILE, f"made(p, d).{part}", inputs, 1, preamble(view)).astype(float)
        for part in ("end", "reach")
    )
    line = evaluate(device, FILE, "vec4(made(p, d).start, made(p, d).span)", inputs, 4, preamble(view)).astype(float)
    last = line[:, :2] + end[:, None] * line[:, 2:]
    assert ((last > -0.01) & (last < np.array(SIZE) + 0.01)).all()
    at_edge = np.minimum(np.abs(last), np.abs(last - SIZE)).min(axis=1) < 0.01
    assert (at_edge | (end == 1.0)).all()
    assert at_edge.mean() > 0.2
    _, scale = projected(view, origins + reach[:, None] * directions)
    assert (np.isclose(reach, 20.0) | np.isclose(scale, NEAR, rtol=1e-3)).all()
    assert (reach < 19.9).any() == (kind == PERSPECTIVE)


def test_rays_from_before_the_near_plane_are_none(device: Device) -> None:
    view = view_of(PERSPECTIVE)
    eye = view.position
    origins = np.array([eye, eye + view.backward, eye - 0.9 * NEAR * view.backward])
    inputs = {"p": origins, "d": np.tile(-view.backward, (3, 1))}
    assert not evaluate(device, FILE, "made(p, d).end", inputs, 1, preamble(view)).any()


WALK = """
// Squares of a level that a line visits, their number, and whether each is beside the one before.
vec3 walk(vec2 start, vec2 span, int level) {
    ScreenRay line = ScreenRay(start, span, 1.0, 1.0, vec2(1.0));
    ivec2 square = ivec2(0), before = ivec2(floor(start)) >> level;
    float share = 0.0;
    int count = 0, jumps = 0;
    for (int i = 0; i < 1000 && share < 1.0; ++i) {
        share = square_end(line, share, level, square);
        ivec2 moved = abs(square - before);
        jumps += int(moved.x > 1 || moved.y > 1);
        before = square;
        ++count;
    }
    return vec3(share, float(count), float(jumps));
}
"""


@pytest.mark.parametrize("level", [0, 3])
def test_squares_are_visited_one_after_the_other_to_the_end(device: Device, level: int) -> None:
    random = np.random.default_rng(8)
    start, span = random.uniform(0.0, 64.0, (COUNT, 2)), random.uniform(-60.0, 60.0, (COUNT, 2))
    span[:40, 0] = 0.0
    span[40:80, 1] = 0.0
    start[::3] = np.floor(start[::3])
    inputs = {"start": start, "span": span, "level": np.full(COUNT, level, np.int32)}
    end, count, jumps = evaluate(device, FILE, "walk(start, span, level)", inputs, 3, WALK).T
    assert (end == 1.0).all()
    assert not jumps.any()
    start, span = (values.astype(np.float32).astype(float) for values in (start, span))
    crossed = np.abs(np.floor((start + span) / 2.0**level) - np.floor(start / 2.0**level)).sum(axis=1)
    # Squares of which a line cuts off less than a 128th of a pixel may be left out.
    assert (count <= crossed + 2.0).all()
    assert (count >= 0.9 * crossed - 1.0).all()


def test_the_pixel_before_a_border_is_the_one_that_is_left(device: Device) -> None:
    spans = np.array([[4.0, 0.0], [-4.0, 0.0], [0.0, 4.0], [0.0, -4.0], [4.0, 1.0]])
    inputs = {"start": np.tile([2.5, 3.5], (5, 1)), "span": spans, "s": np.full(5, 0.125)}
    text = "ScreenRay line(vec2 a, vec2 b) { return ScreenRay(a, b, 1.0, 1.0, vec2(1.0)); }"
    found = evaluate(device, FILE, "vec2(pixel_before(line(start, span), s))", inputs, 2, text)
    assert (found == [2.0, 3.0]).all()


def test_a_way_behind_something_is_surer_the_farther_behind(device: Device) -> None:
    gap, way = (g.ravel() for g in np.meshgrid([0.0, 0.5, 2.0], [0.0, 1.0, 4.0], indexing="ij"))
    found = evaluate(device, FILE, "passed_share(gap, way)", {"gap": gap, "way": way})
    np.testing.assert_allclose(found, [1.0, 0.0, 0.0, 1.0, 0.5, 0.125, 1.0, 1.0, 0.5])
