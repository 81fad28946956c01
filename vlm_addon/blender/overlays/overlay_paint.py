# SPDX-License-Identifier: GPL-3.0-or-later
"""Paints the shapes of overlays with Blender's graphics module, nearer to the eye than they are.

`gpu` is imported while drawing alone: there is none in background.
"""

from __future__ import annotations

from typing import Any

from mathutils import Matrix

from .overlay_shapes import Shape

LINE_PIXELS = 1.5

# eye: its place, w 1; for parallel views the direction towards it, w 0. Points move along the line of sight alone.
_VERTEX = """
void main() {
    shade = color;
    vec3 way = eye.xyz - eye.w * pos;
    float metres = share * length(way) + nearer;
    gl_Position = matrix * vec4(pos + min(metres / length(way), 0.5 + 1e9 * (1.0 - eye.w)) * way, 1.0);
}
"""
# Backs are striped and darker: lights shine on their front only. The 3D view takes linear values.
_FRAGMENT = """
void main() {
    vec3 linear = mix(shade.rgb / 12.92, pow((shade.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, shade.rgb));
    bool is_stripe = mod(gl_FragCoord.x + gl_FragCoord.y, 2.0 * stripe) < stripe;
    if (!gl_FrontFacing && stripe > 0.0) {
        result = is_stripe ? vec4(0.0, 0.0, 0.0, shade.a) : vec4(0.2 * linear, shade.a);
    } else {
        result = vec4(linear, shade.a);
    }
}
"""


def as_batch(shape: Shape) -> tuple[bool, Any, float]:
    """(is lines, buffer on the graphics card, most metres that it has to come nearer)."""
    import gpu

    form = gpu.types.GPUVertFormat()
    form.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    form.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
    if not shape.is_lines:
        form.attr_add(id="nearer", comp_type="F32", len=1, fetch_mode="FLOAT")
    buffer = gpu.types.GPUVertBuf(format=form, len=len(shape.positions))
    buffer.attr_fill("pos", shape.positions)
    buffer.attr_fill("color", shape.colors)
    if not shape.is_lines:
        buffer.attr_fill("nearer", shape.nearer)
    batch = gpu.types.GPUBatch(type="LINES" if shape.is_lines else "TRIS", buf=buffer)
    return shape.is_lines, batch, float(shape.nearer.max(initial=0.0))


class Painter:
    """Paints batches; keeps the shader of faces."""

    def __init__(self) -> None:
        self._shader: Any = None

    def faces(self, region_data: Any, batch: Any, share: float, stripe: float) -> None:
        """share: of their distance by which they come nearer. stripe: pixels, width of stripes on backs, 0 for none."""
        import gpu

        shader = self._face_shader()
        shader.uniform_float("matrix", gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
        shader.uniform_float("eye", _eye(region_data))
        shader.uniform_float("share", share)
        shader.uniform_float("stripe", stripe)
        batch.draw(shader)

    def lines(self, context: Any, batch: Any, share: float, metres: float) -> None:
        """share, metres: of their distance, and beside that, by which they come nearer."""
        import gpu

        with gpu.matrix.push_pop():
            gpu.matrix.load_matrix(_nearer(context.region_data, share, metres) @ gpu.matrix.get_model_view_matrix())
            shader = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR")
            shader.uniform_float("viewportSize", (context.region.width, context.region.height))
            shader.uniform_float("lineWidth", LINE_PIXELS * context.preferences.system.pixel_size)
            batch.draw(shader)

    def _face_shader(self) -> Any:
        import gpu

        if self._shader is None:
            between = gpu.types.GPUStageInterfaceInfo("vlm_overlay_shade")
            between.smooth("VEC4", "shade")
            info = gpu.types.GPUShaderCreateInfo()
            info.push_constant("MAT4", "matrix")
            info.push_constant("VEC4", "eye")
            info.push_constant("FLOAT", "share")
            info.push_constant("FLOAT", "stripe")
            info.vertex_in(0, "VEC3", "pos")
            info.vertex_in(1, "VEC4", "color")
            info.vertex_in(2, "FLOAT", "nearer")
            info.vertex_out(between)
            info.fragment_out(0, "VEC4", "result")
            info.vertex_source(_VERTEX)
            info.fragment_source(_FRAGMENT)
            self._shader = gpu.shader.create_from_info(info)
        return self._shader


def _is_parallel(region_data: Any) -> bool:
    return bool(region_data.window_matrix[3][3] != 0.0)


def _eye(region_data: Any) -> tuple[float, ...]:
    """Where the eye is, with a 1; in parallel views the direction towards it as long as its distance, with a 0."""
    back = region_data.view_matrix.inverted()
    if _is_parallel(region_data):
        return (*(region_data.view_distance * back.col[2].to_3d()), 0.0)
    return (*back.translation, 1.0)


def _nearer(region_data: Any, share: float, metres: float) -> Matrix:
    """What takes view space nearer to the eye, by a share of the distance and metres: pixels stay where they are."""
    if _is_parallel(region_data):
        return Matrix.Translation((0.0, 0.0, share * region_data.view_distance + metres))
    scale = 1.0 - min(share + metres / max(region_data.view_distance, metres, 1e-6), 0.5)
    return Matrix.Diagonal((scale, scale, scale, 1.0))
