// A vertex shows its emission plus its radiosity, brought down to white as the library does.
struct Push { clip_from_object: mat4x4<f32>, emission_white: vec4<f32> }
struct Lit { @builtin(position) clip: vec4<f32>, @location(0) radiance: vec3<f32> }
@group(0) @binding(0) var<uniform> push: Push;

@vertex fn vertex(@location(0) position: vec3<f32>, @location(1) light: vec4<f32>) -> Lit {
    return Lit(push.clip_from_object * vec4(position, 1.0), push.emission_white.rgb + light.rgb);
}

@fragment fn fragment(lit: Lit) -> @location(0) vec4<f32> {
    let shown = max(lit.radiance, vec3(0.0));
    let brightest = max(shown.r, max(shown.g, shown.b));
    return vec4(shown * min(1.0, push.emission_white.w / max(brightest, 1e-9)), 1.0);
}
