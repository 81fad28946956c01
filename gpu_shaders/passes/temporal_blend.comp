// SPDX-License-Identifier: GPL-3.0-or-later
// The mean of what this picture found and what earlier ones did, kept for the next.
#include "passes/gbuffer_samplers.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(binding = FOUND_UNIT) uniform sampler2D found_now;
layout(binding = REPROJECTED_UNIT) uniform sampler2D reprojected;
layout(binding = AGE_UNIT) uniform sampler2D age;
layout(rgba32f, binding = 0) writeonly uniform image2D history_irradiance;
layout(rgba32f, binding = 1) writeonly uniform image2D history_place;
layout(rgba16f, binding = 2) writeonly uniform image2D history_normal;
layout(rgba32f, binding = 3) writeonly uniform image2D result;

uniform float first_age;    // pictures that what was found without a history counts for
uniform float most_age;
uniform vec3 brightest;     // W/m², what no irradiance exceeds; the rest goes to w

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(result)))) {
        return;
    }
    vec4 mean = vec4(0.0);
    float pictures = 0.0;
    if (pixel_shows_geometry(pixel)) {
        vec4 now = texelFetch(found_now, pixel, 0);
        float before = texelFetch(age, pixel, 0).x;
        mean = before > 0.0 ? mix(texelFetch(reprojected, pixel, 0), now, 1.0 / (before + 1.0)) : now;
        pictures = min(before > 0.0 ? before + 1.0 : first_age, most_age);
    }
    imageStore(history_irradiance, pixel, mean);
    imageStore(history_place, pixel, vec4(texelFetch(gbuffer_position, pixel, 0).xyz, pictures));
    imageStore(history_normal, pixel, vec4(texelFetch(gbuffer_shading_normal, pixel, 0).xyz, 0.0));
    vec3 over = max(mean.rgb - brightest, 0.0);
    imageStore(result, pixel, mean + vec4(-over, dot(over, vec3(1.0 / 3.0))));
}
