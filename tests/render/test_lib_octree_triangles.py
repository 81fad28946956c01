# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/octree_triangles.glsl` against every triangle, one by one, in float64, and against core/brick_triangles.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.octree_rays import ask, ask_exact, build_exact
from tests.voxel_scenes import box, convex_crossing, crossings, soup, sphere, surface_points, torus
from vlm_addon.core import brick_triangles
from vlm_addon.core.brick_triangles import ALL_EXACT, EDGE_SHARE, LIFT_SHARE, build_exact_octree, lattice_step

DEPTH = 6
SIZE = float(1 << DEPTH)
LIFT, SLACK = LIFT_SHARE * SIZE, EDGE_SHARE * SIZE
REACHES = (1, 2, 4, ALL_EXACT)

LIST = """
// Of the voxel at a place: its list and a way from there along d.
#define LISTED octree_list(0u, octree_box(0u, octree_cell(p)).brick, octree_cell(p))
float list_blocks(vec3 p, vec3 a, vec3 b) {
    uint asked = OCTREE_NO_TRIANGLE;
    return float(octree_list_blocks(0u, LISTED, octree_ray(a, b), octree_edge_slack(), asked));
}
vec2 list_nearest(vec3 p, vec3 a, vec3 b) {
    OctreeCrossing none = OctreeCrossing(OCTREE_NO_CROSSING, 0u, 0u);
    OctreeCrossing found = octree_list_nearest(0u, LISTED, octree_ray(a, b), octree_edge_slack(), none);
    return vec2(found.fraction, found.triangle);
}
// Of two as near, the one of the smaller number, in whatever order they come.
float keeps_smaller(vec3 p, vec3 a, vec3 b) {
    OctreeRay ray = octree_ray(a, b);
    OctreeCrossing found = OctreeCrossing(OCTREE_NO_CROSSING, 0u, 0u);
    found = octree_list_nearest(0u, LISTED, ray, octree_edge_slack(), found);
    OctreeCrossing later = OctreeCrossing(found.fraction, 0u, found.triangle + 1u);
    return float(octree_list_nearest(0u, LISTED, ray, octree_edge_slack(), later).triangle == found.triangle);
}
vec2 tree_nearest(uint tree, vec3 a, vec3 b) {
    OctreeCrossing none = OctreeCrossing(OCTREE_NO_CROSSING, tree, 0u);
    OctreeCrossing found = octree_tree_nearest(tree, a, b, none);
    return vec2(found.fraction, found.triangle);
}
vec4 hit_place(OctreeHit hit) { return vec4(hit.place, float(hit.found)); }
vec4 hit_normal(OctreeHit hit) { return vec4(hit.normal, float(hit.from_back)); }
vec4 hit_reflectance(OctreeHit hit) { return vec4(hit.reflectance, hit.distance); }
"""


def on_lattice(triangles, depth=DEPTH):
    return np.rint(triangles / lattice_step(depth)) * lattice_step(depth)


def room():
    """A room whose walls face inwards, a block that stands on its floor and one that floats, and a thin wall."""
    inside = box((0.5, 0.5, 0.5), (63.5, 60.0, 55.0))[:, ::-1]
    blocks = box((20.0, 20.0, 0.5), (30.0, 32.0, 20.0)), box((24.0, 24.0, 20.25), (40.0, 30.0, 26.0))
    return np.concatenate([inside, *blocks, box((45.0, 10.0, 0.5), (45.05, 50.0, 30.0))])


SHAPES = {
    "torus": lambda: torus(DEPTH, sides=(24, 12)),
    "soup": lambda: soup(120, DEPTH, np.random.default_rng(0)),
    "room": room,
}


@pytest.fixture(scope="module", params=SHAPES)
def shape(request, device):
    """Triangles on the lattice, in voxel coordinates; bind makes them those that are asked."""
    return on_lattice(SHAPES[request.param]())


@pytest.fixture
def bound(shape, device):
    """The same, bound."""
    kept = build_exact(device, [shape], DEPTH)
    yield shape
    del kept


def facing_pairs(triangles, count, seed):
    """Surface points in float32 that face each other, as `p`, `n`, `q`, `m`."""
    rng = np.random.default_rng(seed)
    (p, n), (q, m) = surface_points(triangles, count, rng), surface_points(triangles, count, rng)
    faces = (((q - p) * n).sum(axis=1) > 1e-3) & (((q - p) * m).sum(axis=1) < -1e-3)
    values = (values[faces].astype(np.float32) for values in (p, n, q, m))
    return dict(zip("pnqm", values, strict=True))


def sees(device, pairs, exact_reach):
    return ask_exact(device, f"float(octree_points_see(p, n, q, m, {exact_reach}))", pairs) > 0.5


def exactly_seen(pairs, triangles):
    starts = pairs["p"].astype(float) + LIFT * pairs["n"]
    return np.isinf(crossings(starts, pairs["q"].astype(float) + LIFT * pairs["m"], triangles)[0])


def ways(count, seed):
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0.0, SIZE, (count, 3))
    ends = starts + rng.normal(size=(count, 3)) * SIZE * 2.0 ** rng.uniform(-4.0, 0.0, (count, 1))
    # Not on the cube's faces, where some triangles of a soup lie.
    ends = np.clip(ends, 0.1, SIZE - 0.1)
    return {"a": starts.astype(np.float32), "b": ends.astype(np.float32)}


def test_octree_turned_and_octree_ray(device, bound):
    inputs = ways(300, 1)
    along = inputs["b"] - inputs["a"]
    found = ask_exact(device, "vec4(octree_ray(a, b).slope, octree_ray(a, b).axis, 0.0)", inputs, 4)
    axis = np.abs(along).argmax(axis=1)
    turned = np.take_along_axis(along, (axis[:, None] + (1, 2, 3)) % 3, axis=1)
    assert np.array_equal(found[:, 2], axis)
    assert found[:, :2] == pytest.approx(turned[:, :2] / turned[:, 2:], abs=1e-6)
    assert np.array_equal(ask_exact(device, "octree_turned(b - a, octree_ray(a, b).axis)", inputs, 3), turned)


def test_octree_triangle_reads_what_was_built(device):
    triangles = on_lattice(soup(50, DEPTH, np.random.default_rng(2)))
    colours = np.random.default_rng(3).uniform(size=(50, 3)).astype(np.float32)
    kept = build_exact(device, [triangles[:20], triangles[20:]], DEPTH, [colours[:20], colours[20:]])
    inputs = {"tree": np.repeat([0, 1], [20, 30]).astype(np.int32), "i": np.r_[0:20, 0:30].astype(np.int32)}
    word = "octree_triangle_word(uint(tree), uint(i))"
    for part, corner in zip("abc", range(3), strict=True):
        assert np.array_equal(ask_exact(device, f"octree_triangle({word}).{part}", inputs, 3), triangles[:, corner])
    expected = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert ask_exact(device, f"octree_triangle({word}).normal", inputs, 3) == pytest.approx(expected, rel=1e-6)
    assert np.array_equal(ask_exact(device, f"octree_triangle_vector({word} + 12u)", inputs, 3), colours)
    del kept


def test_octree_crossing(device, bound):
    rng = np.random.default_rng(4)
    corners = on_lattice(rng.uniform(0.0, SIZE, (4000, 3, 3)))
    inputs = {**ways(4000, 5), **{name: corners[:, i] for i, name in enumerate("uvw")}}
    call = f"octree_crossing(octree_ray(a, b), OctreeTriangle(u, v, w, cross(v - u, w - u)), {SLACK})"
    found = ask_exact(device, call, inputs)
    exact = inputs["a"].astype(float), inputs["b"].astype(float), corners
    closed, open_ = (brick_triangles.crossings(*exact, slack) for slack in (2.0 * SLACK, 0.0))
    assert (found[np.isfinite(open_)] <= 1.0).all()
    assert np.isfinite(closed[found <= 1.0]).all()
    both = np.isfinite(open_)
    assert found[both] == pytest.approx(open_[both], abs=1e-4)
    assert 50 < both.sum() < 3950


def test_octree_list_is_that_of_core(device, bound):
    octree = build_exact_octree(bound, DEPTH)
    voxels = octree.tree.voxels()
    rows = np.random.default_rng(6).choice(len(voxels), 500)
    list_ = "octree_list(0u, octree_box(0u, octree_cell(p)).brick, octree_cell(p))"
    inputs = {"p": (voxels[rows] + 0.5).astype(np.float32)}
    spans = ask_exact(device, f"vec2({list_})", inputs, 2).astype(int)
    longest = int((spans[:, 1] - spans[:, 0]).max())
    numbers = [
        ask_exact(
            device, f"{list_}.x + {i}u < {list_}.y ? float(octree_triangle_words[{list_}.x + {i}u]) : -1.0", inputs
        )
        for i in range(longest)
    ]
    for row, found in zip(rows, np.stack(numbers, axis=1).astype(int), strict=True):
        expected = set(octree.triangles[octree.starts[row] : octree.starts[row + 1]].tolist())
        # More where a triangle touches the voxel within the growth of voxels on the device.
        assert expected <= set(found.tolist())
        assert len(set(found.tolist()) - {-1}) == (found >= 0).sum() <= len(expected) + 6


def test_octree_list_blocks_and_octree_list_nearest(device, bound):
    octree = build_exact_octree(bound, DEPTH)
    rng = np.random.default_rng(7)
    rows = rng.choice(len(octree.codes), 1000)
    middle = octree.tree.voxels()[rows] + rng.uniform(size=(1000, 3))
    way = rng.normal(size=(1000, 3))
    inputs = {
        "p": middle.astype(np.float32),
        "a": (middle - way).astype(np.float32),
        "b": (middle + way).astype(np.float32),
    }
    found = ask_exact(device, "vec3(list_blocks(p, a, b), list_nearest(p, a, b))", inputs, 3, LIST)
    for row, (blocks, fraction, _) in zip(range(1000), found, strict=True):
        listed = octree.triangles[octree.starts[rows[row]] : octree.starts[rows[row] + 1]]
        start, end = (np.repeat(inputs[name][row : row + 1].astype(float), len(listed), axis=0) for name in "ab")
        exact = brick_triangles.crossings(start, end, bound[listed])
        if np.isfinite(exact).any():
            assert blocks == 1.0
            assert fraction <= exact.min() + 1e-4
        assert (blocks == 1.0) == (fraction <= 1.0)
    assert 50 < found[:, 0].sum() < 950


def test_octree_tree_open_and_octree_tree_nearest(device, bound):
    inputs = ways(4000, 8)
    found = ask_exact(device, "vec3(tree_nearest(0u, a, b), float(octree_tree_open(0u, a, b)))", inputs, 3, LIST)
    fractions, triangle = crossings(inputs["a"], inputs["b"], bound)
    is_open = found[:, 2] > 0.5
    assert (is_open != np.isinf(fractions)).mean() <= 1e-3
    assert np.array_equal(is_open, found[:, 0] > 1.0)
    hit = ~is_open & np.isfinite(fractions)
    assert (np.abs(found[hit, 0] - fractions[hit]) > 1e-4).mean() <= 1e-3
    assert (found[hit, 1] != triangle[hit]).mean() <= 1e-2
    assert 0.1 < hit.mean() < 0.95


def test_octree_open_asks_both_trees(device):
    shapes = [on_lattice(shape) for shape in (torus(DEPTH, sides=(24, 12)), box((3.0, 3.0, 40.0), (60.0, 60.0, 40.1)))]
    kept = build_exact(device, shapes, DEPTH)
    inputs = ways(2000, 9)
    found = ask_exact(device, "float(octree_open(a, b))", inputs) > 0.5
    each = [np.isinf(crossings(inputs["a"], inputs["b"], shape)[0]) for shape in shapes]
    assert (found != (each[0] & each[1])).mean() <= 1e-3
    assert (each[0] & ~each[1]).any()
    assert (each[1] & ~each[0]).any()
    del kept


def test_octree_lift_and_octree_edge_slack(device, bound):
    found = ask_exact(device, "vec2(octree_lift(), octree_edge_slack())", {"x": np.zeros(1, np.float32)}, 2)
    assert found.tolist() == [[LIFT, SLACK]]


def test_octree_exit_leads_out_of_the_voxels(device, bound):
    rng = np.random.default_rng(10)
    starts, ways_ = rng.uniform(0.0, SIZE, (500, 3)), rng.normal(size=(500, 3))
    ways_[::5] = np.eye(3)[rng.integers(0, 3, 100)]
    ways_ /= np.linalg.norm(ways_, axis=1, keepdims=True)
    lengths = ask_exact(device, "octree_exit(p, d)", {"p": starts, "d": ways_})
    ends = starts + ways_ * lengths[:, None]
    assert ((ends < 0.0) | (ends > SIZE)).any(axis=1).all()
    before = starts + ways_ * (lengths - 1.01)[:, None]
    assert ((before > -0.1) & (before < SIZE + 0.1)).all()


def test_octree_points_see_everywhere_exact(device, bound):
    pairs = facing_pairs(bound, 12_000, 11)
    found, expected = sees(device, pairs, ALL_EXACT), exactly_seen(pairs, bound)
    assert (found != expected).mean() <= 1e-3
    assert 0 < expected.sum() < len(expected)


@pytest.mark.parametrize("exact_reach", [1, 3])
def test_octree_points_see_within_a_reach_is_that_of_core(device, bound, exact_reach):
    pairs = facing_pairs(bound, 2000, 12)
    found = sees(device, pairs, exact_reach)
    expected = brick_triangles.points_see([build_exact_octree(bound, DEPTH)], *pairs.values(), exact_reach)
    assert (found != expected).mean() <= 3e-3
    assert 0 < expected.sum() < len(expected)


def test_octree_points_see_at_no_reach_asks_voxels_alone(device, bound):
    pairs = facing_pairs(bound, 3000, 13)
    assert np.array_equal(sees(device, pairs, 0), ask(device, "float(octree_surfaces_see(p, n, q, m))", pairs) > 0.5)


def directions(normals, rng, steepest=1.0):
    """Unit, on the side of the normals, at most at a sine of `steepest` over their planes."""
    along = rng.normal(size=normals.shape)
    along -= (along * normals).sum(axis=1, keepdims=True) * normals
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    sine = rng.uniform(0.0, steepest, (len(normals), 1))
    return np.sqrt(1.0 - sine**2) * along + sine * normals


@pytest.mark.parametrize("steepest", [1.0, 0.01])
def test_octree_first_hit_is_the_nearest_of_all_triangles(device, bound, steepest):
    """Also of ways that graze the surface where they begin: it never meets itself."""
    rng = np.random.default_rng(14)
    places, normals = surface_points(bound, 3000, rng)
    inputs = {"p": places.astype(np.float32), "n": normals.astype(np.float32)}
    inputs["d"] = directions(normals, rng, steepest).astype(np.float32)
    hit = ask_exact(device, "hit_place(octree_first_hit(p, n, d))", inputs, 4, LIST)
    starts = inputs["p"].astype(float) + LIFT * inputs["n"]
    fractions, first = crossings(starts, starts + 2.0 * SIZE * inputs["d"], bound)
    found = hit[:, 3] > 0.5
    assert (found != np.isfinite(fractions)).mean() <= 1e-3
    both = found & np.isfinite(fractions)
    exact = starts[both] + 2.0 * SIZE * fractions[both, None] * inputs["d"][both]
    across = np.cross(bound[:, 1] - bound[:, 0], bound[:, 2] - bound[:, 0])[first[both]]
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    # On the plane of the right triangle, and where a way does not graze it in the right place.
    height = np.abs(((hit[both, :3] - exact) * unit).sum(axis=1))
    assert (height > LIFT / 4.0).mean() <= 1e-3
    steep = np.abs((unit * inputs["d"][both]).sum(axis=1)) > 0.01
    assert (np.linalg.norm(hit[both, :3] - exact, axis=1)[steep] > 100.0 * LIFT / 4.0).mean() <= 1e-3
    assert both.any()


def test_octree_first_hit_tells_side_reflectance_and_distance(device):
    plates = np.array([[[4.0, 4.0, z], [60.0, 4.0, z], [4.0, 60.0, z]] for z in (40.0, 20.0)])
    colours = [np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], np.float32)]
    kept = build_exact(device, [plates], DEPTH, colours)
    inputs = {
        "p": np.array([[10.0, 10.0, z] for z in (50.0, 30.0, 10.0)]),
        "d": np.array([[0, 0, -1], [0, 0, 1], [0, 0, 1]]),
    }
    call = "octree_first_hit(p, vec3(0.0), d)"
    place = ask_exact(device, f"hit_place({call})", inputs, 4, LIST)
    normal = ask_exact(device, f"hit_normal({call})", inputs, 4, LIST)
    reflectance = ask_exact(device, f"hit_reflectance({call})", inputs, 4, LIST)
    assert place == pytest.approx(np.array([[10, 10, 40, 1], [10, 10, 40, 1], [10, 10, 20, 1]]), abs=1e-4)
    assert np.array_equal(normal, [[0, 0, 1, 0], [0, 0, 1, 1], [0, 0, 1, 1]])
    expected = np.array([[0.1, 0.2, 0.3, 10.0], [0.0, 0.0, 0.0, 10.0], [0.0, 0.0, 0.0, 10.0]])
    assert reflectance == pytest.approx(expected, abs=1e-4)
    del kept


def test_of_two_triangles_in_one_place_the_first_is_met(device):
    one = np.array([[4.0, 4.0, 8.0], [20.0, 4.0, 8.0], [4.0, 20.0, 8.0]])
    shapes = [np.stack([one + np.array([0.0, 0.0, 4.0]), *[one] * 5]), one[None]]
    kept = build_exact(device, shapes, DEPTH, [np.linspace(0.0, 0.5, 18).reshape(6, 3), np.ones((1, 3))])
    inputs = {"p": np.full((64, 3), (8.0, 8.0, 20.0)), "d": np.full((64, 3), (0.0, 0.0, -1.0))}
    inputs["p"][:32, 2] = 10.0
    found = ask_exact(device, "hit_reflectance(octree_first_hit(p, vec3(0.0), d))", inputs, 4, LIST)
    assert found[:32, :3] == pytest.approx(np.tile(np.linspace(0.0, 0.5, 18)[3:6], (32, 1)))
    assert found[32:, :3] == pytest.approx(np.tile(np.linspace(0.0, 0.5, 18)[:3], (32, 1)))
    way = {"p": np.array([[8.0, 8.0, 7.9]]), "a": np.array([[8.0, 8.0, 10.0]]), "b": np.array([[8.0, 8.0, 6.0]])}
    assert ask_exact(device, "keeps_smaller(p, a, b)", way, 1, LIST) == 1.0
    del kept


def test_no_way_slips_between_two_triangles(device):
    """Through the edges and corners of a fan, in float32, from every side: always blocked."""
    rng = np.random.default_rng(15)
    around = np.linspace(0.0, 2.0 * np.pi, 14)[:-1]
    rim = np.stack(
        [32.0 + 25.0 * np.cos(around), 31.0 + 22.0 * np.sin(around), 30.0 + 6.0 * np.sin(3.0 * around)], axis=1
    )
    fan = on_lattice(np.stack([np.tile([30.3, 32.1, 33.7], (13, 1)), rim, np.roll(rim, -1, axis=0)], axis=1))
    kept = build_exact(device, [fan], DEPTH)
    spoke = rng.integers(0, 13, 20_000)
    share = np.where(rng.uniform(size=(20_000, 1)) < 0.1, 0.0, rng.uniform(0.0, 0.999, (20_000, 1)))
    on_edge = fan[spoke, 0] + share * (fan[spoke, 1] - fan[spoke, 0])
    way = rng.normal(size=(20_000, 3)) * (0.2, 0.2, 1.0)
    way *= 20.0 / np.abs(way).max(axis=1, keepdims=True)
    inputs = {
        "a": (on_edge - way).astype(np.float32),
        "b": (on_edge + rng.uniform(0.2, 1.0, (20_000, 1)) * way).astype(np.float32),
    }
    assert not ask_exact(device, "float(octree_open(a, b))", inputs).any()
    del kept


def leaks(device, depth, count, reaches):
    """How many ways between points in space that cross a ball's surface are not blocked, for each reach; and how many
    cross it."""
    rng = np.random.default_rng(depth)
    size = float(1 << depth)
    ball = on_lattice(sphere(depth, rings=12), depth)
    kept = build_exact(device, [ball], depth)
    leaked, crossing = dict.fromkeys(reaches, 0), 0
    for _ in range(0, count, 20_000):
        starts, ends = rng.uniform(0.0, size, (2, 20_000, 3)).astype(np.float32)
        near = starts[::2] + rng.normal(size=(10_000, 3)) * 2.0 ** rng.uniform(0.0, depth - 2, (10_000, 1))
        ends[::2] = np.clip(near, 0.0, size)
        crosses = convex_crossing(starts.astype(float), ends.astype(float), ball)
        crossing += int(crosses.sum())
        nothing = np.zeros((int(crosses.sum()), 3), np.float32)
        pairs = {"p": starts[crosses], "n": nothing, "q": ends[crosses], "m": nothing}
        for reach in reaches:
            leaked[reach] += int(sees(device, pairs, reach).sum())
    del kept
    return leaked, crossing


def test_no_light_through_a_ball(device):
    leaked, crossing = leaks(device, 7, 20_000, (0, *REACHES))
    assert not any(leaked.values())
    assert crossing > 3000


@pytest.mark.full
@pytest.mark.parametrize("depth", [7, 8])
def test_no_light_through_a_ball_in_a_million(device, depth):
    assert not any(leaks(device, depth, 1_000_000, (0, *REACHES))[0].values())


BURNED = """
// After so many rounds that a software renderer has cut off all loops.
vec2 burned(vec3 a, vec3 b) {
    float sum = 0.0;
    for (int i = 0; i < 70000 && sum >= 0.0; ++i) {
        sum += fract(a.x * float(i));
    }
    return vec2(octree_open(a, b) && sum >= 0.0, octree_clear(a, b) && sum >= 0.0);
}
"""


def test_a_way_that_is_cut_off_counts_as_blocked(device, bound):
    inputs = ways(512, 19)
    blocked = np.isfinite(crossings(inputs["a"], inputs["b"], bound)[0])
    found = ask_exact(device, "burned(a, b)", inputs, 2, BURNED)
    assert not found[blocked].any()
    assert blocked.any()


def contact_pairs(count):
    """Points of a floor and of the sides and the top of a block on it, near the line where they meet and elsewhere."""
    rng = np.random.default_rng(16)
    away = 10.0 ** rng.uniform(-4.0, 1.0, count)
    up = 10.0 ** rng.uniform(-4.0, 1.0, count)
    along = rng.uniform(21.0, 29.0, (2, count))
    floor = np.stack([along[0], 32.0 + away, np.full(count, 0.5)], axis=1)
    side = np.stack([along[1], np.full(count, 32.0), 0.5 + up], axis=1)
    normals = np.tile([[0.0, 0.0, 1.0]], (count, 1)), np.tile([[0.0, 1.0, 0.0]], (count, 1))
    return floor, normals[0], side, normals[1]


def test_floor_and_side_of_a_block_see_each_other_up_to_where_they_meet(device):
    kept = build_exact(device, [on_lattice(room())], DEPTH)
    pairs = dict(zip("pnqm", contact_pairs(2000), strict=True))
    assert sees(device, pairs, ALL_EXACT).all()
    del kept


def test_nothing_is_seen_from_under_a_block_nor_through_a_thin_wall(device):
    """Points of the floor under the block, which stands on it, and points on both sides of a wall of 1/20 voxel."""
    kept = build_exact(device, [on_lattice(room())], DEPTH)
    rng = np.random.default_rng(17)
    count = 2000
    under = np.stack([rng.uniform(20.01, 29.99, count), rng.uniform(20.01, 31.99, count), np.full(count, 0.5)], axis=1)
    ceiling = np.stack([rng.uniform(1.0, 60.0, count), rng.uniform(1.0, 59.0, count), np.full(count, 55.0)], axis=1)
    up, down = np.tile([[0.0, 0.0, 1.0]], (count, 1)), np.tile([[0.0, 0.0, -1.0]], (count, 1))
    height, away = rng.uniform(0.51, 29.99, count), 10.0 ** rng.uniform(-3.0, 1.0, (2, count))
    depth = rng.uniform(10.01, 49.99, count)
    left = np.stack([45.0 - away[0], depth, height], axis=1)
    right = np.stack([45.05 + away[1], depth, height], axis=1)
    nothing = np.zeros((count, 3))
    for exact_reach in REACHES:
        assert not sees(device, {"p": under, "n": up, "q": ceiling, "m": down}, exact_reach).any()
        assert not sees(device, {"p": left, "n": nothing, "q": right, "m": nothing}, exact_reach).any()
    del kept


def test_corners_of_a_room_see_each_other(device):
    """Three walls that meet: from a ten thousandth of a voxel to ten voxels from the corner."""
    kept = build_exact(device, [on_lattice(room())], DEPTH)
    rng = np.random.default_rng(18)
    far = 10.0 ** rng.uniform(-4.0, 1.0, (3, 3000, 3))
    walls = []
    for axis in range(3):
        places = 0.5 + far[axis]
        places[:, axis] = 0.5
        walls.append((places, np.tile(np.eye(3)[axis], (3000, 1))))
    for one, other in ((0, 1), (1, 2), (2, 0)):
        pairs = dict(zip("pnqm", (*walls[one], *walls[other]), strict=True))
        assert sees(device, pairs, ALL_EXACT).all()
    del kept
