// SPDX-License-Identifier: GPL-3.0-or-later
// One corner of a triangle that casts shadows.
#ifdef HAS_ALPHA
#include "gpu_layout/Triangle"
layout(std430, binding = TRIANGLE_BINDING) readonly buffer Triangles { Triangle triangles[]; };
in vec2 in_uv;
out vec2 uv;
flat out ivec2 triangle_ids; // material, face id
#endif

uniform mat4 clip_from_shadow;
uniform vec3 shadow_origin;     // m, from the local origin
uniform vec3 towards_sun;       // unit; of a parallel map
uniform bool is_parallel;

in vec3 in_position;

out float height;               // m, above the shadow's origin

void main() {
#ifdef HAS_ALPHA
    Triangle triangle = triangles[gl_VertexID / 3];
    uv = in_uv;
    triangle_ids = ivec2(triangle.material, triangle.face_id);
#endif
    vec3 offset = in_position - shadow_origin;
    height = dot(offset, towards_sun);
    gl_Position = clip_from_shadow * vec4(offset, 1.0);
    if (is_parallel) {
        gl_Position.z = 0.0; // nothing is too near or too far
    }
}
