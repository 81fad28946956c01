// SPDX-License-Identifier: GPL-3.0-or-later
// Negative point lights on pixels whose surface turns its back to lights: what reaches the back would be stopped there,
// and goes on from the pixel in the mean direction that it comes in (seed 001, 3.3). A work group makes one, for the
// pixel alone.
#include "passes/gbuffer_samplers.glsl"
#include "gpu_layout/VirtualPointLight"
#include "lib/vpl.glsl"

layout(local_size_x = GROUP_SIZE) in;

// Cosine of a surface that the camera grazes: bounds the area that its pixel covers.
#define LEAST_FACING 0.1

layout(std430, binding = LIGHT_BINDING) readonly buffer Lights { VirtualPointLight lights[]; };
layout(std430, binding = PIXEL_BINDING) readonly buffer Pixels { ivec2 pixels[]; };
layout(std430, binding = NEGATIVE_BINDING) writeonly buffer Negatives { VirtualPointLight negatives[]; };

uniform uint light_count;
uniform float width_at_0, width_per_depth; // of a pixel, m: width_at_0 + width_per_depth x depth
uniform vec3 camera_position;           // m, from the local origin
uniform vec3 camera_backward;           // unit
uniform bool is_orthographic;

shared vec3 group_flux[GROUP_SIZE], group_direction[GROUP_SIZE];

// m² of surface in a pixel.
float pixel_area(Surface surface) {
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - surface.position);
    float width = width_at_0 + width_per_depth * surface.depth;
    float facing = max(dot(to_camera, surface.geometric_normal), LEAST_FACING);
    return width * width * dot(to_camera, camera_backward) / facing;
}

void main() {
    uint index = gl_LocalInvocationIndex;
    ivec2 pixel = pixels[gl_WorkGroupID.x];
    bool shown = pixel_shows_geometry(pixel);
    Surface surface = fetch_surface(pixel);
    vec3 irradiance = vec3(0.0), direction = vec3(0.0);
    for (uint i = index; shown && i < light_count; i += uint(GROUP_SIZE)) {
        VirtualPointLight light = lights[i];
        vec3 from_light = surface.position - light.position;
        float geometry =
            bounded_geometry(surface.position, -surface.shading_normal, light.position, light.normal, light.area).x;
        if (geometry > 0.0) {
            irradiance += geometry * light.flux;
            direction += geometry * dot(light.flux, vec3(1.0 / 3.0)) * normalize(from_light);
        }
    }
    group_flux[index] = irradiance;
    group_direction[index] = direction;
    for (uint half_size = uint(GROUP_SIZE / 2); half_size > 0u; half_size /= 2u) {
        barrier();
        if (index < half_size) {
            group_flux[index] += group_flux[index + half_size];
            group_direction[index] += group_direction[index + half_size];
        }
    }
    if (index == 0u) {
        vec3 mean = group_direction[0];
        float squared = dot(mean, mean);
        VirtualPointLight negative;
        negative.position = surface.position;
        negative.normal = squared > 0.0 ? mean * inversesqrt(squared) : vec3(0.0);
        negative.area = shown ? pixel_area(surface) : 0.0;
        negative.flux = squared > 0.0 ? group_flux[0] * negative.area : vec3(0.0);
        negative.geometric_normal = vec3(0.0);
        negatives[gl_WorkGroupID.x] = negative;
    }
}
