// SPDX-License-Identifier: GPL-3.0-or-later
// One jittered picture put together and weighted for the sum over all of them.
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"

layout(binding = DIRECT_UNIT) uniform sampler2D direct_radiance;    // W/(m² sr)
#ifdef HAS_INDIRECT
layout(binding = IRRADIANCE_UNIT) uniform sampler2D irradiance;     // W/m²
#endif
#ifdef HAS_SPECULAR
layout(binding = SPECULAR_UNIT) uniform sampler2D specular_radiance; // W/(m² sr)
#endif

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform vec3 world_radiance;    // W/(m² sr)
uniform float weight;           // one over the number of pictures
#ifdef ENVIRONMENT_UNIT
#include "lib/environment.glsl"
layout(binding = ENVIRONMENT_UNIT) uniform sampler2D environment_map;   // W/(m² sr)
// In the map's frame: through the picture's lower left corner, and what a pixel to the right and up adds.
uniform vec3 background_corner;
uniform vec3 background_right;
uniform vec3 background_up;
#endif

layout(location = 0) out vec4 out_combined;
layout(location = 1) out vec4 out_direct;       // w: share of the pixel that shows geometry
layout(location = 2) out vec4 out_indirect;
layout(location = 3) out vec4 out_irradiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (!pixel_shows_geometry(pixel)) {
        vec3 background = world_radiance;
#ifdef ENVIRONMENT_UNIT
        vec3 ray = background_corner + gl_FragCoord.x * background_right + gl_FragCoord.y * background_up;
        background += textureLod(environment_map, environment_place(ray), 0.0).rgb;
#endif
        out_combined = weight * vec4(background, 1.0);
        out_direct = out_indirect = out_irradiance = vec4(0.0);
        return;
    }
    Surface surface = fetch_surface(pixel);
    vec3 direct = texelFetch(direct_radiance, pixel, 0).rgb;
    vec3 received = vec3(0.0);
#ifdef HAS_INDIRECT
    received = texelFetch(irradiance, pixel, 0).rgb;
#endif
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - surface.position);
    vec3 indirect = diffuse_albedo(surface, to_camera) * received * INVERSE_PI;
    vec3 specular = vec3(0.0);
#ifdef HAS_SPECULAR
    specular = texelFetch(specular_radiance, pixel, 0).rgb;
#endif
    out_combined = weight * vec4(surface.emission + direct + indirect + specular, 1.0);
    out_direct = weight * vec4(direct, 1.0);
    out_indirect = weight * vec4(indirect, 1.0);
    out_irradiance = weight * vec4(received, 1.0);
}
