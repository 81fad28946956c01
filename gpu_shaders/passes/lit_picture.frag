// SPDX-License-Identifier: GPL-3.0-or-later
// What each pixel sends to the eye but for indirect light in glossy surfaces.
#include "passes/picture_light.glsl"

layout(location = 0) out vec4 out_radiance; // W/(m² sr); w: 1 where a surface shows

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_radiance = vec4(0.0);
    if (pixel_shows_geometry(pixel)) {
        Surface surface = fetch_surface(pixel);
        out_radiance = vec4(surface.emission + direct_radiance(pixel) + indirect_radiance(pixel, surface), 1.0);
    }
}
