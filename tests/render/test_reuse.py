# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device keeps over frames: pictures are those of a fresh device to the bit, and an edit makes anew what depends
on it and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.rooms import camera_at, lights_from_triangles, quad, split
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import AREA, DIFFUSE, POINT, SPOT, SUN, Light, Material, Mesh, SceneSnapshot, Texture
from vlm_addon.render import kept_shadow_maps
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.kept import Kept

KEY = Light("key", SPOT, (60.0, 60.0, 50.0), (-2.0, 0.5, 2.5), radius=0.1, spot_angle=0.9, spot_blend=0.2)
BULB = Light("bulb", POINT, (8.0, 9.0, 10.0), (1.0, -1.0, 1.5))
PANEL = Light("panel", AREA, (20.0, 15.0, 10.0), (2.0, 0.0, 2.6), size_x=0.5, size_y=0.4)
SUN_LAMP = Light("sun", SUN, (1.0, 0.9, 0.8), (0.0, 0.0, 0.0), (0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
LAMPS = (KEY, BULB, PANEL, SUN_LAMP)
MATERIALS = (
    Material("floor", DIFFUSE, (0.6, 0.5, 0.4)),
    Material("block", DIFFUSE, (0.7, 0.2, 0.2)),
    Material("leaf", DIFFUSE, (0.2, 0.7, 0.2), alpha_texture=0, alpha_channel=3),
)


def leaf_pixels(share: float = 0.5) -> np.ndarray:
    pixels = np.full((4, 4, 4), 1.0, np.float32)
    pixels[1:3, 1:3, 3] = share
    return pixels


def block(place: tuple[float, float], name: str = "block") -> tuple[Mesh, ...]:
    """A cube of 0.4 m."""
    x, y = place
    faces = inward_box((x - 0.2, y - 0.2, 0.05), (x + 0.2, y + 0.2, 0.45), [1] * 6, outward=True)
    return tuple(replace(face, name=f"{name} {index}", dynamic=True) for index, face in enumerate(faces))


def scene(block_at: tuple[float, float] = (1.5, 0.0), lights: tuple[Light, ...] = LAMPS) -> SceneSnapshot:
    """A floor and a wall, a leaf that lets some light through, and a block, under four lamps."""
    floor = quad((-3.0, -3.0, 0.0), (6.0, 0.0, 0.0), (0.0, 6.0, 0.0), name="floor")
    wall = quad((-3.0, 3.0, 0.0), (6.0, 0.0, 0.0), (0.0, 0.0, 3.0), name="wall")
    leaf = quad((0.2, -0.8, 1.0), (0.8, 0.0, 0.0), (0.0, 0.8, 0.0), material=2, name="leaf")
    camera = camera_at((0.5, -5.0, 2.5), (0.0, 0.5, 0.5))
    meshes = (floor, wall, leaf, *block(block_at))
    return SceneSnapshot(
        "s", meshes, MATERIALS, (Texture("leaf", leaf_pixels()),), lights, camera, world_radiance=(0.02, 0.03, 0.05)
    )


@cache
def light_mesh() -> VirtualLightMesh:
    """More lights than are summed one by one, over the floor."""
    a, b, c, d = np.array([[-3, -3, 0.001], [3, -3, 0.001], [3, 3, 0.001], [-3, 3, 0.001]], float)
    return lights_from_triangles(split(np.array([[a, b, c], [a, c, d]]), 4), emission=0.0, colour=(0.6, 0.5, 0.4))


def rendered(device: Device, snapshot: SceneSnapshot, lights: VirtualLightMesh | None = None, **values: int) -> Frame:
    chosen = {"samples": 2, "shadow_resolution": 32, "shadow_samples": 4, "world_lights": 2, **values}
    return device.render(snapshot, lights or light_mesh(), RenderSettings(16, 12, "vlm", **chosen))


def anew(device: Device, snapshot: SceneSnapshot, lights: VirtualLightMesh | None = None, **values: int) -> Frame:
    """As a device makes it that has kept nothing."""
    kept, device.kept = device.kept, Kept()
    try:
        return rendered(device, snapshot, lights, **values)
    finally:
        device.kept = kept


def built(device: Device) -> set[str]:
    """Kinds of what the latest frame made anew."""
    return {kind for kind, reuse in device.kept.events().items() if reuse.built}


def same(first: Frame, second: Frame) -> bool:
    assert set(first.images) == set(second.images)
    return all((image == second.images[name]).all() for name, image in first.images.items())


@pytest.fixture
def used(device: Device) -> Device:
    """A device that has rendered the scene, and nothing before."""
    device.kept = Kept()
    rendered(device, scene())
    return device


def test_a_frame_in_which_nothing_changed_builds_nothing(used: Device) -> None:
    first = rendered(used, scene())
    assert built(used) == set()
    assert used.kept.events()["shadow maps"].reused > 0
    assert same(first, anew(used, scene()))
    assert first.images["indirect"].max() > 0.0
    assert first.images["direct"].max() > 0.0


NEAR_CAMERA = camera_at((0.0, -0.8, 0.6), (0.0, 0.5, 0.3))
MOVED_CAMERA = camera_at((-1.0, -4.0, 1.5), (0.0, 0.5, 0.5))


def test_a_camera_that_moves_draws_no_shadow_map_and_no_light(used: Device) -> None:
    moved = replace(scene(), camera=MOVED_CAMERA)
    found = rendered(used, moved)
    kinds = built(used)
    assert not kinds & {"phase one", "radiosity", "shadow casters", "materials", "texture", "lit trees"}
    assert not kinds & {"geometry normal", "geometry uv"}
    assert same(found, anew(used, moved))


def test_windows_under_a_sun_are_drawn_where_the_camera_gets_to(used: Device) -> None:
    """A step of 2 cm in a scene of 9 m leaves them as they are; from elsewhere there are others."""
    under_the_sun = replace(scene(lights=(SUN_LAMP,)), world_radiance=(0.0, 0.0, 0.0), camera=NEAR_CAMERA)
    rendered(used, under_the_sun)
    step = replace(under_the_sun, camera=camera_at((0.02, -0.8, 0.61), (0.0, 0.5, 0.3)))
    found = rendered(used, step)
    assert "geometry position" in built(used)
    assert "shadow maps" not in built(used)
    assert same(found, anew(used, step))
    far = replace(under_the_sun, camera=camera_at((2.0, 1.5, 0.6), (2.5, 2.5, 0.3)))
    found = rendered(used, far)
    assert "shadow maps" in built(used)
    assert same(found, anew(used, far))


def test_lamps_without_windows_are_never_drawn_for_a_camera(used: Device) -> None:
    without = replace(scene(lights=LAMPS[:3]), world_radiance=(0.0, 0.0, 0.0))
    rendered(used, without)
    for camera in (MOVED_CAMERA, NEAR_CAMERA):
        moved = replace(without, camera=camera)
        found = rendered(used, moved)
        assert "shadow maps" not in built(used)
        assert same(found, anew(used, moved))


@pytest.mark.parametrize(
    ("change", "phase_one", "shadow_maps"),
    [
        ({"position": (-2.0, 0.6, 2.5)}, 1, 8),
        ({"spot_angle": 0.8}, 1, 8),
        ({"radius": 0.2}, 1, 8),
        ({"spot_blend": 0.5}, 1, 4),
        ({"power": (5.0, 0.0, 70.0)}, 0, 0),
        ({"power": (0.0, 0.0, 0.0)}, 0, 0),
        ({"name": "other"}, 0, 0),
        ({"casts_shadow": False}, 1, 0),
    ],
    ids=["place", "cone", "radius", "blend", "power", "off", "name", "shadow"],
)
def test_a_lamp_that_changes_costs_what_it_alone_costs(
    used: Device, change: dict[str, object], phase_one: int, shadow_maps: int
) -> None:
    """It has four points in phase one, whose maps are not kept, and four in direct light."""
    changed = scene(lights=(replace(KEY, **change), *LAMPS[1:]))
    found = rendered(used, changed)
    events = used.kept.events()
    assert events["phase one"].built == phase_one
    assert events["shadow maps"].built == shadow_maps
    assert not built(used) & UNLIT
    assert same(found, anew(used, changed))


UNLIT = {"geometry", "materials", "texture", "shadow casters", "virtual lights", "static_tree", "probes"}
"""What does not hang on lamps."""


@pytest.mark.parametrize(("place", "spot_draws"), [((1.5, 0.3), False), ((-1.8, 0.5), True)], ids=["outside", "inside"])
def test_an_object_that_moves_draws_the_map_of_a_spot_that_it_is_in(
    used: Device, place: tuple[float, float], spot_draws: bool
) -> None:
    """The spot lights the left side only; all the scene is there for the others."""
    lights, without = LAMPS, LAMPS[1:]
    rendered(used, scene(lights=without))
    rendered(used, scene(place, without))
    others = used.kept.events()["shadow maps"].built
    rendered(used, scene())
    moved = scene(place, lights)
    found = rendered(used, moved)
    assert used.kept.events()["shadow maps"].built == others + (8 if spot_draws else 0)
    assert used.kept.events()["phase one"].reused == (0 if spot_draws else 1)
    assert not built(used) & {"materials", "texture", "geometry uv", "geometry normal", "static_tree"}
    assert same(found, anew(used, moved))


def test_a_material_redraws_shadows_only_where_it_lets_light_through(used: Device) -> None:
    red = replace(MATERIALS[0], base_color=(0.9, 0.1, 0.1))
    painted = replace(scene(), materials=(red, *MATERIALS[1:]))
    found = rendered(used, painted)
    assert {"geometry", "materials"} <= built(used)
    assert not built(used) & {"geometry position", "shadow maps", "phase one", "lit trees", "texture"}
    assert same(found, anew(used, painted))
    clearer = replace(painted, textures=(Texture("leaf", leaf_pixels(0.1)),))
    found = rendered(used, clearer)
    assert {"texture", "phase one", "shadow maps"} <= built(used)
    assert not built(used) & {"materials", "geometry position"}
    assert same(found, anew(used, clearer))


EDITS: dict[str, Callable[[SceneSnapshot], SceneSnapshot]] = {
    "nothing": lambda s: s,
    "camera": lambda s: replace(s, camera=MOVED_CAMERA),
    "lamp moves": lambda s: replace(s, lights=(replace(KEY, position=(-1.0, 0.0, 2.0)), *s.lights[1:])),
    "bulb moves": lambda s: replace(s, lights=(s.lights[0], replace(BULB, position=(0.5, -1.0, 1.8)), *s.lights[2:])),
    "lamp goes": lambda s: replace(s, lights=s.lights[:1] + s.lights[2:]),
    "lamps trade places": lambda s: replace(s, lights=s.lights[::-1]),
    "block moves": lambda s: replace(s, meshes=(*s.meshes[:3], *block((-1.0, 0.0)))),
    "another block far away": lambda s: replace(s, meshes=(*s.meshes, *block((40.0, 5.0), "far"))),
    "leaf clears": lambda s: replace(s, textures=(Texture("leaf", leaf_pixels(0.0)),)),
    "leaf goes solid": lambda s: replace(s, materials=(*s.materials[:2], replace(s.materials[2], alpha_texture=-1))),
    "floor painted": lambda s: replace(s, materials=(Material("n", DIFFUSE, (0.1, 0.9, 0.1)), *s.materials[1:])),
    "sky darkens": lambda s: replace(s, world_radiance=(0.0, 0.0, 0.0)),
    "everything back": lambda _: scene(),
}


def test_every_frame_of_a_row_of_edits_is_that_of_a_fresh_device(used: Device) -> None:
    snapshot = scene()
    for name, edit in EDITS.items():
        snapshot = edit(snapshot)
        assert same(rendered(used, snapshot), anew(used, snapshot)), name
    with Device() as fresh:
        assert same(rendered(used, snapshot), rendered(fresh, snapshot))


def test_arrays_that_are_written_into_are_seen(used: Device) -> None:
    """The same objects with other content, as a caller may hand them over again."""
    snapshot, lights = scene(), light_mesh()
    own = replace(lights, colour=lights.colour.copy())
    positions = snapshot.meshes[3].positions
    rendered(used, snapshot, own)
    positions += 0.25
    own.colour[:100] = 0.9
    assert same(rendered(used, snapshot, own), anew(used, snapshot, own))


def test_more_samples_and_finer_maps_are_those_of_a_fresh_device(used: Device) -> None:
    for values in (
        {"samples": 3},
        {"shadow_resolution": 64},
        {"shadow_samples": 9},
        {"samples": 3, "shadow_samples": 1},
    ):
        assert same(rendered(used, scene(), **values), anew(used, scene(), **values))


def test_maps_beyond_the_room_for_them_are_drawn_again(used: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_shadow_maps, "CACHE_BYTES", 20_000)
    moved = replace(scene(), lights=(replace(KEY, position=(-1.5, 0.0, 2.0)), *LAMPS[1:]))
    used.kept = Kept()
    first, second = rendered(used, moved), rendered(used, moved)
    assert 0 < used.kept.events()["shadow maps"].reused < used.kept.events()["shadow maps"].built
    monkeypatch.undo()
    assert same(first, second)
    assert same(first, anew(used, moved))


def test_a_frame_that_is_stopped_leaves_nothing_wrong_behind(used: Device) -> None:
    moved = EDITS["block moves"](EDITS["lamp moves"](scene()))

    labels: list[str] = []

    def stop(fraction: float, label: str) -> bool:
        labels.append(label)
        return labels.count("phase one") < 3

    settings = RenderSettings(16, 12, "vlm", samples=2, shadow_resolution=32, shadow_samples=4, world_lights=2)
    with pytest.raises(Cancelled):
        used.render(moved, light_mesh(), settings, stop)
    assert labels.count("phase one") == 3
    assert same(rendered(used, moved), anew(used, moved))
    assert same(rendered(used, scene()), anew(used, scene()))
