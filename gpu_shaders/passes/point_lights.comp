// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to every pixel what it receives from a run of point lights, or (NEGATIVE) takes it away (seed 001, 3.2, 3.3).
#include "passes/gbuffer_samplers.glsl"
#include "gpu_layout/VirtualPointLight"
#include "lib/vpl.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(std430, binding = LIGHT_BINDING) readonly buffer Lights { VirtualPointLight lights[]; };
// W/m², of both kinds of light together; w: what negative lights took away, or (SHOWS_BOUND) bounds took off, mean of
// the channels
layout(rgba32f, binding = 0) uniform image2D irradiance;

uniform uint first, end;
uniform bool is_last;   // run of these lights
uniform vec3 brightest; // W/m², what no surface's radiosity exceeds

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(irradiance))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 p = texelFetch(gbuffer_position, pixel, 0).xyz;
    vec3 n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
    vec3 sum = vec3(0.0);
#if SHOWS_BOUND
    float removed = 0.0;
#endif
    for (uint i = first; i < end; ++i) {
        VirtualPointLight light = lights[i];
        vec2 geometry = bounded_geometry(p, n, light.position, light.normal, light.area);
        sum += geometry.x * light.flux;
#if SHOWS_BOUND
        removed += geometry.y * dot(light.flux, vec3(1.0 / 3.0));
#endif
    }
    vec4 total = imageLoad(irradiance, pixel);
#if NEGATIVE
    total += vec4(-sum, dot(sum, vec3(1.0 / 3.0)));
#elif SHOWS_BOUND
    total += vec4(sum, removed);
#else
    total.rgb += sum;
    if (is_last) {
        total.rgb = min(total.rgb, brightest);
    }
#endif
    imageStore(irradiance, pixel, total);
}
