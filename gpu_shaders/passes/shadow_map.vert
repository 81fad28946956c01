// SPDX-License-Identifier: GPL-3.0-or-later
// One corner of a triangle that casts shadows.
#ifdef HAS_ALPHA
#include "gpu_layout/Triangle"
layout(std430, binding = TRIANGLE_BINDING) readonly buffer Triangles { Triangle triangles[]; };
in vec2 in_uv;
out vec2 uv;
flat out ivec2 triangle_ids; // material, face id
#endif

uniform mat4 clip_from_local;

in vec3 in_position;

void main() {
#ifdef HAS_ALPHA
    Triangle triangle = triangles[gl_VertexID / 3];
    uv = in_uv;
    triangle_ids = ivec2(triangle.material, triangle.face_id);
#endif
    gl_Position = clip_from_local * vec4(in_position, 1.0);
}
