// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance times the share of it that gets there: what rays found of it over what they asked for, both filtered. So
// what is exact stays exact where all is visible, and all noise is in the penumbras (Heitz, Hill and McGuire 2018).
layout(binding = IRRADIANCE_UNIT) uniform sampler2D irradiance;
layout(binding = SHADOWED_UNIT) uniform sampler2D shadowed;
layout(binding = UNSHADOWED_UNIT) uniform sampler2D unshadowed;

layout(location = 0) out vec4 out_irradiance;   // W/m²
layout(location = 1) out vec4 out_ratio;

// Not a quotient where both are the same: a GPU's division may be off by a bit. Filters may move either a little.
float share(float seen, float asked, float otherwise) {
    return asked > 0.0 ? (seen == asked ? 1.0 : clamp(seen / asked, 0.0, 1.0)) : otherwise;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 seen = texelFetch(shadowed, pixel, 0).rgb, asked = texelFetch(unshadowed, pixel, 0).rgb;
    // A channel that no picked light has, though others have it, is occluded as the rest.
    float all_channels = share(dot(seen, vec3(1.0)), dot(asked, vec3(1.0)), 1.0);
    vec3 ratio = vec3(
        share(seen.r, asked.r, all_channels), share(seen.g, asked.g, all_channels), share(seen.b, asked.b, all_channels)
    );
    vec4 sum = texelFetch(irradiance, pixel, 0);
    out_irradiance = vec4(sum.rgb * ratio, sum.a);
    out_ratio = vec4(ratio, 1.0);
}
