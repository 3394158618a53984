//! Shading of surfaces: one key light, one fill light, a bright sky over a dark ground, and a highlight.
//!
//! The GPU shader receives the same constants; a test compares GPU and CPU.

use crate::geometry::Vertex;
use flotor_hal::DVec3;

/// Direction towards the key light: left, front and above. Not a unit vector.
pub const KEY: DVec3 = DVec3::new(-0.45, -0.65, 0.9);
/// Direction towards the fill light, on the side opposite the key light: right, behind and above. Not a unit vector.
pub const FILL: DVec3 = DVec3::new(0.8, 0.35, 0.25);
/// Weights of the light sources, as fractions of the colour.
const KEY_PART: f64 = 0.62;
const FILL_PART: f64 = 0.22;
const SKY_PART: f64 = 0.42;
const GROUND_PART: f64 = 0.18;
/// Strength and sharpness of the highlight.
const SHINE: f64 = 0.42;
const SHARPNESS: i32 = 48;
/// Strength of the rim light, which separates the edge of a round body from its background.
const RIM: f64 = 0.10;

/// Returns the colour of a vertex seen from `eye_mm`, sRGB components from 0 to slightly above 1; the colour itself without a
/// normal.
#[must_use]
pub fn shade(vertex: &Vertex, eye_mm: DVec3) -> [f64; 3] {
    let [r, g, b, _] = vertex.color;
    let base = [r, g, b].map(|part| f64::from(part) / 255.0);
    let normal = DVec3::from_array(vertex.normal.map(f64::from));
    if normal == DVec3::ZERO {
        return base;
    }
    let to_eye = (eye_mm - DVec3::from_array(vertex.position_mm.map(f64::from))).normalize_or_zero();
    let (key, fill) = (KEY.normalize(), FILL.normalize());
    let sky = 0.5 + 0.5 * normal.z;
    let diffuse = KEY_PART * normal.dot(key).max(0.0)
        + FILL_PART * normal.dot(fill).max(0.0)
        + SKY_PART * sky
        + GROUND_PART * (1.0 - sky);
    let half = (key + to_eye).normalize_or_zero();
    let highlight = SHINE * normal.dot(half).max(0.0).powi(SHARPNESS);
    let rim = RIM * (1.0 - normal.dot(to_eye).max(0.0)).powi(3);
    base.map(|part| part * diffuse + highlight + rim)
}

/// Returns the constants of this module in WGSL, to be prepended to the shader.
#[must_use]
pub fn wgsl_constants() -> String {
    let vector =
        |name: &str, DVec3 { x, y, z }: DVec3| format!("const {name} = vec3<f32>({x:?}, {y:?}, {z:?});\n");
    let numbers = [
        ("KEY_PART", KEY_PART),
        ("FILL_PART", FILL_PART),
        ("SKY_PART", SKY_PART),
        ("GROUND_PART", GROUND_PART),
        ("SHINE", SHINE),
        ("SHARPNESS", f64::from(SHARPNESS)),
        ("RIM", RIM),
    ];
    let numbers = numbers.iter().map(|(name, number)| format!("const {name}: f32 = {number:?};\n"));
    vector("KEY", KEY) + &vector("FILL", FILL) + &numbers.collect::<String>()
}
