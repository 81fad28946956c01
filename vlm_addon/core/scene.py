# SPDX-License-Identifier: GPL-3.0-or-later
"""What the renderer and the authoring functions know of a scene: frozen dataclasses of contiguous arrays.

World space, metres, linear Rec.709, watts, radians. One Blender unit is one metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

NO_TEXTURE = -1
UNTAGGED = 0

POINT, SPOT, SUN, AREA = "POINT", "SPOT", "SUN", "AREA"
RECTANGLE, ELLIPSE = "RECTANGLE", "ELLIPSE"
DIFFUSE, PRINCIPLED = "DIFFUSE", "PRINCIPLED"
PERSPECTIVE, ORTHOGRAPHIC = "PERSPECTIVE", "ORTHOGRAPHIC"


@dataclass(frozen=True)
class Texture:
    """An image in linear Rec.709 (colour) or raw values (data).

    pixels: (h, w, 4) float32, row 0 at the bottom (v = 0).
    """

    name: str
    pixels: Float32
    repeat: bool = True
    linear_filter: bool = True


@dataclass(frozen=True)
class Material:
    """A surface as the Principled or the Diffuse shader describes it.

    Where a texture index is set (not NO_TEXTURE) the texel multiplies the constant beside it; scalar channels read
    the component named by `*_channel` (0 red … 3 alpha). `emission` is radiance in W/(m² sr).
    """

    name: str
    model: str = PRINCIPLED
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    base_color_texture: int = NO_TEXTURE
    base_color_from_corners: bool = False
    alpha: float = 1.0
    alpha_texture: int = NO_TEXTURE
    alpha_channel: int = 3
    roughness: float = 0.5
    roughness_texture: int = NO_TEXTURE
    roughness_channel: int = 0
    metallic: float = 0.0
    metallic_texture: int = NO_TEXTURE
    metallic_channel: int = 0
    specular_ior_level: float = 0.5
    ior: float = 1.5
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: int = NO_TEXTURE
    normal_texture: int = NO_TEXTURE
    normal_strength: float = 1.0

    @property
    def has_specular_layer(self) -> bool:
        """Whether anything of it reflects other than diffusely."""
        is_dielectric = self.specular_ior_level > 0.0 and self.ior != 1.0
        return self.model == PRINCIPLED and (self.metallic > 0.0 or is_dielectric)


@dataclass(frozen=True)
class Mesh:
    """Triangles of one visible object (or one instance of it) in world space.

    positions: (v, 3) float64. triangles: (t, 3) int32, counter-clockwise seen from the front (also after a mirrored
    world matrix). corner_normals: (t, 3, 3) float32 unit. corner_uvs: (t, 3, 2) float32. corner_colors: (t, 3, 3)
    float32 linear, or (0, 3, 3) where no material reads them. material_indices: (t,) int32 into
    SceneSnapshot.materials. tag_ids: (t,) int32, UNTAGGED where none. reflectance: (t, 3) float32, diffuse
    reflectance averaged over the triangle. emission: (t, 3) float32, radiant exitance in W/m², averaged likewise.
    detail: (t,) float32, about how many times as many virtual lights as elsewhere a surface of this shape gets, 0 for
    none; (0,) where nothing is asked for. owner: name of the object of the scene that shows it, itself or as an
    instance; "": the part of `name` before the first "/".
    """

    name: str
    positions: Float64
    triangles: Int32
    corner_normals: Float32
    corner_uvs: Float32
    corner_colors: Float32
    material_indices: Int32
    tag_ids: Int32
    reflectance: Float32
    emission: Float32
    dynamic: bool = False
    detail: Float32 = field(default_factory=lambda: np.zeros(0, np.float32), repr=False)
    owner: str = ""

    def subset(self, chosen: npt.NDArray[np.bool_]) -> Mesh:
        """The mesh with the triangles of `chosen`, (t,) bool, and all vertices."""
        names = ("triangles", "corner_normals", "corner_uvs", "material_indices", "tag_ids", "reflectance", "emission")
        rows = {name: getattr(self, name)[chosen] for name in names}
        colors = self.corner_colors[chosen] if len(self.corner_colors) else self.corner_colors
        detail = self.detail[chosen] if len(self.detail) else self.detail
        return replace(self, corner_colors=colors, detail=detail, **rows)

    def bounds(self) -> tuple[Float64, Float64]:
        """Lower and upper corner, (3,) float64 each, of its vertices, of which there is at least one."""
        # Along columns: a reduction over rows of three takes ten times as long.
        columns = self.positions.T
        return np.array([column.min() for column in columns]), np.array([column.max() for column in columns])


@dataclass(frozen=True)
class Light:
    """A lamp in Blender's units.

    power: linear Rec.709, W for POINT, SPOT and AREA; irradiance on a facing surface in W/m² for SUN. The light
    shines along -z of its frame: x_axis, y_axis, z_axis are unit vectors in world space. radius: m (POINT, SPOT);
    soft_falloff: its lamp is a disk turned to each receiver (Blender's default) rather than a ball.
    angle: full angular diameter of a SUN. spot_angle: full cone angle; spot_blend: 0 hard to 1 soft. size_x, size_y:
    m, full extents of an AREA light of `shape` RECTANGLE or ELLIPSE. spot_scale: the object's scale relative to its
    z axis, which squashes the cone in x and y. from_world: a SUN that stands for what a part of the world sends, a
    cone of `angle`; all of it comes along the axis, with a hard shadow.
    """

    name: str
    kind: str
    power: tuple[float, float, float]
    position: tuple[float, float, float]
    x_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    y_axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    z_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    radius: float = 0.0
    angle: float = 0.0
    spot_angle: float = math.pi / 4
    spot_blend: float = 0.15
    spot_scale: tuple[float, float] = (1.0, 1.0)
    shape: str = RECTANGLE
    size_x: float = 1.0
    size_y: float = 1.0
    casts_shadow: bool = True
    soft_falloff: bool = True
    from_world: bool = False


@dataclass(frozen=True)
class Camera:
    """A camera looking along -z of `matrix_world` ((4, 4) float64, rigid: no scale), with y up.

    Lens and sensor in millimetres and ortho_scale in metres as Blender defines them; shift in units of the larger
    sensor side; clip distances in metres; pixel_aspect = height of a pixel's frame over its width as Blender's
    (pixel_aspect_x, pixel_aspect_y).
    """

    name: str
    matrix_world: Float64
    kind: str = PERSPECTIVE
    lens: float = 50.0
    sensor_width: float = 36.0
    sensor_height: float = 24.0
    sensor_fit: str = "AUTO"
    ortho_scale: float = 6.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    clip_start: float = 0.1
    clip_end: float = 1000.0
    pixel_aspect: tuple[float, float] = (1.0, 1.0)

    def frame(self, width: int, height: int) -> tuple[float, float, float, float]:
        """Left, right, bottom, top of the picture of width x height pixels.

        At distance 1 in front of a perspective camera (dimensionless), in metres for an orthographic one. Follows
        Blender's sensor fit: AUTO fits the larger side of the picture.
        """
        aspect_x, aspect_y = self.pixel_aspect
        extent_x, extent_y = width * aspect_x, height * aspect_y
        horizontal = self.sensor_fit == "HORIZONTAL" or (self.sensor_fit == "AUTO" and extent_x >= extent_y)
        sensor = self.sensor_height if self.sensor_fit == "VERTICAL" else self.sensor_width
        view_extent = self.ortho_scale if self.kind == ORTHOGRAPHIC else sensor / self.lens
        per_pixel = view_extent / (extent_x if horizontal else extent_y)
        half_x, half_y = 0.5 * per_pixel * extent_x, 0.5 * per_pixel * extent_y
        offset_x, offset_y = self.shift_x * view_extent, self.shift_y * view_extent
        return offset_x - half_x, offset_x + half_x, offset_y - half_y, offset_y + half_y


@dataclass(frozen=True)
class Finding:
    """One thing a user should know: which object (and node), what was found, what was done or can be done.

    kind: a word for programs, "" where nothing is to be done about it. lights: rows of the lights it is about.
    """

    subject: str
    problem: str
    remedy: str
    kind: str = ""
    lights: tuple[int, ...] = field(default=(), compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.subject}: {self.problem}; {self.remedy}"


@dataclass(frozen=True)
class Environment:
    """What the world sends from each direction, as an equirectangular map.

    radiance: (h, w, 3) float32, linear Rec.709, W/(m² sr), finite, at least 0; row 0 at the bottom looks along -z of
    the map, its middle column along +x, columns to the left of it towards +y (Blender's mapping). map_from_world:
    (3, 3) float64, directions in the map = map_from_world @ directions in world space.
    """

    name: str
    radiance: Float32
    map_from_world: Float64


@dataclass(frozen=True)
class SceneSnapshot:
    """All that one frame shows. world_radiance: of the world, the same from everywhere, linear Rec.709, W/(m² sr);
    environment: what comes on top of it by direction. findings: what extraction had to approximate or leave out."""

    name: str
    meshes: tuple[Mesh, ...] = ()
    materials: tuple[Material, ...] = ()
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] = ()
    camera: Camera | None = None
    world_radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frame: int = 1
    findings: tuple[Finding, ...] = field(default=())
    environment: Environment | None = None

    @property
    def triangle_count(self) -> int:
        """Number of visible triangles."""
        return sum(len(mesh.triangles) for mesh in self.meshes)

    def bounds(self) -> tuple[Float64, Float64]:
        """Lower and upper corner, (3,) float64 each, of all visible triangles; the origin for an empty scene."""
        filled = [mesh.bounds() for mesh in self.meshes if len(mesh.positions)]
        if not filled:
            return np.zeros(3), np.zeros(3)
        low, high = np.array(filled).swapaxes(0, 1)
        return low.min(axis=0), high.max(axis=0)
