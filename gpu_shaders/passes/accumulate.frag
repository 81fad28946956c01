// SPDX-License-Identifier: GPL-3.0-or-later
// One jittered picture put together and weighted for the sum over all of them.
#include "passes/gbuffer_samplers.glsl"
#include "passes/picture_light.glsl"

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
#ifdef EVERY_OUTPUT
layout(location = 3) out vec4 out_irradiance;
layout(location = 4) out vec4 out_specular;
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (!pixel_shows_geometry(pixel)) {
        vec3 background = world_radiance;
#ifdef ENVIRONMENT_UNIT
        vec3 ray = background_corner + gl_FragCoord.x * background_right + gl_FragCoord.y * background_up;
        background += textureLod(environment_map, environment_place(ray), 0.0).rgb;
#endif
        out_combined = weight * vec4(background, 1.0);
        out_direct = out_indirect = vec4(0.0);
#ifdef EVERY_OUTPUT
        out_irradiance = out_specular = vec4(0.0);
#endif
        return;
    }
    Surface surface = fetch_surface(pixel);
    vec3 direct = direct_radiance(pixel);
    vec3 indirect = indirect_radiance(pixel, surface);
    vec3 specular = specular_radiance(pixel);
    out_combined = weight * vec4(surface.emission + direct + indirect + specular, 1.0);
    out_direct = weight * vec4(direct, 1.0);
    out_indirect = weight * vec4(indirect, 1.0);
#ifdef EVERY_OUTPUT
    out_irradiance = weight * vec4(received(pixel), 1.0);
    out_specular = weight * vec4(specular, 1.0);
#endif
}
