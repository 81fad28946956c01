// SPDX-License-Identifier: GPL-3.0-or-later
// Adds one wave's light to every pixel, times the share that its shadows leave (seed 000, eq. 4.9).
#include "passes/gbuffer_samplers.glsl"
#include "lib/wave.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

#if AT_CORNERS
// Position and material, normal.
layout(std430, binding = POINT_BINDING) readonly buffer Points { vec4 points[]; };
// Irradiance in front and behind, specular radiance.
layout(std430, binding = RESULT_BINDING) readonly buffer Sums { vec4 sums[]; };
// Points of each triangle's corners by face id.
layout(std430, binding = FACE_BINDING) readonly buffer Faces { ivec4 faces[]; };
#else
layout(rgba32f, binding = 0) readonly uniform image2D irradiance_sum;
layout(rgba32f, binding = 1) readonly uniform image2D specular_sum;
#endif
layout(rgba32f, binding = 2) uniform image2D irradiance;    // W/m²
layout(rgba32f, binding = 3) uniform image2D specular;      // W/(m² sr)
layout(rgba32f, binding = 4) uniform image2D unshadowed;    // W/m²
layout(binding = VISIBILITY_UNIT) uniform sampler2D visibility;

uniform bool has_shadows;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(irradiance))) || !pixel_shows_geometry(pixel)) {
        return;
    }
#if AT_CORNERS
    ivec4 ids = texelFetch(gbuffer_ids, pixel, 0);
    ivec4 corners = faces[ids.z];
    vec3 position = texelFetch(gbuffer_position, pixel, 0).xyz;
    vec3 weights = barycentric(
        position, points[2 * corners.x].xyz, points[2 * corners.y].xyz, points[2 * corners.z].xyz
    );
    int side = seen_from_back(ids) ? 1 : 0;
    vec4 received = weights.x * sums[3 * corners.x + side] + weights.y * sums[3 * corners.y + side]
        + weights.z * sums[3 * corners.z + side];
    vec4 reflected = weights.x * sums[3 * corners.x + 2] + weights.y * sums[3 * corners.y + 2]
        + weights.z * sums[3 * corners.z + 2];
#else
    vec4 received = imageLoad(irradiance_sum, pixel);
    vec4 reflected = imageLoad(specular_sum, pixel);
#endif
    float seen = has_shadows ? clamp(texelFetch(visibility, pixel, 0).r, 0.0, 1.0) : 1.0;
    imageStore(irradiance, pixel, imageLoad(irradiance, pixel) + seen * received);
    imageStore(specular, pixel, imageLoad(specular, pixel) + seen * reflected);
    imageStore(unshadowed, pixel, imageLoad(unshadowed, pixel) + received);
}
