# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflective shadow maps: position, normal and reflected flux of what each lamp sees (seed 003, 4.2.2)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.lamps import LampSample, lamp_samples
from ...core.scene import AREA, Float32, Float64, Light, SceneSnapshot
from ..albedo_texture import AlbedoTexture
from ..fullscreen import FullscreenPass
from ..geometry import GpuGeometry
from ..gpu_layout import CONSTANTS, LAMP
from ..kept import Kept
from ..kept_maps import KeptMaps, map_bytes
from ..lamp_records import lamp_record
from ..lamp_scenes import LampScene, LampScenes
from ..local_space import LocalSpace
from ..map_fluxes import MapFluxes, measured_fluxes
from ..rsm_views import FaceView, face_views, map_tiles
from ..shader_library import ShaderLibrary, set_uniforms
from .gbuffer import GBufferPass
from .shadow_map import SHARP_ANGLE, SINGLE_TILE_FACTOR, SOFT_DIVISOR, WORLD_DIVISOR

if TYPE_CHECKING:
    import moderngl

LEAST_FACE = 8
MIP_GROUP_SIDE = 8
CACHE_BYTES = 1 << 29
"""Of maps that are kept; those beyond are drawn for each picture."""
CHANNELS = 3
KIND = "reflective maps"
"""Of what is counted as kept over frames."""


@dataclass(frozen=True)
class MapTextures:
    """What a map is drawn into. framebuffer: position, normal, the finest level of flux, and geometric normal."""

    position: moderngl.Texture
    normal: moderngl.Texture
    flux: moderngl.Texture
    geometric_normal: moderngl.Texture
    framebuffer: moderngl.Framebuffer


@dataclass(frozen=True)
class ReflectiveShadowMap:
    """What one sample of a lamp sees, and reflects of its share of the lamp; textures of RGBA32F, unfiltered.

    All is in local units of `space`, which is not the frame's: `space` says how to take places into that or back.
    position: m from the local origin, and depth along the face's axis in m. normal: unit shading normal on the lamp's
    side, and the area in m² that the texel covers. geometric_normal: unit, of the triangle, on that side, and 0. flux:
    W, and the texel's part of the map: sr of a cube's map, else share of the map; 0 in faces that are not drawn. Its
    mip levels are sums, down to one texel a face. Where the lamp sees nothing, or the clockwise side of a triangle, all
    but that part is 0. record: (1,) of gpu_layout.LAMP, with the shadow_* fields of this map. side: texels along a
    face. brightest: (3,) W/m², the greatest radiosity in it.
    """

    textures: MapTextures
    record: np.ndarray
    side: int
    brightest: Float32
    space: LocalSpace = field(default_factory=lambda: LocalSpace(np.zeros(3), 1.0))

    @property
    def position(self) -> moderngl.Texture:
        """Place and depth of what is in each texel."""
        return self.textures.position

    @property
    def normal(self) -> moderngl.Texture:
        """Normal and area of what is in each texel."""
        return self.textures.normal

    @property
    def flux(self) -> moderngl.Texture:
        """What each texel reflects, and its part of the map."""
        return self.textures.flux

    @property
    def geometric_normal(self) -> moderngl.Texture:
        """Normal of the triangle that is in each texel."""
        return self.textures.geometric_normal

    @property
    def levels(self) -> int:
        """Mip levels of the flux, the finest one counted."""
        return self.side.bit_length()

    @property
    def is_cube(self) -> bool:
        """Whether the map has the faces of a cube, else a single tile."""
        return int(self.record["shadow_kind"][0]) == CONSTANTS["SHADOW_CUBE"]

    def flux_level(self, level: int) -> Float32:
        """(h, w, 4) float32 of a mip level, row 0 at the bottom; waits for the device."""
        width, height = (size >> level for size in self.flux.size)
        return np.frombuffer(self.flux.read(level=level), np.float32).reshape(height, width, 4)

    def total_flux(self) -> Float64:
        """(3,) float64 W: all that the surfaces in the map reflect; waits for the device."""
        return self.flux_level(self.levels - 1)[..., :CHANNELS].sum(axis=(0, 1), dtype=np.float64)

    def bind(self, first_unit: int) -> None:
        """Binds position, normal and flux to consecutive texture units."""
        for unit, texture in enumerate((self.position, self.normal, self.flux), first_unit):
            texture.use(unit)


def map_points(light: Light, count: int) -> tuple[LampSample, ...]:
    """The points of a lamp that have a map each: `count` over an AREA lamp, else the middle.

    A round lamp sends out from its middle what it sends out, but for what its own size hides.
    """
    hard = light if light.kind == AREA else replace(light, radius=0.0, angle=0.0)
    return lamp_samples(hard, count)


class ReflectiveShadowMapPass:
    """Draws reflective shadow maps of lamps of every kind. face: texels along a cube's face. drawn: maps so far."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, resolution: int) -> None:
        """resolution: texels along a cube's face, taken to the nearest power of two; a map of one tile has twice as
        many, area lamps half, wide parts of the world a quarter: many of those are added up."""
        self._context = context
        self._shaders = shaders
        most = int(context.info["GL_MAX_TEXTURE_SIZE"]) // 4
        self.face = 1 << round(math.log2(min(max(resolution, LEAST_FACE), most)))
        self._gbuffers: dict[int, GBufferPass] = {}
        self._albedo = AlbedoTexture(context)
        self._resolve = FullscreenPass(context, shaders, "passes/rsm.frag")
        self._coarser = shaders.compute("passes/rsm_mip.comp", {"GROUP_SIDE": MIP_GROUP_SIDE})
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)
        self._brightest = context.buffer(reserve=4 * CHANNELS)
        self.drawn = 0

    def side(self, geometry: GpuGeometry, light: Light) -> int:
        """Texels along a face of the maps of `light`."""
        face = self.face if map_tiles(light, geometry) != (1, 1) else self.face * SINGLE_TILE_FACTOR
        divisor = SOFT_DIVISOR if light.kind == AREA else 1
        if light.from_world and light.angle > SHARP_ANGLE:
            divisor = WORLD_DIVISOR
        return max(face // divisor, LEAST_FACE)

    def size(self, geometry: GpuGeometry, light: Light) -> tuple[int, int]:
        """Width and height of the maps of `light`, texels."""
        columns, rows = map_tiles(light, geometry)
        side = self.side(geometry, light)
        return columns * side, rows * side

    def new_textures(self, geometry: GpuGeometry, light: Light) -> MapTextures:
        """Textures of the size that maps of `light` need."""
        import moderngl

        size = self.size(geometry, light)
        position, normal, flux, geometric_normal = (self._context.texture(size, 4, dtype="f4") for _ in range(4))
        flux.build_mipmaps(0, self.side(geometry, light).bit_length() - 1)
        for texture in (position, normal, geometric_normal):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        flux.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
        targets = position, normal, flux, geometric_normal
        for texture in targets:
            texture.repeat_x = texture.repeat_y = False
        return MapTextures(*targets, self._context.framebuffer(targets))

    def render(
        self,
        geometry: GpuGeometry,
        light: Light,
        sample_index: int,
        sample_count: int,
        textures: MapTextures | None = None,
    ) -> ReflectiveShadowMap:
        """The map of one of `sample_count` points of `light`, over which its light is shared, drawn over `textures` if
        they are given. Lamps other than AREA have one point, in their middle."""
        sample = map_points(light, sample_count)[sample_index]
        record = lamp_record(light, sample, geometry.origin)
        target = textures or self.new_textures(geometry, light)
        side = self.side(geometry, light)
        target.framebuffer.clear()
        # New storage: llvmpipe (Mesa 22) lets a write overtake draws that still read the old one.
        self._brightest.orphan()
        self._brightest.write(bytes(4 * CHANNELS))
        views = face_views(light, record, geometry, side) if geometry.triangle_count else []
        self._lamp.orphan()
        self._lamp.write(record.tobytes())
        for face in views:
            self._draw(target, geometry, face, side, sample_index)
        self._sum_up(target, side)
        self.drawn += 1
        brightest = np.frombuffer(self._brightest.read(), np.float32).copy()
        return ReflectiveShadowMap(target, record, side, brightest)

    def _draw(self, target: MapTextures, geometry: GpuGeometry, face: FaceView, side: int, sample_index: int) -> None:
        if side not in self._gbuffers:
            self._gbuffers[side] = GBufferPass(self._context, self._shaders, side, side)
        gbuffer = self._gbuffers[side].render(geometry, face.view, sample_index)
        gbuffer.bind()
        self._albedo.bind()
        self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
        self._brightest.bind_to_storage_buffer(int(CONSTANTS["RESULT_BINDING"]))
        corner = face.tile[0] * side, face.tile[1] * side
        place = {"tile_corner": corner, "extent": face.extent, "centre": face.centre, "side": float(side)}
        set_uniforms(self._resolve.program, place)
        target.framebuffer.viewport = (*corner, side, side)
        self._resolve.draw(target.framebuffer)

    def _sum_up(self, target: MapTextures, side: int) -> None:
        """Fills the mip levels of the flux."""
        width, height = target.flux.size
        self._context.memory_barrier()
        for level in range(1, side.bit_length()):
            target.flux.bind_to_image(0, read=True, write=False, level=level - 1)
            target.flux.bind_to_image(1, read=False, write=True, level=level)
            columns, rows = width >> level, height >> level
            self._coarser.run(-(-columns // MIP_GROUP_SIDE), -(-rows // MIP_GROUP_SIDE))
            self._context.memory_barrier()


@dataclass(frozen=True)
class _Source:
    """One map of a lamp. key: of all that it depends on."""

    scene: LampScene
    sample_index: int
    key: str


class LampReflections:
    """The maps of a scene's lamps, for every picture of a frame and for later frames: a map is drawn again where its
    lamp, its resolution or a mesh that the lamp can light has changed. Maps beyond CACHE_BYTES are drawn for each
    picture."""

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        kept: Kept,
        snapshot: SceneSnapshot,
        resolution: int,
        area_maps: int,
    ) -> None:
        """snapshot: in world space. area_maps: points of an AREA lamp that have a map each."""
        self._context = context
        self._pass = ReflectiveShadowMapPass(context, shaders, resolution)
        self._area_maps = area_maps
        self._scenes = LampScenes(snapshot, kept.digests)
        self._sources: list[_Source] = []
        for light in snapshot.lights:
            if max(light.power) > 0.0:
                scene = self._scenes.of(light)
                count = len(map_points(light, area_maps))
                for sample in range(count):
                    key = kept.digests.of(scene.lamp_key, self._pass.face, sample, count)
                    self._sources.append(_Source(scene, sample, key))
        self._kept = kept
        self._maps: KeptMaps = kept.hold(KIND, KeptMaps)
        self._maps.keep_only({source.key for source in self._sources})
        self._shared: dict[tuple[int, int], MapTextures] = {}
        self._part: tuple[str, GpuGeometry, LocalSpace] | None = None
        self.key = kept.digests.of([source.key for source in self._sources])

    def __len__(self) -> int:
        return len(self._sources)

    @property
    def drawn(self) -> int:
        """Maps drawn so far in this frame."""
        return self._pass.drawn

    def fluxes(self) -> MapFluxes:
        """What the maps reflect; read from the device once for the same maps."""
        return self._kept.get("map_fluxes", self.key, lambda: measured_fluxes(self.maps()))

    def draw(self) -> None:
        """Draws the maps that are to be kept and are not yet."""
        for source in self._sources:
            if self._find(source) is None:
                break
        self._maps.drop_spare()

    def maps(self) -> Iterator[ReflectiveShadowMap]:
        """Every map of every lamp that shines; each is valid until the next."""
        for source in self._sources:
            found = self._find(source)
            if found is None:
                geometry, light, _ = self._scene_of(source.scene)
                size = self._pass.size(geometry, light)
                if size not in self._shared:
                    self._shared[size] = self._pass.new_textures(geometry, light)
                found = self._render(source, self._shared[size])
            yield found

    def _find(self, source: _Source) -> ReflectiveShadowMap | None:
        """The map from those that are kept, drawn now if it is not there and fits among them; else None."""
        found = self._maps.get(source.key)
        if found is not None:
            self._kept.count(KIND, is_new=False)
            return found
        geometry, light, _ = self._scene_of(source.scene)
        size = self._pass.size(geometry, light)
        if self._maps.nbytes + map_bytes(size) > CACHE_BYTES:
            return None
        found = self._render(source, self._maps.spare(size))
        self._maps.add(source.key, found)
        return found

    def _render(self, source: _Source, textures: MapTextures | None) -> ReflectiveShadowMap:
        geometry, light, space = self._scene_of(source.scene)
        found = self._pass.render(geometry, light, source.sample_index, self._area_maps, textures)
        self._kept.count(KIND, is_new=True)
        return replace(found, space=space)

    def _scene_of(self, scene: LampScene) -> tuple[GpuGeometry, Light, LocalSpace]:
        """What the lamp can light on the device, and the lamp, in units of the space. The latest is kept for lamps that
        can light the same."""
        if self._part is None or self._part[0] != scene.key:
            self._part = None
            local, space = self._scenes.local(scene)
            self._part = scene.key, GpuGeometry(self._context, local, np.zeros(3)), space
        _, geometry, space = self._part
        return geometry, space.light(scene.light), space
