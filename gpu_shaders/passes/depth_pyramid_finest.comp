// SPDX-License-Identifier: GPL-3.0-or-later
// The finest level of a pyramid of depths: the nearest that each pixel's surface comes within the pixel.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(r32f, binding = 0) writeonly uniform image2D finest; // m; DEPTH_EMPTY where nothing shows

// More than what float32 leaves of a depth.
#define DEPTH_ROUNDING 1e-5

uniform vec3 camera_position;           // m, from the local origin
uniform vec3 camera_backward;           // unit
uniform bool is_orthographic;
uniform vec3 pixel_right, pixel_up;     // m, to the next pixel; for a perspective camera per m of depth

// The depth at which rays through the pixel meet the surface's plane is linear over the picture, or its inverse is.
float nearest_depth(ivec2 pixel) {
    vec4 position = texelFetch(gbuffer_position, pixel, 0);
    vec3 normal = texelFetch(gbuffer_geometric_normal, pixel, 0).xyz;
    float change = 0.5 * (abs(dot(normal, pixel_right)) + abs(dot(normal, pixel_up)));
    if (is_orthographic) {
        return position.w - change / max(abs(dot(normal, camera_backward)), 1e-20) - DEPTH_ROUNDING * abs(position.w);
    }
    float height = abs(dot(normal, position.xyz - camera_position));
    return (1.0 - DEPTH_ROUNDING) / (1.0 / position.w + change / max(height, 1e-20));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(finest)))) {
        return;
    }
    bool inside = all(lessThan(pixel, textureSize(gbuffer_position, 0)));
    float depth = inside && pixel_shows_geometry(pixel) ? nearest_depth(pixel) : DEPTH_EMPTY;
    imageStore(finest, pixel, vec4(depth));
}
