# SPDX-License-Identifier: GPL-3.0-or-later
"""hard_cases.blend from its ten cameras: finite, steady under small moves, the same wherever and however large it is.

Two pictures are the same when no pixel differs by more than 1/255 as displayed: linear light times the exposure that
puts the reference picture's mean at 18 % grey, clipped to [0, 1], through the sRGB transfer.

A small move is 1e-4 of the scene: of the diagonal of the box around what the camera sees. The floor and the far tower
are left out of that box, unless nothing else shows: a ten-thousandth of their kilometre is more than a prop's whole
neighbourhood, where a right picture changes too. A sun is turned by 1e-4.

The shadow state of a pixel is the share of each lamp's light that reaches it: a lamp's picture with shadows over the
one without. Lamps are told apart by colour, three in one picture. So that shadows that flicker cannot pass as changes
of state, only a share of AT_SHADOW_EDGES of the pixels on one face may change by more than LARGEST_CHANGE at all.

A few pixels of a right picture change by more in one state of shadow: over the rim of a saucer 0.2 mm high light slopes
by nearly the picture's mean from pixel to pixel; a grazing ray slides along the floor by many times the move; and where
a light pierces the visible surface, what it gives ends at its plane. They pass if their direct light changes in
proportion to the move and all form factors are those of the oracle, before and after it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from numpy.lib.stride_tricks import sliding_window_view  # noqa: E402

from vlm_addon.blender.extraction.lamps import read_camera  # noqa: E402
from vlm_addon.blender.extraction.light_mesh_io import extract  # noqa: E402
from vlm_addon.blender.extraction.materials import FindingList  # noqa: E402
from vlm_addon.core.form_factor import polygon_form_factor  # noqa: E402
from vlm_addon.core.scene import SUN  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.frame_types import RenderSettings  # noqa: E402
from vlm_addon.render.images import srgb_encoded  # noqa: E402

FILE = Path(__file__).resolve().parents[2] / "sample_blends" / "hard_cases.blend"
SCENERY = ("Kilometre floor", "Far tower")
CAMERAS = [
    "01 millimetre props",
    "02 kilometre floor",
    "03 touching walls",
    "04 inner corner",
    "05 slivers",
    "06 cloth",
    "07 cloth from behind",
    "08 thin shells",
    "09 grazing",
    "10 from above",
]
# One sample a pixel, at its centre, so that a pixel's face is all that it shows.
SMALL = RenderSettings(128, 96, "vlm", samples=1, shadow_resolution=512, shadow_samples=1, buffers=True)
LARGE = replace(SMALL, width=320, height=240, shadow_resolution=1024, shadow_samples=8)
LARGE_ONLY = pytest.mark.full
SIZES = [pytest.param(SMALL, id="small"), pytest.param(LARGE, id="large", marks=LARGE_ONLY)]
# A virtual light's own measure of the lamps is as coarse as the points that it takes of them.
STEADY_SIZES = [
    pytest.param(replace(SMALL, shadow_samples=4), id="small"),
    pytest.param(replace(LARGE, shadow_samples=16), id="large", marks=LARGE_ONLY),
]
SCALED = [
    # Both scales of every camera take twice as long; the small pictures alternate.
    pytest.param(scale, camera, settings, id=f"{scale:g}-{camera}-{name}", marks=marks)
    for number, camera in enumerate(CAMERAS)
    for scale_number, scale in enumerate((1e-3, 1e3))
    for settings, name, marks in (
        (SMALL, "small", LARGE_ONLY if (number + scale_number) % 2 else ()),
        (LARGE, "large", LARGE_ONLY),
    )
]

# What the techniques `direct` and `vlm` show: nothing in the scene glows.
PICTURES = ("direct", "combined")

MOVE = 1e-4
DIRECTION = np.array([0.48, 0.60, 0.64])
LARGEST_CHANGE = 0.02
GREY = 0.18
# A state is a share of light: equal within what the filter of a shadow map leaves over a lit surface.
SAME_STATE = 1.0 / 64.0
# The moves shift edges by a hundredth of a pixel, but a lamp that moves meets them at other texels of its map.
AT_SHADOW_EDGES = 0.02
# Share of what shows that must be left to compare; the cloth's triangles are the smallest on screen.
LEAST_COMPARED = 0.2
# Share of the compared pixels that may change by more, if that is right to within NOT_RIGHT.
STEEP = 3e-4
NOT_RIGHT = 0.25 * LARGEST_CHANGE


class HardCases:
    """The scene as arrays, and its pictures, each rendered once."""

    def __init__(self, move=(0.0, 0.0, 0.0)):
        """move: m, added to the location of every object in Blender."""
        bpy.ops.wm.open_mainfile(filepath=str(FILE))
        for thing in bpy.context.scene.objects:
            if thing.parent is None:
                thing.location = [a + b for a, b in zip(thing.location, move, strict=True)]
        bpy.context.view_layer.update()
        scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
        both = extract()
        self.snapshot, self.light_mesh = both.snapshot, both.light_mesh
        self.cameras = {
            thing.name.removeprefix("Camera "): read_camera(
                thing.evaluated_get(depsgraph), np.array(thing.matrix_world, np.float64), scene, FindingList()
            )
            for thing in scene.objects
            if thing.type == "CAMERA"
        }
        self._kept = {}

    def picture(self, device, camera, settings):
        """Images of the scene as it is."""
        if (camera, *picture_key(settings)) not in self._kept:
            self.keep(camera, settings, render(device, self.seen_by(camera), self.light_mesh, settings))
        return self._kept[camera, *picture_key(settings)]

    def keep(self, camera, settings, images):
        self._kept[camera, *picture_key(settings)] = images

    def seen_by(self, camera):
        return replace(self.snapshot, camera=self.cameras[camera])

    def states(self, device, camera, settings):
        """Shadow states of the scene as it is."""
        key = (camera, "states", settings.width)
        if key not in self._kept:
            self._kept[key] = shadow_states(device, self.seen_by(camera), settings)
        return self._kept[key]

    def visible_size(self, images):
        """Diagonal of the box around what shows, without the scenery where there is anything else; m."""
        counts = [len(mesh.triangles) for mesh in self.snapshot.meshes]
        is_scenery = np.repeat([mesh.name in SCENERY for mesh in self.snapshot.meshes], counts)
        faces = images["face_id"][..., 0].astype(int)
        shown = faces >= 0
        props = shown & ~is_scenery[faces]
        points = images["position"][props if props.any() else shown]
        return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def picture_key(settings):
    return settings.technique, settings.width, settings.shadow_samples


def render(device, snapshot, light_mesh, settings):
    return device.render(snapshot, light_mesh, settings).images


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


@pytest.fixture(scope="module")
def hard_cases():
    return HardCases()


def shadow_states(device, snapshot, settings):
    """(h, w, lamps): share of each lamp's light that its shadows leave; 0 where it sends none."""
    settings = replace(settings, technique="direct", buffers=False)
    states = []
    for first in range(0, len(snapshot.lights), 3):
        lamps = snapshot.lights[first : first + 3]
        coloured = [
            replace(lamp, power=tuple(np.eye(3)[channel] * max(lamp.power))) for channel, lamp in enumerate(lamps)
        ]
        lit, unshadowed = (
            render(device, replace(snapshot, lights=tuple(some)), None, settings)["direct"]
            for some in (coloured, [replace(lamp, casts_shadow=False) for lamp in coloured])
        )
        least = 1e-6 * unshadowed.max(axis=(0, 1))
        share = np.where(unshadowed > least, lit / np.maximum(unshadowed, 1e-30), 0.0)
        states.append(share[..., : len(lamps)])
    return np.concatenate(states, axis=2)


def neighbourhood_spread(values):
    """(h, w) largest difference between values in the 3 x 3 pixels around each, over the channels of (h, w, c)."""
    windows = sliding_window_view(np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge"), (3, 3), axis=(0, 1))
    return (windows.max(axis=(-1, -2)) - windows.min(axis=(-1, -2))).max(axis=-1)


def require_steady(device, hard_cases, camera, settings, moved):
    """Fails where a pixel on one face in one shadow state, both unchanged, changes too much.

    moved: the scene after a share of the move.
    """
    after = {1.0: render(device, moved(1.0), hard_cases.light_mesh, settings)}
    before = hard_cases.picture(device, camera, settings)
    faces = [images["face_id"] for images in (before, after[1.0])]
    same_face = (faces[0] == faces[1]).all(axis=-1) & (faces[0][..., 0] >= 0)
    same_face &= (neighbourhood_spread(faces[0]) == 0) & (neighbourhood_spread(faces[1]) == 0)
    large = same_face & (largest_change(before, after[1.0]) > LARGEST_CHANGE)
    assert large.sum() <= AT_SHADOW_EDGES * same_face.sum()
    compared = same_face
    if large.any():
        states = [hard_cases.states(device, camera, settings), shadow_states(device, moved(1.0), settings)]
        for state in states:
            compared = compared & (neighbourhood_spread(state) <= SAME_STATE)
        compared &= np.abs(states[1] - states[0]).max(axis=-1) <= SAME_STATE
    assert compared.sum() >= LEAST_COMPARED * (faces[0][..., 0] >= 0).sum()
    large &= compared
    if large.any():
        assert large.sum() <= STEEP * compared.sum()
        after |= {share: render(device, moved(share), hard_cases.light_mesh, settings) for share in (0.5, 0.25)}
        require_in_proportion(before, after, large)
        for scene in (hard_cases.seen_by(camera), moved(1.0)):
            require_exact_form_factors(device, scene, hard_cases.light_mesh, settings, large)


def largest_change(before, after):
    """(h, w) change of either picture, as a share of the greater of the pixel and the picture's mean."""
    return np.max([np.abs(change(before, after, name)).max(axis=-1) for name in PICTURES], axis=0)


def change(before, after, name):
    old, new = before[name][..., :3], after[name][..., :3]
    return (new - old) / np.maximum(old, old.mean())


def require_in_proportion(before, after, pixels):
    """Fails unless direct light at `pixels` changes by half when the move is halved: so slopes do, flicker does not."""
    for share in (1.0, 0.5):
        whole, half = (change(before, after[part], "direct")[pixels] for part in (share, 0.5 * share))
        assert np.abs(whole - 2.0 * half).max() <= NOT_RIGHT


def require_exact_form_factors(device, scene, light_mesh, settings, pixels):
    """Fails unless the form factors of all lights add up at `pixels` as they do in the float64 oracle."""
    lights = len(light_mesh)
    glowing = replace(
        light_mesh,
        colour=np.zeros((lights, 3), np.float32),
        emission=np.ones((lights, 3), np.float32),
        strength=np.ones(lights, np.float32),
    )
    images = render(device, replace(scene, lights=()), glowing, settings)
    normals = images["normal"][pixels].astype(np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    exact = polygon_form_factor(images["position"][pixels].astype(np.float64), normals, light_mesh.corners).sum(axis=1)
    assert np.abs(images["irradiance"][pixels][:, 0] - exact).max() <= NOT_RIGHT * max(exact.max(), 1.0)


def require_same_picture(expected, found):
    for name in PICTURES:
        exposure = GREY / expected[name][..., :3].mean()
        displayed = [srgb_encoded(exposure * images[name]) for images in (expected, found)]
        difference = np.abs(displayed[0] - displayed[1]).max(axis=-1)
        row, column = np.unravel_index(difference.argmax(), difference.shape)
        where = f"{name}: {255 * difference.max():.2f}/255 at column {column}, row {row}"
        assert difference.max() <= 1.0 / 255.0, where


@pytest.mark.parametrize("settings", SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_every_frame_buffer_is_finite_and_not_negative(device, hard_cases, camera, settings):
    # The renderer itself would set what is not finite to 0 and say so in a finding.
    for technique in ("direct", "vlm"):
        chosen = replace(settings, technique=technique)
        frame = device.render(hard_cases.seen_by(camera), hard_cases.light_mesh, chosen)
        assert not [str(finding) for finding in frame.findings]
        for name, image in frame.images.items():
            assert np.isfinite(image).all(), name
            if name not in ("position", "normal", "material_id", "tag_id", "face_id"):
                assert (image >= 0.0).all(), name
        assert frame.images["combined"][..., :3].mean() > 0.0
        hard_cases.keep(camera, chosen, frame.images)


@pytest.mark.parametrize("settings", SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_both_techniques_show_the_same_direct_light(device, hard_cases, camera, settings):
    """So that the tests below may look at both in one frame."""
    direct = hard_cases.picture(device, camera, replace(settings, technique="direct"))["direct"]
    assert (hard_cases.picture(device, camera, settings)["direct"] == direct).all()


@pytest.mark.parametrize("settings", STEADY_SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_small_move_of_the_camera_changes_little(device, hard_cases, camera, settings):
    scene = hard_cases.seen_by(camera)
    distance = MOVE * hard_cases.visible_size(hard_cases.picture(device, camera, settings))

    def moved(share):
        matrix = scene.camera.matrix_world.copy()
        matrix[:3, 3] += share * distance * DIRECTION
        return replace(scene, camera=replace(scene.camera, matrix_world=matrix))

    require_steady(device, hard_cases, camera, settings, moved)


@pytest.mark.parametrize("settings", STEADY_SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_small_move_of_the_lamps_changes_little(device, hard_cases, camera, settings):
    """All at once: each moves along a direction of its own."""
    scene = hard_cases.seen_by(camera)
    distance = MOVE * hard_cases.visible_size(hard_cases.picture(device, camera, settings))

    def moved(share):
        lamps = [
            moved_lamp(lamp, share * distance, share * MOVE, np.roll(DIRECTION, i))
            for i, lamp in enumerate(scene.lights)
        ]
        return replace(scene, lights=tuple(lamps))

    require_steady(device, hard_cases, camera, settings, moved)


def moved_lamp(lamp, distance, angle, direction):
    """The lamp moved by `distance` along a unit direction; a sun turned by a small angle about it."""
    if lamp.kind != SUN:
        return replace(lamp, position=tuple(np.add(lamp.position, distance * direction)))
    axes = [np.array(axis) for axis in (lamp.x_axis, lamp.y_axis, lamp.z_axis)]
    turned = [axis + angle * np.cross(direction, axis) for axis in axes]
    x, y, z = (tuple(axis / np.linalg.norm(axis)) for axis in turned)
    return replace(lamp, x_axis=x, y_axis=y, z_axis=z)


def transformed(scene, light_mesh, scale, offset):
    """Scene and light mesh with every length and place times `scale`, then moved by `offset`, in float64.

    Powers grow with the square of the scale, so that each surface receives as much as before.
    """

    def placed(points):
        return scale * np.asarray(points, np.float64) + offset

    lamps = [
        replace(
            lamp,
            position=tuple(placed(lamp.position)),
            power=lamp.power if lamp.kind == SUN else tuple(scale**2 * np.array(lamp.power)),
            radius=scale * lamp.radius,
            size_x=scale * lamp.size_x,
            size_y=scale * lamp.size_y,
        )
        for lamp in scene.lights
    ]
    matrix = scene.camera.matrix_world.copy()
    matrix[:3, 3] = placed(matrix[:3, 3])
    camera = replace(
        scene.camera,
        matrix_world=matrix,
        ortho_scale=scale * scene.camera.ortho_scale,
        clip_start=scale * scene.camera.clip_start,
        clip_end=scale * scene.camera.clip_end,
    )
    meshes = tuple(replace(mesh, positions=placed(mesh.positions)) for mesh in scene.meshes)
    samples = replace(light_mesh.samples, positions=placed(light_mesh.samples.positions))
    lights = replace(light_mesh, vertices=placed(light_mesh.vertices), samples=samples)
    return replace(scene, meshes=meshes, lights=tuple(lamps), camera=camera), lights


@pytest.mark.parametrize(("scale", "camera", "settings"), SCALED)
def test_a_scaled_scene_gives_the_same_picture(device, hard_cases, scale, camera, settings):
    expected = hard_cases.picture(device, camera, settings)
    scaled = transformed(hard_cases.seen_by(camera), hard_cases.light_mesh, scale, np.zeros(3))
    require_same_picture(expected, render(device, *scaled, settings))


@pytest.mark.parametrize("settings", SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("distance", [1e4, pytest.param(1e6, marks=LARGE_ONLY)])
def test_a_moved_snapshot_gives_the_same_picture(device, hard_cases, distance, camera, settings):
    expected = hard_cases.picture(device, camera, settings)
    moved = transformed(hard_cases.seen_by(camera), hard_cases.light_mesh, 1.0, distance * np.array([1.0, -1.0, 1.0]))
    require_same_picture(expected, render(device, *moved, settings))


@pytest.fixture(scope="module")
def far_away():
    """8,192 m from the world's origin: object positions are multiples of 2^-10 m, so float32 holds them all."""
    return HardCases((8192.0, 8192.0, 8192.0))


@pytest.mark.parametrize("settings", SIZES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_objects_moved_in_blender_give_the_same_picture(device, hard_cases, far_away, camera, settings):
    expected = hard_cases.picture(device, camera, settings)
    require_same_picture(expected, far_away.picture(device, camera, settings))


def test_there_are_no_other_cameras(hard_cases):
    assert sorted(hard_cases.cameras) == CAMERAS
