// SPDX-License-Identifier: GPL-3.0-or-later
// One corner of a visible triangle; what is constant over the triangle comes from the storage buffer.
#include "gpu_layout/Triangle"

layout(std430, binding = TRIANGLE_BINDING) readonly buffer Triangles { Triangle triangles[]; };

uniform mat4 clip_from_local;

in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
#ifdef HAS_CORNER_COLORS
in vec3 in_color;
#endif
#ifdef HAS_TANGENTS
in vec4 in_tangent;
#endif

out vec3 position;          // m, from the local origin
out vec3 corner_normal;
out vec2 uv;
out vec3 corner_color;      // linear Rec.709
out vec4 corner_tangent;    // xyz, w the bitangent's sign
flat out vec3 triangle_normal;
flat out ivec3 triangle_ids; // material, tag id, face id
flat out vec2 triangle_plane; // plane offset, reach

void main() {
    Triangle triangle = triangles[gl_VertexID / 3];
    position = in_position;
    corner_normal = in_normal;
    uv = in_uv;
    corner_color = vec3(1.0);
    corner_tangent = vec4(0.0);
#ifdef HAS_CORNER_COLORS
    corner_color = in_color;
#endif
#ifdef HAS_TANGENTS
    corner_tangent = in_tangent;
#endif
    triangle_normal = triangle.geometric_normal;
    triangle_plane = vec2(triangle.plane_offset, triangle.reach);
    triangle_ids = ivec3(triangle.material, triangle.tag_id, triangle.face_id);
    gl_Position = clip_from_local * vec4(in_position, 1.0);
}
