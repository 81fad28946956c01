// SPDX-License-Identifier: GPL-3.0-or-later
// The one ray that each pixel's specular lobe sends out in a picture.
#include "passes/reflection_ray.glsl"
#include "lib/spread_pattern.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = 0) writeonly uniform image2D rays; // unit direction, w: its density in 1/sr; 0 for no ray

uniform uint sample_index;

// Two numbers in [0, 1). Those of a tile of 4 x 4 pixels are evenly spread; tiles are turned against each other, or all of
// the picture would miss the same narrow light.
vec2 ray_numbers(uvec2 pixel) {
    uint tile = pcg_hash((pixel.x >> 2) + pcg_hash(pixel.y >> 2));
    vec2 turn = vec2(unit_float(tile), unit_float(pcg_hash(tile)));
    return min(fract(spread_pattern(pixel, 0u, sample_index) + turn), vec2(1.0 - 1.0 / 16777216.0));
}

vec4 sampled_ray(ivec2 pixel) {
    Lobe lobe = pixel_lobe(pixel);
    if (!(lobe.share > 0.0)) {
        return vec4(0.0);
    }
    vec3 normal = lobe.surface.shading_normal, facet = normal;
    float alpha = lobe.reflector.alpha;
    if (alpha > LEAST_ALPHA) {
        facet = visible_normal(normal, lobe.to_eye, alpha, ray_numbers(uvec2(pixel)));
    }
    vec3 direction = normalize(reflect(-lobe.to_eye, facet));
    float density = reflection_density(clamp(dot(normal, facet), 0.0, 1.0), lobe.cos_view, alpha);
    bool is_above = dot(normal, direction) > 0.0 && dot(lobe.surface.geometric_normal, direction) > 0.0;
    // What is no number is not above 0 either.
    return is_above && density > 0.0 && density < 1e30 ? vec4(direction, density) : vec4(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(rays)))) {
        imageStore(rays, pixel, sampled_ray(pixel));
    }
}
