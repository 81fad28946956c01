// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest and farthest distance of a visible surface from the eye, as bits of floats that are at least 0: their order
// is that of the numbers.
#include "lib/gbuffer.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = GBUFFER_POSITION_UNIT) uniform sampler2D gbuffer_position;
layout(binding = GBUFFER_GEOMETRIC_NORMAL_UNIT) uniform sampler2D gbuffer_geometric_normal;
layout(std430, binding = RESULT_BINDING) buffer Range { uint nearest; uint farthest; };

uniform vec3 camera_position;   // m, from the local origin

shared uint group_nearest, group_farthest;

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        group_nearest = nearest;
        group_farthest = farthest;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, textureSize(gbuffer_position, 0)))
        && shows_geometry(texelFetch(gbuffer_geometric_normal, pixel, 0).xyz)) {
        uint bits = floatBitsToUint(distance(texelFetch(gbuffer_position, pixel, 0).xyz, camera_position));
        atomicMin(group_nearest, bits);
        atomicMax(group_farthest, bits);
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        atomicMin(nearest, group_nearest);
        atomicMax(farthest, group_farthest);
    }
}
