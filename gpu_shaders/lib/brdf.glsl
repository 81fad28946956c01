// SPDX-License-Identifier: GPL-3.0-or-later
// Diffuse and Principled reflection of a surface; float32 form of vlm_addon/core/brdf.py, which explains the model.
#ifndef LIB_BRDF
#define LIB_BRDF
#include "lib/gbuffer.glsl"

#define INVERSE_PI 0.318309886183791
// Roughness below which a lobe is a mirror that lamps do not show in; keeps float32 finite.
#define LEAST_ALPHA 1e-4
// Keeps float32 finite.
#define LEAST_IOR 1e-5
// Variance of half vectors over a small light, per steradian, as an addition to alpha squared.
#define LIGHT_SPREAD 0.1

// What is the same for all lights that fall on a surface seen from one direction.
struct Reflector {
    vec3 diffuse;       // reflectance of the Lambertian base after what the layers above keep
    vec3 metal_f0;      // reflectance of the metal at normal incidence
    vec3 metal_weight;  // share of the metal times its multiple-scattering gain
    float dielectric_weight;
    float ior;          // of the specular layer
    float alpha;        // roughness squared; 0 for no specular reflection at all
};

float f0_from_ior(float ior) {
    float root = (ior - 1.0) / (ior + 1.0);
    return root * root;
}

// Index of refraction of the specular layer: a level of 0.5 leaves `ior`, others scale its F0 by twice the level.
float specular_ior(float ior, float level) {
    ior = max(ior, LEAST_IOR);
    if (level == 0.5) {
        return ior;
    }
    float root = sqrt(clamp(f0_from_ior(ior) * 2.0 * max(level, 0.0), 0.0, MAX_F0));
    float scaled = (1.0 + root) / (1.0 - root);
    return ior < 1.0 ? 1.0 / scaled : scaled;
}

// Unpolarised reflectance of a dielectric interface; 1 under total internal reflection.
float fresnel_dielectric(float cosine, float ior) {
    float g_squared = ior * ior - 1.0 + cosine * cosine;
    if (g_squared <= 0.0) {
        return 1.0;
    }
    float g = sqrt(g_squared);
    float a = (g - cosine) / (g + cosine);
    float b = ((g + cosine) * cosine - 1.0) / ((g - cosine) * cosine + 1.0);
    return 0.5 * a * a * (1.0 + b * b);
}

// Cosine-weighted mean of the above over the hemisphere: fits of Kulla and Conty 2017.
float fresnel_dielectric_mean(float ior) {
    return ior < 1.0 ? 0.997118 + ior * (0.1014 - ior * (0.965241 + ior * 0.130607))
        : (ior - 1.0) / (4.08567 + 1.00071 * ior);
}

// Factor on a single-scatter lobe that makes up for light scattered more than once (Kulla and Conty 2017).
vec3 scattering_gain(float albedo, float mean_albedo, vec3 mean_fresnel) {
    vec3 multiple = mean_fresnel * mean_albedo / max(1.0 - mean_fresnel * (1.0 - mean_albedo), 1e-4);
    return 1.0 + multiple * (1.0 - albedo) / max(albedo, 1e-4);
}

// The channels of core/brdf.py's albedo_table for one interface and view.
vec4 lookup_albedo(sampler3D albedo_table, float f0, float cos_view, float roughness) {
    vec3 coordinate = vec3(roughness, sqrt(clamp(cos_view, 0.0, 1.0)), sqrt(sqrt(f0)));
    vec3 size = vec3(textureSize(albedo_table, 0));
    return textureLod(albedo_table, (clamp(coordinate, 0.0, 1.0) * (size - 1.0) + 0.5) / size, 0.0);
}

// How `surface` reflects towards the unit direction to_view. albedo_table: core/brdf.py's, filtered linearly.
Reflector make_reflector(Surface surface, vec3 to_view, sampler3D albedo_table) {
#ifdef ALL_DIFFUSE
    // Software renderers would look the table up for every pixel.
    return Reflector(surface.base_color, vec3(0.0), vec3(0.0), 0.0, 1.0, 0.0);
#else
    if (surface.model != MODEL_PRINCIPLED) {
        return Reflector(surface.base_color, vec3(0.0), vec3(0.0), 0.0, 1.0, 0.0);
    }
    float cos_view = max(dot(surface.shading_normal, to_view), 0.0);
    float ior = specular_ior(surface.ior, surface.specular_ior_level);
    float f0 = f0_from_ior(ior);
    vec4 albedo = lookup_albedo(albedo_table, f0, cos_view, surface.roughness);
    float gain = scattering_gain(albedo.y, albedo.z, vec3(fresnel_dielectric_mean(ior))).x;
    float layer_albedo = (f0 + (1.0 - f0) * albedo.x) * albedo.y * gain;
    vec3 metal_f0 = min(surface.base_color, 1.0);
    vec3 metal_gain = scattering_gain(albedo.y, albedo.z, metal_f0 + (1.0 - metal_f0) * (1.0 / 21.0));
    float dielectric = 1.0 - surface.metallic;
    return Reflector(
        surface.base_color * (dielectric * max(1.0 - layer_albedo, 0.0)), metal_f0, surface.metallic * metal_gain,
        dielectric * gain, ior, max(surface.roughness * surface.roughness, LEAST_ALPHA)
    );
#endif
}

// Roughness squared of a lobe that a light of some solid angle (sr) blurs as much as its half vectors spread. 0 stays 0.
float widened_alpha(float alpha, float solid_angle) {
    return alpha == 0.0 ? 0.0 : min(sqrt(alpha * alpha + LIGHT_SPREAD * solid_angle), 1.0);
}

// GGX lobe with height-correlated Smith shadowing (Heitz 2014), without Fresnel, times the cosine of the light.
// sine_squared: of the angle between the normal and the half vector.
float ggx_lobe_of_sine(float sine_squared, float cos_light, float cos_view, float alpha) {
    float alpha_squared = alpha * alpha;
    float denominator = alpha_squared + sine_squared * (1.0 - alpha_squared);
    float distribution = alpha_squared * INVERSE_PI / max(denominator * denominator, 1e-30);
    float view_part = cos_light * sqrt(cos_view * cos_view * (1.0 - alpha_squared) + alpha_squared);
    float light_part = cos_view * sqrt(cos_light * cos_light * (1.0 - alpha_squared) + alpha_squared);
    return distribution * cos_light * 0.5 / max(view_part + light_part, 1e-20);
}

float ggx_lobe(float cos_half, float cos_light, float cos_view, float alpha) {
    // 1 - cos² without cancellation matters for sharp lobes; cos_half is close to 1 there.
    return ggx_lobe_of_sine(max((1.0 - cos_half) * (1.0 + cos_half), 0.0), cos_light, cos_view, alpha);
}

// What the specular lobe reflects of light whose half vector stands at cos_vh to the view; times the GGX lobe.
vec3 lobe_fresnel(Reflector reflector, float cos_vh) {
    float grazing = 1.0 - cos_vh;
    float grazing_squared = grazing * grazing;
    vec3 metal = reflector.metal_f0 + (1.0 - reflector.metal_f0) * (grazing_squared * grazing_squared * grazing);
    float dielectric = reflector.dielectric_weight * fresnel_dielectric(cos_vh, reflector.ior);
    return reflector.metal_weight * metal + dielectric;
}

// Specular BRDF times the cosine of the light, 1/sr. normal, to_light, to_view: unit.
vec3 specular_reflection(Reflector reflector, vec3 normal, vec3 to_light, vec3 to_view) {
    float cos_light = dot(normal, to_light), cos_view = dot(normal, to_view);
    if (reflector.alpha == 0.0 || cos_light <= 0.0 || cos_view <= 0.0) {
        return vec3(0.0);
    }
    vec3 half_vector = to_light + to_view;
    half_vector *= inversesqrt(max(dot(half_vector, half_vector), 1e-30));
    float cos_vh = clamp(dot(to_view, half_vector), 0.0, 1.0);
    float lobe = ggx_lobe(clamp(dot(normal, half_vector), 0.0, 1.0), cos_light, cos_view, reflector.alpha);
    return lobe * lobe_fresnel(reflector, cos_vh);
}
#endif
