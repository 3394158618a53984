// The 3D view: a backdrop, then triangles lit as `light.rs` lights them. The constants above these lines come from there.

struct View {
    projection: mat4x4<f32>,
    eye_mm: vec4<f32>,
    top: vec4<f32>,
    bottom: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @location(0) position_mm: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
}

struct Lit {
    @builtin(position) clip: vec4<f32>,
    @location(0) position_mm: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
}

@vertex
fn place(corner: Corner) -> Lit {
    let clip = view.projection * vec4(corner.position_mm, 1.0);
    return Lit(clip, corner.position_mm, corner.normal, corner.color);
}

@fragment
fn shade(lit: Lit) -> @location(0) vec4<f32> {
    // A normal of zero: a surface that no light changes.
    if (dot(lit.normal, lit.normal) < 1.0e-6) {
        return lit.color;
    }
    let normal = normalize(lit.normal);
    let to_eye = normalize(view.eye_mm.xyz - lit.position_mm);
    let key = normalize(KEY);
    let sky = 0.5 + 0.5 * normal.z;
    let diffuse = KEY_PART * max(dot(normal, key), 0.0)
        + FILL_PART * max(dot(normal, normalize(FILL)), 0.0)
        + SKY_PART * sky
        + GROUND_PART * (1.0 - sky);
    let highlight = SHINE * pow(max(dot(normal, normalize(key + to_eye)), 0.0), SHARPNESS);
    let rim = RIM * pow(1.0 - max(dot(normal, to_eye), 0.0), 3.0);
    return vec4(lit.color.rgb * diffuse + highlight + rim, lit.color.a);
}

struct Behind {
    @builtin(position) clip: vec4<f32>,
    @location(0) height: f32,
}

// One triangle that covers the view.
@vertex
fn cover(@builtin(vertex_index) index: u32) -> Behind {
    let x = select(-1.0, 3.0, index == 1u);
    let y = select(-1.0, 3.0, index == 2u);
    return Behind(vec4(x, y, 1.0, 1.0), 0.5 - 0.5 * y);
}

@fragment
fn backdrop(behind: Behind) -> @location(0) vec4<f32> {
    return mix(view.top, view.bottom, behind.height);
}
