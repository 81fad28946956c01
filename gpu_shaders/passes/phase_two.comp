// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from a run of virtual lights, added to what earlier runs gave (seed 002, 3.3 and eq. 3.1).
#include "gpu_layout/VirtualLight"
#include "passes/gbuffer_samplers.glsl"
#include "lib/form_factor.glsl"

layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;

layout(std430, binding = VIRTUAL_LIGHT_BINDING) readonly buffer VirtualLights { VirtualLight lights[]; };
layout(std430, binding = RADIOSITY_BINDING) readonly buffer Radiosities { vec4 radiosities[]; }; // W/m², w unused

layout(rgba32f, binding = 0) uniform image2D irradiance; // W/m²

uniform int first_light;
uniform int end_light;

void main() {
    // One invocation shades a column of pixels, so that each light is fetched once for all of them.
    ivec2 first_pixel = ivec2(gl_GlobalInvocationID.xy) * ivec2(1, PIXELS_PER_INVOCATION);
    ivec2 size = imageSize(irradiance);
    vec3 positions[PIXELS_PER_INVOCATION];
    vec3 normals[PIXELS_PER_INVOCATION];
    int tag_ids[PIXELS_PER_INVOCATION];
    vec3 sums[PIXELS_PER_INVOCATION];
    for (int k = 0; k < PIXELS_PER_INVOCATION; ++k) {
        ivec2 pixel = min(first_pixel + ivec2(0, k), size - 1);
        positions[k] = texelFetch(gbuffer_position, pixel, 0).xyz;
        normals[k] = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
        tag_ids[k] = texelFetch(gbuffer_ids, pixel, 0).y;
        sums[k] = vec3(0.0);
    }
    for (int i = first_light; i < end_light; ++i) {
        VirtualLight light = lights[i];
        vec3 radiosity = radiosities[i].rgb;
        for (int k = 0; k < PIXELS_PER_INVOCATION; ++k) {
            // A tagged light leaves out the surfaces of its own tag (seed 002, 3.4).
            if (light.tag_id == UNTAGGED || light.tag_id != tag_ids[k]) {
                sums[k] += radiosity * triangle_form_factor(
                    positions[k], normals[k], light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius
                );
            }
        }
    }
    for (int k = 0; k < PIXELS_PER_INVOCATION; ++k) {
        ivec2 pixel = first_pixel + ivec2(0, k);
        if (all(lessThan(pixel, size)) && pixel_shows_geometry(pixel)) {
            imageStore(irradiance, pixel, vec4(imageLoad(irradiance, pixel).rgb + sums[k], 1.0));
        }
    }
}
