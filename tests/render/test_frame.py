# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished picture: what is in it, what it equals in closed form, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, facing_camera, lights_from_triangles, mesh_lights, quad
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.scene import DIFFUSE, POINT, Light, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.finished_images import NO_SURFACE
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.passes.accumulate import AccumulatePass, PictureLight, jitter_offsets
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.view import make_view

WALL = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
GREY = Material("grey", DIFFUSE, (0.6, 0.3, 0.9))
GLOW = Material("glow", DIFFUSE, (0.0, 0.0, 0.0), emission=(2.0, 3.0, 4e5))


def settings(technique: str = "direct", size: tuple[int, int] = (16, 12), **values: object) -> RenderSettings:
    chosen = {"samples": 1, "shadow_resolution": 64, "shadow_samples": 1, **values}
    return RenderSettings(*size, technique, **chosen)  # type: ignore[arg-type]


def test_glowing_surfaces_and_the_world_show_as_they_are(device: Device) -> None:
    strip = quad((-2, -2, 0), (2, 0, 0), (0, 4, 0))
    scene = SceneSnapshot("s", (strip,), (GLOW,), camera=facing_camera(), world_radiance=(0.25, 0.5, 7.0))
    frame = device.render(scene, None, settings())
    combined = frame.images["combined"]
    assert combined[:, :7] == pytest.approx(np.broadcast_to((2.0, 3.0, 4e5, 1.0), (12, 7, 4)))
    assert combined[:, 9:] == pytest.approx(np.broadcast_to((0.25, 0.5, 7.0, 1.0), (12, 7, 4)))
    assert frame.images["direct"].max() == frame.images["indirect"].max() == 0.0


def test_a_pixel_on_an_edge_is_the_share_that_the_edge_covers(device: Device) -> None:
    """Box filter: the edge lies at 0.3 of the pixel's width."""
    width, samples = 16, 64
    pixel = 2.0 * 36 / 50 / width
    strip = quad((-2, -2, 0), (2 + 2.3 * pixel, 0, 0), (0, 4, 0))
    scene = SceneSnapshot("s", (strip,), (replace(GLOW, emission=(1.0, 1.0, 1.0)),), camera=facing_camera())
    row = device.render(scene, None, settings(samples=samples)).images["combined"][5, :, 0]
    assert row[:10] == pytest.approx(1.0)
    assert row[10] == pytest.approx(0.3, abs=1.0 / samples)
    assert row[11:] == pytest.approx(0.0)


@pytest.mark.parametrize("samples", [1, 2, 3, 16, 100, 1000])
def test_samples_are_spread_evenly_about_the_centre(samples: int) -> None:
    offsets = jitter_offsets(samples)
    assert offsets.shape == (samples, 2)
    assert np.abs(offsets).max() <= 0.5 if samples > 1 else (offsets == 0.0).all()
    assert offsets.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    for axis in (0, 1):
        # Each of n slices holds its share of the samples, but for the shift to the mean.
        counts = np.histogram(offsets[:, axis], bins=max(samples // 4, 1), range=(-0.5, 0.5))[0]
        assert counts.sum() == samples
        assert counts.max() - counts.min() <= 4


def test_a_point_lamp_lights_a_diffuse_wall_by_the_inverse_square(device: Device) -> None:
    lamp = Light("lamp", POINT, (100.0, 200.0, 50.0), (0.4, -0.2, 1.0))
    scene = SceneSnapshot("s", (WALL,), (GREY,), lights=(lamp,), camera=facing_camera())
    images = device.render(scene, None, settings(buffers=True)).images
    to_lamp = np.array(lamp.position) - images["position"]
    distance = np.linalg.norm(to_lamp, axis=2)
    irradiance = (to_lamp[..., 2] / distance / (4 * math.pi * distance**2))[..., None] * lamp.power
    assert images["direct"] == pytest.approx(irradiance * GREY.base_color / math.pi, rel=1e-3)
    assert images["combined"][..., :3] == pytest.approx(images["direct"])


def test_virtual_lights_light_a_diffuse_wall_by_their_form_factors(device: Device) -> None:
    generator = np.random.default_rng(0)
    corners = generator.uniform((-1, -1, 0.2), (1, 1, 2.2), (40, 1, 3)) + generator.normal(0, 0.3, (40, 3, 3))
    emission = generator.uniform(0, 5, (40, 3))
    lights = lights_from_triangles(corners, emission=emission)
    scene = SceneSnapshot("s", (WALL,), (GREY,), camera=facing_camera())
    images = device.render(scene, lights, settings("vlm", buffers=True)).images
    points = images["position"].reshape(-1, 3).astype(float)
    truth = polygon_form_factor(points, np.tile((0.0, 0.0, 1.0), (len(points), 1)), corners) @ emission
    assert images["irradiance"].reshape(-1, 3) == pytest.approx(truth, rel=1e-3, abs=1e-4 * truth.max())
    assert images["indirect"] == pytest.approx(images["irradiance"] * GREY.base_color / math.pi, rel=1e-5)


def test_light_bounces_as_the_lamp_and_the_colour_say(device: Device) -> None:
    """A lamp on a tiny light's axis: radiosity = colour x irradiance at its sample, then one form factor."""
    lamp = Light("lamp", POINT, (100.0, 100.0, 100.0), (0.0, 0.0, 0.5), casts_shadow=False)
    # A light at height 1 that faces down to the wall, its colour above what a surface could reflect.
    corners = [[[-0.1, -0.1, 1.0], [0.0, 0.1, 1.0], [0.1, -0.1, 1.0]]]
    lights = lights_from_triangles(corners, emission=0.0, colour=(0.5, 1.0, 3.0))
    scene = SceneSnapshot("s", (WALL,), (GREY,), lights=(lamp,), camera=facing_camera())
    images = device.render(scene, lights, settings("vlm", buffers=True)).images
    centre = np.mean(corners[0], axis=0)
    to_lamp = np.array(lamp.position) - centre
    distance = np.linalg.norm(to_lamp)
    radiosity = 100.0 / (4 * math.pi * distance**2) * (-to_lamp[2] / distance) * np.array([0.5, 1.0, 3.0])
    points = images["position"].reshape(-1, 3).astype(float)
    factors = polygon_form_factor(points, np.tile((0.0, 0.0, 1.0), (len(points), 1)), np.array(corners))
    assert images["irradiance"].reshape(-1, 3) == pytest.approx(factors * radiosity, rel=1e-3)


def test_the_picture_is_emission_and_direct_and_indirect_light(device: Device) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, emission=0.2, colour=0.5)
    images = device.render(room, lights, settings("vlm", (32, 24), samples=4, buffers=True)).images
    emission = np.where(images["material_id"] == 3, 2.0, 0.0)
    inside = np.all(images["coverage"] == 1.0, axis=2) & (ids_are_uniform(images["material_id"]))
    total = images["direct"] + images["indirect"] + emission
    assert inside.sum() > 100
    assert images["combined"][inside][:, :3] == pytest.approx(total[inside], rel=1e-5)


def ids_are_uniform(image: np.ndarray) -> np.ndarray:
    """(h, w) whether a pixel and its eight neighbours hold the same id."""
    padded = np.pad(image[..., 0], 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return windows.min(axis=(2, 3)) == windows.max(axis=(2, 3))


def test_buffers_say_what_shows_at_the_pixels_centres(device: Device) -> None:
    images = device.render(box_room((1.0, 2.0, 3.0)), None, settings(size=(33, 25), buffers=True)).images
    shown = images["depth"][..., 0] > 0.0
    assert shown[12, 16]
    assert not shown[0, 0]
    assert images["position"][12, 16] == pytest.approx([2.0, 4.0, 4.0], abs=0.05)
    assert images["normal"][12, 16] == pytest.approx([0.0, -1.0, 0.0])
    assert images["albedo"][12, 16] == pytest.approx([0.8, 0.8, 0.8])
    assert images["depth"][12, 16, 0] == pytest.approx(5.0, abs=1e-4)
    glow = images["tag_id"][..., 0] == 5
    assert glow.any()
    assert (images["material_id"][glow] == 3).all()
    assert set(np.unique(images["face_id"][glow])) <= {10.0, 11.0}
    for name in ("material_id", "tag_id", "face_id"):
        assert (images[name][~shown] == NO_SURFACE).all()
    for image in images.values():
        assert image.dtype == np.float32
        assert image.ndim == 3
        assert image.shape[:2] == (25, 33)
        assert image.flags.c_contiguous


def test_without_buffers_there_are_three_pictures(device: Device) -> None:
    frame = device.render(box_room(), None, settings())
    assert list(frame.images) == ["combined", "direct", "indirect"]
    assert [frame.images[name].shape for name in frame.images] == [(12, 16, 4), (12, 16, 3), (12, 16, 3)]


def test_passes_are_timed_and_things_counted(device: Device) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, colour=0.5)
    frame = device.render(room, lights, settings("vlm", samples=2))
    names = [name for name, _ in frame.timings]
    assert {"geometry", "phase one", "G-buffer", "direct light", "phase two", "accumulate", "read back"} <= set(names)
    assert all(milliseconds >= 0.0 for _, milliseconds in frame.timings)
    counted = {"triangles": 12, "lights": 1, "samples": 2, "virtual_lights": 12, "evaluations": 2 * 16 * 12 * 12}
    assert counted.items() <= frame.counters.items()
    assert frame.device == device.name


def test_a_scene_in_the_dark_is_black_and_says_so(device: Device) -> None:
    scene = SceneSnapshot("cellar", (WALL,), (GREY,), camera=facing_camera())
    frame = device.render(scene, None, settings())
    assert frame.images["combined"][..., :3].max() == 0.0
    assert ["nothing lights its surfaces" in str(finding) for finding in frame.findings] == [True]


def test_an_empty_scene_is_its_world(device: Device) -> None:
    scene = SceneSnapshot("empty", camera=facing_camera(), world_radiance=(0.1, 0.2, 0.3))
    frame = device.render(scene, None, settings())
    assert frame.images["combined"] == pytest.approx(np.broadcast_to((0.1, 0.2, 0.3, 1.0), (12, 16, 4)))
    assert not frame.findings


def test_a_scene_without_camera_is_refused(device: Device) -> None:
    with pytest.raises(InvalidInput, match=r"'blind'.*no camera"):
        device.render(SceneSnapshot("blind"), None, settings())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("width", 0),
        ("height", -1),
        ("width", 100_000),
        ("samples", 0),
        ("samples", 1_000_000),
        ("shadow_resolution", 0),
        ("shadow_samples", 0),
    ],
)
def test_sizes_out_of_range_are_refused(device: Device, name: str, value: int) -> None:
    with pytest.raises(InvalidInput, match=f"'{name}'.*{value}"):
        device.render(box_room(), None, replace(settings(), **{name: value}))  # type: ignore[arg-type]


@pytest.mark.parametrize("power", [np.nan, np.inf])
def test_a_lamp_whose_power_is_no_number_is_refused(device: Device, power: float) -> None:
    room = box_room()
    lamps = (replace(room.lights[0], name="broken", power=(power, 1.0, 1.0)),)
    with pytest.raises(InvalidInput, match=r"'broken'.*power"):
        device.render(replace(room, lights=lamps), None, RenderSettings(8, 8, "direct"))


def test_lights_that_are_not_finite_are_refused(device: Device) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, emission=np.nan)
    with pytest.raises(InvalidInput, match="not finite"):
        device.render(room, lights, settings("vlm"))


@pytest.mark.parametrize("when", [0.0, 0.5])
def test_a_frame_can_be_cancelled(device: Device, when: float) -> None:
    with pytest.raises(Cancelled):
        device.render(box_room(), None, settings(samples=4), lambda fraction, label: fraction < when)


def test_progress_grows_and_ends_at_one(device: Device) -> None:
    room = box_room()
    seen: list[float] = []
    lights = mesh_lights(room.meshes, colour=0.5)
    device.render(room, lights, settings("vlm", samples=3), lambda fraction, label: seen.append(fraction) is None)
    assert seen == sorted(seen)
    assert seen[0] == 0.0
    assert seen[-1] == pytest.approx(1.0)


def test_a_value_that_is_no_number_stays_in_its_pixel(device: Device) -> None:
    scene = SceneSnapshot("s", (WALL,), (GREY,), camera=facing_camera())
    assert scene.camera is not None
    with device.current() as context:
        geometry = GpuGeometry(context, scene)
        view = make_view(scene.camera, 8, 8, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, 8, 8).render(geometry, view, 0)
        direct = np.ones((8, 8, 4), np.float32)
        direct[3, 5] = np.nan
        texture = context.texture((8, 8), 4, direct.tobytes(), dtype="f4")
        accumulate = AccumulatePass(context, device.shaders, 8, 8)
        for _ in range(2):
            accumulate.add(gbuffer, PictureLight(texture), view, (0.0, 0.0, 0.0), 0.5)
        combined = accumulate.read()["combined"]
    broken = np.isnan(combined).any(axis=2)
    assert np.argwhere(broken).tolist() == [[8 - 1 - 3, 5]]
    assert combined[~broken] == pytest.approx(1.0)


def test_the_mean_of_many_equal_pictures_is_the_picture(device: Device) -> None:
    scene = SceneSnapshot("s", (WALL,), (replace(GLOW, emission=(0.1, 1.0, 1e5)),), camera=facing_camera())
    combined = device.render(scene, None, settings(size=(4, 4), samples=300)).images["combined"]
    assert combined[..., :3] == pytest.approx(np.broadcast_to((0.1, 1.0, 1e5), (4, 4, 3)), rel=2e-5)


@pytest.mark.parametrize("technique", ["direct", "vlm"])
@pytest.mark.parametrize("distance", [1e4, 1e6])
def test_a_room_far_away_looks_the_same(device: Device, technique: str, distance: float) -> None:
    """Differences of float32 at that distance are a millimetre and six centimetres."""
    pictures = []
    for offset in ((0.0, 0.0, 0.0), (distance, -distance, 0.5 * distance)):
        room = box_room(offset)
        lights = mesh_lights(room.meshes, colour=0.5)
        chosen = settings(technique, (32, 24), shadow_resolution=256)
        pictures.append(device.render(room, lights, chosen).images["combined"][..., :3])
    assert pictures[1] == pytest.approx(pictures[0], rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_light_and_places_follow_the_scale_of_the_scene(device: Device, scale: float) -> None:
    """Lamps of the same power spread it over an area that grows with the square of the scale."""
    frames = []
    for factor in (1.0, scale):
        room = box_room()
        assert room.camera is not None
        matrix = room.camera.matrix_world.copy()
        matrix[:3, 3] *= factor
        clips = {name: factor * getattr(room.camera, name) for name in ("clip_start", "clip_end")}
        lamps = tuple(replace(lamp, position=tuple(factor * np.array(lamp.position))) for lamp in room.lights)
        meshes = tuple(replace(mesh, positions=factor * mesh.positions) for mesh in room.meshes)
        scaled = replace(room, meshes=meshes, lights=lamps, camera=replace(room.camera, matrix_world=matrix, **clips))
        frames.append(
            device.render(scaled, mesh_lights(meshes, emission=0.0, colour=0.5), settings("vlm", buffers=True))
        )
    expected, found = (frame.images for frame in frames)
    for name, power in {"direct": -2, "indirect": -2, "irradiance": -2, "position": 1, "depth": 1, "normal": 0}.items():
        assert scale**-power * found[name] == pytest.approx(expected[name], rel=1e-4, abs=1e-6), name


def test_light_beyond_what_half_floats_hold_arrives_in_full(device: Device) -> None:
    pictures = []
    for factor in (1.0, 1e9):
        room = box_room()
        lamps = tuple(replace(lamp, power=tuple(factor * np.array(lamp.power))) for lamp in room.lights)
        lights = mesh_lights(room.meshes, emission=0.0, colour=0.5)
        pictures.append(device.render(replace(room, lights=lamps), lights, settings("vlm", samples=2)).images)
    for name in ("direct", "indirect"):
        assert pictures[1][name].max() > 1e8
        assert pictures[1][name] / 1e9 == pytest.approx(pictures[0][name], rel=1e-4, abs=1e-7)
