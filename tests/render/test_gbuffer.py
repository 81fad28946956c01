# SPDX-License-Identifier: GPL-3.0-or-later
"""What the G-buffer says of each pixel, against rays traced in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, facing_camera, quad
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import (
    DIFFUSE,
    ORTHOGRAPHIC,
    PRINCIPLED,
    Camera,
    Float64,
    Material,
    Mesh,
    SceneSnapshot,
    Texture,
)
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.gpu_layout import CONSTANTS
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.view import CENTRED, make_view

WIDTH, HEIGHT = 24, 16
Images = dict[str, np.ndarray]


def surfaces(
    device: Device,
    snapshot: SceneSnapshot,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    jitter: tuple[float, float] = CENTRED,
    sample_index: int = 0,
) -> Images:
    """The G-buffer's images with positions in world space, row 0 at the top; `shown` where a surface shows."""
    assert snapshot.camera is not None
    with device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        view = make_view(snapshot.camera, *size, geometry.origin, jitter)
        gbuffer = GBufferPass(context, device.shaders, *size).render(geometry, view, sample_index)
        images = {name: read_image(getattr(gbuffer, name)) for name in vars(gbuffer)}
    images["shown"] = np.any(images["geometric_normal"][..., :3] != 0.0, axis=2)
    images["world"] = images["position"][..., :3] + geometry.origin
    return images


def pixel_rays(camera: Camera, size: tuple[int, int], jitter: tuple[float, float] = CENTRED) -> tuple[Float64, Float64]:
    """Origins and directions in world space, (h, w, 3) each, of the rays through the pixels, row 0 at the top."""
    width, height = size
    left, right, bottom, top = camera.frame(width, height)
    x = left + (np.arange(width) + 0.5 + jitter[0]) / width * (right - left)
    y = bottom + (height - np.arange(height) - 0.5 + jitter[1]) / height * (top - bottom)
    grid = np.stack([*np.meshgrid(x, y), np.zeros((height, width))], axis=2)
    rotation, position = camera.matrix_world[:3, :3], camera.matrix_world[:3, 3]
    if camera.kind == ORTHOGRAPHIC:
        return position + grid @ rotation.T, np.broadcast_to(-rotation[:, 2], grid.shape)
    return np.broadcast_to(position, grid.shape), (grid - (0.0, 0.0, 1.0)) @ rotation.T


def scene(
    meshes: list[Mesh], camera: Camera, *materials: Material, textures: tuple[Texture, ...] = ()
) -> SceneSnapshot:
    return SceneSnapshot("test", tuple(meshes), materials or (Material("plain"),), textures, camera=camera)


FLOOR = quad((-50, -50, 0), (100, 0, 0), (0, 100, 0))
WALL = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
"""Fills `facing_camera`'s picture."""
CAMERAS = {
    "perspective": camera_at((1.0, -4.0, 3.0), (0.3, 0.0, 0.0)),
    "shifted": camera_at((1.0, -4.0, 3.0), (0.3, 0.0, 0.0), shift_x=0.2, shift_y=-0.3),
    "portrait lens": camera_at((1.0, -4.0, 9.0), (0.3, 0.0, 0.0), lens=85.0, sensor_fit="VERTICAL"),
    "orthographic": camera_at((1.0, -4.0, 9.0), (0.3, 0.0, 0.0), kind=ORTHOGRAPHIC, ortho_scale=3.0, shift_x=0.1),
}


@pytest.mark.parametrize("jitter", [CENTRED, (0.31, -0.44)], ids=["centre", "jittered"])
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_positions_lie_where_the_pixels_rays_meet_the_plane(
    device: Device, camera: Camera, jitter: tuple[float, float]
) -> None:
    images = surfaces(device, scene([FLOOR], camera), jitter=jitter)
    origins, directions = pixel_rays(camera, (WIDTH, HEIGHT), jitter)
    distance = -origins[..., 2:] / directions[..., 2:]
    expected = origins + distance * directions
    assert images["shown"].all()
    assert images["world"] == pytest.approx(expected, abs=2e-4)
    depth = (camera.matrix_world[:3, 3] - expected) @ camera.matrix_world[:3, 2]
    assert images["position"][..., 3] == pytest.approx(depth, abs=2e-4)


def test_positions_on_a_kilometre_of_floor_are_good_to_the_distance_from_the_eye(device: Device) -> None:
    """The rasteriser interpolates between corners a kilometre apart, which alone is off by some 0.05 mm."""
    floor = quad((-512, -512, 0), (1024, 0, 0), (0, 1024, 0))
    camera = camera_at((0.028, -0.05, 0.03), (0.0, 0.0, 0.003), clip_start=0.002, clip_end=2048.0)
    images = surfaces(device, scene([floor], camera))
    origins, directions = pixel_rays(camera, (WIDTH, HEIGHT))
    distance = -origins[..., 2:] / directions[..., 2:]
    error = np.linalg.norm(images["world"] - (origins + distance * directions), axis=2)
    assert images["shown"].all()
    assert (error <= 1e-6 * distance[..., 0]).all()


def test_a_scene_ten_kilometres_away_gives_the_same_pictures(device: Device) -> None:
    offset = np.array([8192.0, -8192.0, 4096.0])
    near, far = surfaces(device, box_room()), surfaces(device, box_room(offset))
    assert (near["shown"] == far["shown"]).all()
    assert far["world"] - offset == pytest.approx(near["world"], abs=1e-6)
    assert (near["ids"][near["shown"]] == far["ids"][near["shown"]]).all()


def test_ids_are_those_of_the_nearest_triangle(device: Device) -> None:
    behind = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=1, tag_id=7)
    before = quad((0, -1, 0.5), (1, 0, 0), (0, 2, 0), material=0, tag_id=9)
    materials = (Material("a", PRINCIPLED), Material("b", DIFFUSE))
    ids = surfaces(device, scene([behind, before], facing_camera(), *materials))["ids"]
    left, right = ids[HEIGHT // 2, 3], ids[HEIGHT // 2, -3]
    assert left[[0, 1, 3]].tolist() == [1, 7, CONSTANTS["MODEL_DIFFUSE"]]
    assert right[[0, 1, 3]].tolist() == [0, 9, CONSTANTS["MODEL_PRINCIPLED"]]
    assert left[2] in (0, 1)
    assert right[2] in (2, 3)


def test_triangles_of_one_mesh_keep_their_numbers_when_materials_sort_them(device: Device) -> None:
    """The first triangle is transparent, so it is drawn last."""
    mesh = replace(WALL, material_indices=np.array([1, 0], np.int32), tag_ids=np.array([3, 4], np.int32))
    materials = (Material("opaque"), Material("clear", alpha=1.0, alpha_texture=0))
    texture = Texture("white", np.ones((1, 1, 4), np.float32))
    ids = surfaces(device, scene([mesh], facing_camera(1.0), *materials, textures=(texture,)))["ids"]
    # The first triangle is the one below the diagonal.
    assert ids[-2, -2, :3].tolist() == [1, 3, 0]
    assert ids[1, 1, :3].tolist() == [0, 4, 1]


@pytest.mark.parametrize("flip", [False, True], ids=["front", "back"])
def test_both_normals_face_the_eye(device: Device, flip: bool) -> None:
    wall = quad((-1, -1, 0), (0, 2, 0), (2, 0, 0)) if flip else WALL
    images = surfaces(device, scene([wall], facing_camera()))
    for name in ("shading_normal", "geometric_normal"):
        assert images[name][..., :3] == pytest.approx(np.broadcast_to((0.0, 0.0, 1.0), (HEIGHT, WIDTH, 3)))


def test_smooth_normals_are_interpolated_over_the_surface_and_stay_unit(device: Device) -> None:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    normals = np.concatenate([0.5 * corners, np.ones((4, 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    wall = replace(WALL, corner_normals=normals[WALL.triangles].astype(np.float32))
    images = surfaces(device, scene([wall], facing_camera(1.5)))
    x, y = np.moveaxis(images["world"][..., :2], 2, 0)
    lower = y < x
    # Barycentric weights of the triangle that holds the point: (0, 1, 2) below the diagonal, (0, 2, 3) above it.
    weights = np.where(
        lower[..., None],
        np.stack([(1 - x) / 2, (x - y) / 2, (1 + y) / 2, 0 * x], axis=2),
        np.stack([(1 - y) / 2, 0 * x, (1 + x) / 2, (y - x) / 2], axis=2),
    )
    expected = weights @ normals
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    assert images["shading_normal"][..., :3] == pytest.approx(expected, abs=1e-5)
    assert images["geometric_normal"][..., 2] == pytest.approx(1.0)


@pytest.mark.parametrize("limit", ["clip_start", "clip_end"])
def test_what_lies_beyond_the_clip_distances_does_not_show(device: Device, limit: str) -> None:
    shown = surfaces(
        device, scene([WALL], facing_camera(2.0, **{limit: 2.0 + (-0.1 if limit == "clip_start" else 0.1)}))
    )
    clipped = surfaces(
        device, scene([WALL], facing_camera(2.0, **{limit: 2.0 + (0.1 if limit == "clip_start" else -0.1)}))
    )
    assert shown["shown"].all()
    assert not clipped["shown"].any()


def test_an_empty_scene_shows_nothing(device: Device) -> None:
    assert not surfaces(device, scene([], facing_camera()))["shown"].any()


def test_a_hundredth_of_a_millimetre_decides_which_of_two_surfaces_is_nearer(device: Device) -> None:
    near = quad((-1, -1, 1e-5), (2, 0, 0), (0, 2, 0), tag_id=1)
    images = surfaces(device, scene([near, WALL], facing_camera(2.0, clip_end=1000.0)))
    assert (images["ids"][..., 1] == 1).all()


@pytest.mark.parametrize(
    ("distance", "gap"), [(0.01, 1e-7), (0.05, 1e-6), (20.0, 1e-4), (400.0, 0.01)], ids=lambda value: f"{value} m"
)
@pytest.mark.parametrize("clip_start", [0.002, 0.1])
def test_near_and_far_surfaces_keep_their_order_between_millimetres_and_kilometres(
    device: Device, clip_start: float, distance: float, gap: float
) -> None:
    if clip_start > distance:
        clip_start = 0.5 * distance
    width = 2.0 * distance
    pair = [
        quad((-distance, -distance, height), (width, 0, 0), (0, width, 0), tag_id=tag)
        for tag, height in ((1, gap), (2, 0.0))
    ]
    camera = camera_at((0.3 * distance, -0.5 * distance, 0.8 * distance), (0, 0, 0))
    camera = replace(camera, clip_start=clip_start, clip_end=2048.0)
    images = surfaces(device, scene(pair, camera))
    assert images["shown"].mean() > 0.5
    assert (images["ids"][images["shown"]][:, 1] == 1).all()


def checker() -> Texture:
    """Four texels: red and green in the lower row, blue and white in the upper one, alpha 0, 1/3, 2/3, 1."""
    pixels = np.array(
        [[[1, 0, 0, 0], [0, 1, 0, 1 / 3]], [[0, 0, 1, 2 / 3], [1, 1, 1, 1]]],
        np.float32,
    )
    return Texture("checker", pixels, linear_filter=False)


def at_quarters(image: np.ndarray) -> np.ndarray:
    """Values amid the lower left, lower right, upper left and upper right quarter of `facing_camera(50 / 9)`'s wall."""
    height, width = image.shape[:2]
    return np.stack([image[(3 - 2 * v) * height // 4, (1 + 2 * u) * width // 4] for v in (0, 1) for u in (0, 1)])


WHOLE_WALL = 2.0 * 50 / 36
"""Distance from which the wall fills a square picture exactly."""


def test_a_base_colour_texture_multiplies_the_colour_and_stands_upright(device: Device) -> None:
    material = Material("m", base_color=(0.5, 0.25, 1.0), base_color_texture=0)
    images = surfaces(device, scene([WALL], facing_camera(WHOLE_WALL), material, textures=(checker(),)), (16, 16))
    expected = checker().pixels[..., :3].reshape(4, 3) * (0.5, 0.25, 1.0)
    assert at_quarters(images["base_color"])[:, :3] == pytest.approx(expected)


def test_linear_filtering_blends_texels(device: Device) -> None:
    texture = replace(checker(), linear_filter=True, repeat=False)
    material = Material("m", base_color=(1.0, 1.0, 1.0), base_color_texture=0)
    images = surfaces(device, scene([WALL], facing_camera(WHOLE_WALL), material, textures=(texture,)), (17, 17))
    assert images["base_color"][8, 8, :3] == pytest.approx([0.5, 0.5, 0.5], abs=1e-2)


@pytest.mark.parametrize(("repeat", "expected"), [(True, [1.0, 0.0, 0.0]), (False, [1.0, 1.0, 1.0])])
def test_a_texture_repeats_or_goes_on_with_its_edge(device: Device, repeat: bool, expected: list[float]) -> None:
    wall = replace(WALL, corner_uvs=WALL.corner_uvs + np.float32(1.0))
    material = Material("m", base_color=(1.0, 1.0, 1.0), base_color_texture=0)
    texture = replace(checker(), repeat=repeat)
    images = surfaces(device, scene([wall], facing_camera(WHOLE_WALL), material, textures=(texture,)), (16, 16))
    assert at_quarters(images["base_color"])[0, :3] == pytest.approx(expected)


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
@pytest.mark.parametrize(("value", "image"), [("roughness", "shading_normal"), ("metallic", "geometric_normal")])
def test_scalar_textures_are_read_by_their_channel(device: Device, value: str, image: str, channel: int) -> None:
    settings = {value: 0.5, f"{value}_texture": 0, f"{value}_channel": channel}
    snapshot = scene([WALL], facing_camera(WHOLE_WALL), Material("m", **settings), textures=(checker(),))
    found = at_quarters(surfaces(device, snapshot, (16, 16))[image])[:, 3]
    assert found == pytest.approx(0.5 * checker().pixels[..., channel].ravel())


def test_constants_of_the_material_arrive(device: Device) -> None:
    material = Material(
        "m",
        roughness=0.25,
        metallic=0.75,
        specular_ior_level=0.3,
        ior=1.7,
        emission=(1.0, 2.0, 3e4),
        base_color=(0.1, 0.2, 3.0),
    )
    images = surfaces(device, scene([WALL], facing_camera(), material))
    middle = {name: image[HEIGHT // 2, WIDTH // 2] for name, image in images.items()}
    assert middle["base_color"] == pytest.approx([0.1, 0.2, 3.0, 0.3])
    assert middle["emission"] == pytest.approx([1.0, 2.0, 3e4, 1.7])
    assert (middle["shading_normal"][3], middle["geometric_normal"][3]) == (0.25, 0.75)


def test_an_emission_texture_multiplies_the_emission(device: Device) -> None:
    material = Material("m", emission=(4.0, 5.0, 6.0), emission_texture=0)
    images = surfaces(device, scene([WALL], facing_camera(WHOLE_WALL), material, textures=(checker(),)), (16, 16))
    assert at_quarters(images["emission"])[:, :3] == pytest.approx(checker().pixels[..., :3].reshape(4, 3) * (4, 5, 6))


def test_corner_colours_multiply_only_where_the_material_reads_them(device: Device) -> None:
    colors = np.full((2, 3, 3), (0.5, 3.0, 0.25), np.float32)
    reading = Material("reads", base_color=(1.0, 1.0, 0.5), base_color_from_corners=True)
    left = replace(quad((-1, -1, 0), (1, 0, 0), (0, 2, 0), material=0), corner_colors=colors)
    right = quad((0, -1, 0), (1, 0, 0), (0, 2, 0), material=1)
    images = surfaces(
        device, scene([left, right], facing_camera(), reading, Material("plain", base_color=(0.2, 0.2, 0.2)))
    )
    assert images["base_color"][8, 3, :3] == pytest.approx([0.5, 3.0, 0.125])
    assert images["base_color"][8, -3, :3] == pytest.approx([0.2, 0.2, 0.2])


@pytest.mark.parametrize("turn", [False, True], ids=["uv along x", "uv along y"])
def test_a_normal_map_tilts_along_the_texture(device: Device, turn: bool) -> None:
    """The map says 45 degrees towards growing u."""
    tilt = np.sqrt(0.5)
    texel = np.array([0.5 + 0.5 * tilt, 0.5, 0.5 + 0.5 * tilt, 1.0], np.float32)
    uvs = WALL.corner_uvs[..., ::-1].copy() if turn else WALL.corner_uvs
    wall = replace(WALL, corner_uvs=uvs)
    snapshot = scene(
        [wall], facing_camera(), Material("m", normal_texture=0), textures=(Texture("n", texel[None, None]),)
    )
    found = surfaces(device, snapshot)["shading_normal"][HEIGHT // 2, WIDTH // 2, :3]
    assert found == pytest.approx([0.0, tilt, tilt] if turn else [tilt, 0.0, tilt], abs=1e-5)


def test_a_mirrored_texture_mirrors_only_its_own_axis(device: Device) -> None:
    """u runs against x; the map tilts towards growing v, which stays along y."""
    tilt = np.sqrt(0.5)
    texel = np.array([0.5, 0.5 + 0.5 * tilt, 0.5 + 0.5 * tilt, 1.0], np.float32)
    wall = replace(WALL, corner_uvs=WALL.corner_uvs * np.float32([-1.0, 1.0]))
    snapshot = scene(
        [wall], facing_camera(), Material("m", normal_texture=0), textures=(Texture("n", texel[None, None]),)
    )
    found = surfaces(device, snapshot)["shading_normal"][HEIGHT // 2, WIDTH // 2, :3]
    assert found == pytest.approx([0.0, tilt, tilt], abs=1e-5)


def test_a_normal_map_of_strength_zero_changes_nothing(device: Device) -> None:
    texel = np.array([1.0, 0.5, 0.5, 1.0], np.float32)
    material = Material("m", normal_texture=0, normal_strength=0.0)
    snapshot = scene([WALL], facing_camera(), material, textures=(Texture("n", texel[None, None]),))
    assert surfaces(device, snapshot)["shading_normal"][..., 2] == pytest.approx(1.0)


def test_a_normal_map_without_texture_coordinates_keeps_the_normal(device: Device) -> None:
    texel = np.array([1.0, 0.5, 0.5, 1.0], np.float32)
    wall = replace(WALL, corner_uvs=np.zeros((2, 3, 2), np.float32))
    snapshot = scene(
        [wall], facing_camera(), Material("m", normal_texture=0), textures=(Texture("n", texel[None, None]),)
    )
    assert surfaces(device, snapshot)["shading_normal"][..., 2] == pytest.approx(1.0)


def test_alpha_lets_its_share_of_the_samples_through_in_every_pixel(device: Device) -> None:
    samples, alpha = 32, 0.3
    snapshot = scene([WALL], facing_camera(), Material("m", alpha=alpha))
    share = np.mean([surfaces(device, snapshot, sample_index=i)["shown"] for i in range(samples)], axis=0)
    assert np.abs(share - alpha).max() <= 2.0 / samples
    assert share.mean() == pytest.approx(alpha, abs=0.25 / samples)


def test_layers_of_alpha_are_let_through_independently(device: Device) -> None:
    samples, alpha = 64, 0.5
    layers = [quad((-1, -1, -z), (2, 0, 0), (0, 2, 0)) for z in (0.0, 0.1)]
    snapshot = scene(layers, facing_camera(), Material("m", alpha=alpha))
    share = np.mean([surfaces(device, snapshot, sample_index=i)["shown"] for i in range(samples)])
    assert share == pytest.approx(1.0 - (1.0 - alpha) ** 2, abs=0.02)


@pytest.mark.parametrize(("alpha", "shows"), [(0.0, False), (1.0, True)])
def test_full_and_no_alpha_are_exact(device: Device, alpha: float, shows: bool) -> None:
    texture = Texture("a", np.full((1, 1, 4), alpha, np.float32))
    snapshot = scene([WALL], facing_camera(), Material("m", alpha_texture=0), textures=(texture,))
    for i in range(8):
        assert (surfaces(device, snapshot, sample_index=i)["shown"] == shows).all()


def test_many_materials_with_and_without_textures_are_drawn_in_one_go_each(device: Device) -> None:
    materials = [
        Material(f"m{i}", base_color=(0.1 * i, 1.0, 0.0), base_color_texture=0 if i % 2 else -1) for i in range(8)
    ]
    strips = [quad((-1 + 0.25 * i, -1, 0), (0.25, 0, 0), (0, 2, 0), material=i) for i in range(8)]
    white = Texture("half", np.full((1, 1, 4), 0.5, np.float32))
    images = surfaces(device, scene(strips, facing_camera(WHOLE_WALL), *materials, textures=(white,)), (16, 16))
    expected = [[0.1 * i * (0.5 if i % 2 else 1.0), 0.5 if i % 2 else 1.0, 0.0] for i in range(8)]
    assert images["base_color"][8, ::2, :3] == pytest.approx(np.array(expected), abs=1e-6)


BROKEN_MESHES = {
    "not finite": replace(WALL, positions=WALL.positions * [[np.nan], [1], [1], [1]]),
    "a vertex that is not there": replace(WALL, triangles=WALL.triangles + 1),
    "material index": replace(WALL, material_indices=np.array([0, 3], np.int32)),
}


@pytest.mark.parametrize("problem", BROKEN_MESHES)
def test_broken_meshes_are_refused_by_name(device: Device, problem: str) -> None:
    with pytest.raises(InvalidInput, match=f"'quad'.*{problem}"):
        surfaces(device, scene([BROKEN_MESHES[problem]], facing_camera()))


BROKEN_CAMERAS = {
    "matrix": replace(facing_camera(), matrix_world=np.zeros((4, 4))),
    "clip start": replace(facing_camera(), clip_start=0.0),
    "clip end": replace(facing_camera(), clip_end=0.05),
    "no width": replace(facing_camera(), kind=ORTHOGRAPHIC, ortho_scale=0.0),
    "picture has no width": replace(facing_camera(), lens=0.0),
}


@pytest.mark.parametrize("problem", BROKEN_CAMERAS)
def test_broken_cameras_are_refused(device: Device, problem: str) -> None:
    with pytest.raises(InvalidInput, match=f"'camera'.*{problem}"):
        surfaces(device, scene([WALL], BROKEN_CAMERAS[problem]))
