# SPDX-License-Identifier: GPL-3.0-or-later
"""Further bounces of virtual point lights, by the quasi-random walk in the octree (Keller 1997; seed 004, 3.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.light_walk import WALK_BASES, bounce_shift
from ..gpu_layout import VIRTUAL_POINT_LIGHT
from ..local_space import LocalSpace
from ..scene_octree import SceneOctree
from ..shader_library import ShaderLibrary, set_uniforms
from .point_lights import LIGHT_BINDING, PointLights

if TYPE_CHECKING:
    import moderngl

GROUP_SIZE = 64
NEXT_BINDING = LIGHT_BINDING + 1
OCTREE_BINDING, OCTREE_TRIANGLE_BINDING = LIGHT_BINDING + 2, LIGHT_BINDING + 3


class BounceLightPass:
    """Sends the light of point lights on to what they see; there it becomes point lights of the next bounce.

    What leaves the scene or meets a triangle's clockwise side becomes lights of no flux. Surfaces that are hit reflect
    as their triangles do on average, and have no smooth normals.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        defines = {"GROUP_SIZE": GROUP_SIZE, "LIGHT_BINDING": LIGHT_BINDING, "NEXT_BINDING": NEXT_BINDING}
        defines |= {"OCTREE_BINDING": OCTREE_BINDING, "OCTREE_TRIANGLE_BINDING": OCTREE_TRIANGLE_BINDING}
        self._shader = shaders.compute("passes/bounce_lights.comp", defines)

    def render(
        self,
        lights: PointLights,
        octree: SceneOctree,
        space: LocalSpace,
        count: int,
        number: int,
        first: int,
        shift: tuple[float, float],
        surface_area: float,
    ) -> PointLights:
        """`count` lights in units of `space`: the next bounce of the first `count` of `lights`, which stand for all.

        lights: of the bounce before, in `space`, at least `count`. number: of the bounce that is made, 2 or 3. first,
        shift: as for the first bounce, `first` below 13^8 - count; each bounce has bases and a shift of its own.
        surface_area: m² of all surfaces, over which the lights are taken to be spread.
        """
        size = VIRTUAL_POINT_LIGHT.dtype.itemsize
        found = PointLights(self._context.buffer(reserve=max(count, 1) * size), count)
        if not count:
            return found
        lights.buffer.bind_to_storage_buffer(LIGHT_BINDING)
        found.buffer.bind_to_storage_buffer(NEXT_BINDING)
        octree.bind(OCTREE_BINDING, OCTREE_TRIANGLE_BINDING)
        uniforms = {"count": count, "first_index": first, "bases": WALK_BASES[number - 1]}
        uniforms |= {"gain": lights.count / count, "area": surface_area / count / space.unit**2}
        uniforms |= {"octree_frame": octree.uniform(space), "shift": bounce_shift(shift, number)}
        set_uniforms(self._shader, uniforms)
        self._shader.run(-(-count // GROUP_SIZE))
        self._context.memory_barrier()
        return found
