//! 3D scene: bodies at the pose of the handle, on a ground, with force and torque on the hand as arrows.

use crate::palette::{Palette, strain_color};
use crate::shape::{Posed, Rest, Shape};
use flotor_drawing::camera::{Camera, Extent};
use flotor_drawing::contact::{append_contact, contact};
use flotor_drawing::geometry::{
    Body, Color, Curve, Detail, Ground, LocalStrain, MM_PER_M, Mesh, Section, Shadow, Strain,
    append_primitive, append_surface, append_tube, contact_strain, force_arrow, plate, torque_arrow,
};
use flotor_drawing::light;
use flotor_drawing::placing::{Placing, round_below};
use flotor_hal::{DVec3, Part, Pose, Primitive, ScalarField, Wrench};
use flotor_history::Sample;

/// Scale of force and torque arrows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct ArrowScale {
    /// Force drawn as an arrow as long as the body is high, N.
    pub force_n: f64,
    /// Torque drawn as an arrow of a 3/4 turn, N·m.
    pub torque_nm: f64,
}

impl Default for ArrowScale {
    /// Returns the smallest scale: smaller forces and torques have short arrows.
    fn default() -> Self {
        Self { force_n: FULL_FORCE * 1.0e-3, torque_nm: 1.0e-5 }
    }
}

impl ArrowScale {
    /// Returns the scale enlarged to fit one more sample, whose force and torque then have arrows of full length at most.
    pub fn with(self, sample: &Sample) -> Self {
        Self {
            force_n: self.force_n.max(FULL_FORCE * sample.force_n().length()),
            torque_nm: self.torque_nm.max(sample.torque_nm().length()),
        }
    }

    /// Returns the scale for a chosen largest force, N, if any: the arrows of several pictures are then comparable.
    pub fn with_chosen(self, force_n: Option<f64>) -> Self {
        Self { force_n: force_n.map_or(self.force_n, |force_n| FULL_FORCE * force_n), ..self }
    }

    /// Returns the larger force and the larger torque of both scales.
    pub fn larger(self, other: Self) -> Self {
        Self { force_n: self.force_n.max(other.force_n), torque_nm: self.torque_nm.max(other.torque_nm) }
    }
}

/// Ratio of the body height to the arrow length of the largest force, so that the tip is visible in the default view, also at rest.
const FULL_FORCE: f64 = 3.6;

/// Data of a scene at one time.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Sample of each device.
    pub samples: &'a [Sample],
    /// Pose of each handle of a second recording in its device frame, drawn as a translucent ball.
    pub compared: &'a [Option<Pose>],
}

impl<'a> Moment<'a> {
    /// Creates the data from samples, without a second recording.
    #[must_use]
    pub const fn of(samples: &'a [Sample]) -> Self {
        Self { samples, compared: &[] }
    }
}

/// Builder of a scene; its buffers are reused from frame to frame.
#[derive(Default)]
pub struct SceneBuilder {
    mesh: Mesh,
    /// Ground at the start of the mesh, rebuilt only when it changes.
    ground: Option<Ground>,
    /// Number of vertices and of indices of the ground in the mesh.
    bare: [usize; 2],
    corners_made: u64,
    /// Largest value of a surface so far: the end of the colour scale.
    largest: f64,
}

/// Properties of a scene, for legends and warnings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneFacts {
    /// Meaning of the colours; `None` without a scale.
    pub scale: Option<ColorScale>,
    /// Largest value shown, as a fraction of the scale.
    pub peak_part: f64,
    /// True if turns of a coil touch.
    pub touching: bool,
    /// True if a body is off its seat.
    pub lifted: bool,
    /// True if a model had no shape at this pose.
    pub no_shape: bool,
    /// Places of the devices.
    pub placing: Placing,
    /// Distance between the grid lines of the ground, m.
    pub grid_m: f64,
    /// Height of the lower end of the bodies, m.
    pub foot_m: f64,
    /// Axes of the device frame in the frame of the scene.
    pub axes: [DVec3; 3],
    /// Scale of the arrows; `None` without arrows.
    pub arrows: Option<ArrowKey>,
    /// Depth of the deepest contact of a handle with a primitive body, m; `None` without a contact or without arrows.
    pub contact_depth_m: Option<f64>,
}

/// Scale of the arrows, for the legend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrowKey {
    /// Length of an arrow per force, mm/N.
    pub mm_per_n: f64,
    /// Largest force so far, or the chosen force, N.
    pub full_force_n: f64,
    /// Torque drawn as an arrow of a 3/4 turn, N·m.
    pub torque_nm: f64,
}

/// Meaning of the colours of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColorScale {
    /// Strain of a slender body.
    Strain,
    /// Values of a surface, from 0 to the largest so far.
    Field(ScalarField, f64),
}

/// Strain at the end of the scale, for a body without turns that can touch.
const FULL_STRAIN: f64 = 0.5;
/// Thickness of plates, as a fraction of the radius.
const PLATE_THICKNESS: f64 = 0.16;
/// Ratio of the drawn to the specified radius of plates, so that plates reach beyond the outer edge of the coil.
const PLATE_OVERHANG: f64 = 1.18;
/// Depth below home of the lower end of a handle without a body, as a fraction of the scene height.
const BARE_DEPTH: f64 = 0.3;
/// Height of a scene without any body, m.
const EMPTY_HEIGHT_M: f64 = 0.025;

impl SceneBuilder {
    /// Returns the height of the scene, mm: of the tallest body, or 25 mm without bodies.
    #[must_use]
    pub fn height_mm(shapes: &[Shape]) -> f64 {
        let tallest = shapes.iter().map(Shape::height_m).fold(0.0, f64::max);
        MM_PER_M * if tallest > 0.0 { tallest } else { EMPTY_HEIGHT_M }
    }

    /// Returns the total number of vertices built so far, without the ground.
    #[must_use]
    pub fn corners_made(&self) -> u64 {
        self.corners_made
    }

    /// Returns the extent of the bodies side by side, for this number of devices.
    #[must_use]
    pub fn extent(shapes: &[Shape], devices: usize) -> Extent {
        let height_mm = Self::height_mm(shapes);
        let height_m = height_mm / MM_PER_M;
        let placing = Placing::of(devices, height_m, plates_m(shapes, height_m));
        Extent { height_mm, width_mm: MM_PER_M * placing.width_m() }
    }

    /// Builds the scene at one time, for a picture of this height in pixels; returns its mesh and properties.
    #[allow(clippy::too_many_arguments)] // independent arguments with a single call site
    pub fn build(
        &mut self,
        shapes: &mut [Shape],
        Moment { samples, compared }: Moment<'_>,
        palette: &Palette,
        camera: &Camera,
        height_px: f64,
        scale: ArrowScale,
        shows_arrows: bool,
    ) -> (&Mesh, SceneFacts) {
        let height_m = Self::height_mm(shapes) / MM_PER_M;
        let plate_radius_m = plates_m(shapes, height_m);
        let body_m = shapes.iter().map(Shape::ground_m).fold(0.0, f64::max);
        let depth_m = if body_m > 0.0 { body_m } else { height_m };
        let ground = ground(palette, height_m, depth_m + PLATE_THICKNESS * plate_radius_m);
        let placing = Placing::of(samples.len(), height_m, plate_radius_m);
        let mut facts = SceneFacts {
            placing,
            grid_m: ground.spacing_m,
            foot_m: if body_m > 0.0 { ground.height_m } else { -BARE_DEPTH * height_m },
            axes: axes(shapes.first()),
            arrows: shows_arrows.then_some(ArrowKey {
                mm_per_n: MM_PER_M * height_m / scale.force_n,
                full_force_n: scale.force_n / FULL_FORCE,
                torque_nm: scale.torque_nm,
            }),
            ..SceneFacts::default()
        };
        self.begin(ground);
        let pixels_per_mm = camera.pixels_per_mm(height_px);
        let mut all_shadows = Vec::with_capacity(3 * samples.len());
        for (device, sample) in samples.iter().enumerate() {
            let place_m = placing.place_m(device);
            let first = shapes.iter().find(|shape| shape.device() == device);
            let handle = in_scene_frame(first, sample);
            let in_scene = |pose: Pose| first.map_or(pose, |shape| shape.mapping().pose_to_model(&pose));
            let compared = compared.get(device).copied().flatten().map(in_scene);
            all_shadows.extend(
                shadows(&ground, palette, plate_radius_m, handle.0.position())
                    .map(|shadow| Shadow { center_m: shadow.center_m + place_m.truncate(), ..shadow }),
            );
            let start = self.mesh.vertices.len();
            // Drawn before the translucent bodies.
            compared.iter().for_each(|pose| self.compared_handle(*pose, palette, height_m));
            self.bodies(shapes, (device, sample), palette, pixels_per_mm, &mut facts);
            if shows_arrows {
                self.arrows(handle, palette, scale, height_m, plate_radius_m);
            }
            self.shift(start, place_m);
        }
        ground.shade(&mut self.mesh.vertices, &all_shadows);
        self.corners_made += (self.mesh.vertices.len() - self.bare[0]) as u64;
        (&self.mesh, facts)
    }

    /// Adds the bodies, tools and contacts of one device.
    fn bodies(
        &mut self,
        shapes: &mut [Shape],
        (device, sample): (usize, &Sample),
        palette: &Palette,
        pixels_per_mm: f64,
        facts: &mut SceneFacts,
    ) {
        let height_m = Self::height_mm(shapes) / MM_PER_M;
        let here = shapes.iter_mut().filter(|shape| shape.device() == device);
        let posed: Vec<(&Shape, Option<Posed>)> = here
            .map(|shape| {
                let posed = shape.at(&sample.pose);
                (&*shape, posed)
            })
            .collect();
        facts.no_shape |= posed.iter().any(|(_, posed)| posed.is_none());
        let drawn = || posed.iter().filter_map(|(shape, posed)| Some((*shape, posed.as_ref()?)));
        for (shape, posed) in drawn() {
            let part = match (shape.rest(), posed) {
                (Rest::Slender(body), Posed::Slender { curve, strain }) => {
                    facts.scale = Some(ColorScale::Strain);
                    let posed = (curve, strain);
                    body_of(&mut self.mesh, body, posed, palette, pixels_per_mm, &mut facts.touching)
                }
                (_, Posed::Solid(solid)) => {
                    let part = self.surface(solid, palette);
                    let field = solid.surface.field;
                    if !field.name().is_empty() {
                        facts.scale = Some(ColorScale::Field(field, self.largest));
                    }
                    part
                }
                (Rest::Solid(_), Posed::Slender { .. }) => 0.0,
            };
            if let (Rest::Slender(body), Posed::Slender { curve, .. }) = (shape.rest(), posed) {
                facts.lifted |= is_lifted(body, curve);
            }
            facts.peak_part = facts.peak_part.max(part);
        }
        if posed.is_empty() {
            self.bare_handle(&sample.pose, palette, 0.25 * height_m);
        }
        // Translucent parts come after the parts behind them: tools after surfaces, bodies that a handle enters after tools.
        let solids = || {
            drawn().filter_map(|(_, posed)| if let Posed::Solid(solid) = posed { Some(solid) } else { None })
        };
        for solid in solids() {
            let opacity = if solid.surface.triangles.is_empty() { u8::MAX } else { SEEN_THROUGH };
            self.primitives(solid, Part::Tool, with_opacity(palette.plates[0], opacity));
        }
        if facts.arrows.is_some() {
            for (shape, posed) in drawn() {
                let Posed::Solid(solid) = posed else { continue };
                let handle_m = shape.mapping().pose_to_model(&sample.pose).position();
                let Some(contact) = contact(solid, handle_m) else { continue };
                append_contact(&mut self.mesh, &contact, height_m, palette.contact);
                let deepest_m =
                    facts.contact_depth_m.map_or(contact.depth_m, |depth_m| depth_m.max(contact.depth_m));
                facts.contact_depth_m = Some(deepest_m);
            }
        }
        // Mark the seat of a lifted body by a translucent lower plate.
        for (shape, posed) in drawn() {
            if let (Rest::Slender(body), Posed::Slender { curve, .. }) = (shape.rest(), posed)
                && is_lifted(body, curve)
            {
                let (seat, radius_m) = (body.rest.section(0.0), plate_radius_m(body));
                let color = with_opacity(palette.plates[1], SEEN_THROUGH);
                plate(&mut self.mesh, &seat, radius_m, PLATE_THICKNESS * radius_m, -1.0, color);
            }
        }
        for solid in solids() {
            self.primitives(solid, Part::Body, with_opacity(palette.body, SEEN_THROUGH));
        }
    }

    /// Moves all vertices from an index on.
    fn shift(&mut self, from: usize, by_m: DVec3) {
        if by_m == DVec3::ZERO {
            return;
        }
        let by_mm = (by_m * MM_PER_M).as_vec3().to_array();
        for vertex in self.mesh.vertices.iter_mut().skip(from) {
            vertex.position_mm = std::array::from_fn(|k| vertex.position_mm[k] + by_mm[k]);
        }
    }

    /// Resets the mesh to the ground.
    fn begin(&mut self, ground: Ground) {
        if self.ground != Some(ground) {
            self.mesh.clear();
            ground.append(&mut self.mesh);
            self.bare = [self.mesh.vertices.len(), self.mesh.indices.len()];
            self.ground = Some(ground);
        }
        self.mesh.vertices.truncate(self.bare[0]);
        self.mesh.indices.truncate(self.bare[1]);
    }

    fn primitives(&mut self, solid: &flotor_hal::Shape, part: Part, color: Color) {
        let of_part = solid.primitives.iter().filter(|primitive| primitive.part() == part);
        of_part.for_each(|primitive| append_primitive(&mut self.mesh, primitive, color));
    }

    /// Adds a surface; returns its largest value as a fraction of the scale.
    fn surface(&mut self, solid: &flotor_hal::Shape, palette: &Palette) -> f64 {
        let most = solid.surface.vertices.iter().map(|vertex| vertex.value.abs()).fold(0.0, f64::max);
        self.largest = self.largest.max(most);
        let largest = if self.largest > 0.0 { self.largest } else { 1.0 };
        append_surface(&mut self.mesh, &solid.surface, |value| field_color(value.abs() / largest, palette));
        most / largest
    }

    /// Adds the handle of a device without a body, as a disc.
    fn bare_handle(&mut self, pose: &Pose, palette: &Palette, radius_m: f64) {
        let section = Section { center_m: pose.position(), orientation: pose.orientation() };
        plate(&mut self.mesh, &section, radius_m, PLATE_THICKNESS * radius_m, 1.0, palette.plates[0]);
    }

    /// Adds the handle of a second recording as a translucent ball.
    fn compared_handle(&mut self, pose: Pose, palette: &Palette, height_m: f64) {
        /// Radius, as a fraction of the scene height.
        const RADIUS: f64 = 0.06;
        let ball = Primitive::sphere(Part::Tool, pose, RADIUS * height_m);
        append_primitive(&mut self.mesh, &ball, with_opacity(palette.plates[1], SEEN_THROUGH));
    }

    fn arrows(
        &mut self,
        (handle, wrench): (Pose, Wrench),
        palette: &Palette,
        scale: ArrowScale,
        height_m: f64,
        plate_radius_m: f64,
    ) {
        let top_m = handle.position() + handle.orientation() * DVec3::Z * (PLATE_THICKNESS * plate_radius_m);
        let shaft_m = 0.018 * height_m;
        let force = wrench.force() * (height_m / scale.force_n);
        force_arrow(&mut self.mesh, top_m, force, shaft_m, palette.force);
        let torque = wrench.torque();
        let angle_rad = 0.75 * std::f64::consts::TAU * torque.length() / scale.torque_nm;
        torque_arrow(
            &mut self.mesh,
            top_m,
            torque,
            1.35 * plate_radius_m,
            angle_rad,
            0.7 * shaft_m,
            palette.torque,
        );
    }
}

/// Opacity of translucent bodies, of 255.
const SEEN_THROUGH: u8 = 130;

fn with_opacity([r, g, b, _]: Color, opacity: u8) -> Color {
    [r, g, b, opacity]
}

/// Returns the colour of a surface at a fraction of the scale: the body's colour at 0, blended into the scale's colour at 0.1.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between two bytes
pub fn field_color(part: f64, palette: &Palette) -> Color {
    let share = (10.0 * part).min(1.0);
    let scale = strain_color(part);
    std::array::from_fn(|k| {
        let (from, to) = (f64::from(palette.body[k]), f64::from(scale[k]));
        (from + share * (to - from) + 0.5) as u8
    })
}

/// Returns the ground for a scene of this height and depth beneath home.
fn ground(palette: &Palette, height_m: f64, depth_m: f64) -> Ground {
    Ground {
        height_m: -depth_m,
        radius_m: 3.2 * height_m,
        spacing_m: round_below(0.25 * height_m * MM_PER_M) / MM_PER_M,
        surface: palette.ground[0],
        line: palette.ground[1],
    }
}

/// Returns the shadows of the fixed plate, of the plate at the handle, and of the body between them.
fn shadows(ground: &Ground, palette: &Palette, plate_radius_m: f64, handle_m: DVec3) -> [Shadow; 3] {
    let fall = light::KEY / light::KEY.z;
    let of_plate = handle_m - fall * (handle_m.z - ground.height_m);
    let shadow = |center_m: DVec3, radius: f64, strength: f64| Shadow {
        center_m: center_m.truncate(),
        radius_m: radius * plate_radius_m,
        strength: strength * palette.shadow,
    };
    [shadow(DVec3::ZERO, 1.3, 0.8), shadow(of_plate, 1.1, 0.7), shadow(0.5 * of_plate, 1.3, 0.4)]
}

/// Returns handle and wrench in the frame of the scene: the frame of the first model, else of the device.
fn in_scene_frame(first: Option<&Shape>, sample: &Sample) -> (Pose, Wrench) {
    let (force_n, torque_nm) = (sample.force_n(), sample.torque_nm());
    let Some(mapping) = first.map(Shape::mapping) else {
        return (sample.pose, Wrench::new(force_n, torque_nm));
    };
    // Rotate only: an arrow shows the wrench on the hand, not the wrench of the model.
    let turn = mapping.rotation();
    (mapping.pose_to_model(&sample.pose), Wrench::new(turn * force_n, turn * torque_nm))
}

/// Returns the position of a device's handle in the frame of the scene, before the device is placed, m.
#[must_use]
pub fn handle_m(first: Option<&Shape>, sample: &Sample) -> DVec3 {
    in_scene_frame(first, sample).0.position()
}

/// Returns the largest footprint radius of the bodies, m.
fn plates_m(shapes: &[Shape], height_m: f64) -> f64 {
    shapes.iter().map(|shape| footprint_m(shape.rest())).fold(0.25 * height_m, f64::max)
}

/// Returns the axes of the device frame in the frame of the scene.
fn axes(first: Option<&Shape>) -> [DVec3; 3] {
    let turn = first.map(|shape| shape.mapping().rotation());
    [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn.map_or(axis, |turn| turn * axis))
}

/// Returns the footprint radius of a body, m.
fn footprint_m(rest: &Rest) -> f64 {
    match rest {
        Rest::Slender(body) => plate_radius_m(body),
        Rest::Solid(extent) => 0.7 * extent.beside_m,
    }
}

fn plate_radius_m(body: &Body) -> f64 {
    PLATE_OVERHANG * body.info.plate_radius_m
}

/// Returns whether the lower plate of a body is off its seat: no point of the rim reaches down to the seat.
fn is_lifted(body: &Body, curve: &Curve) -> bool {
    /// Smallest visible distance, in radii.
    const LEAST: f64 = 0.02;
    let radius_m = body.info.plate_radius_m;
    let (now, rest) = (curve.section(0.0), body.rest.section(0.0));
    let up = rest.orientation * DVec3::Z;
    let tilt = (now.orientation * DVec3::Z).dot(up).clamp(-1.0, 1.0);
    let lowest_m = (now.center_m - rest.center_m).dot(up) - radius_m * (1.0 - tilt * tilt).sqrt();
    radius_m > 0.0 && lowest_m > LEAST * radius_m
}

/// Adds a body with its plates; returns the largest strain as a fraction of the scale.
fn body_of(
    mesh: &mut Mesh,
    body: &Body,
    (curve, strain): (&Curve, &Strain),
    palette: &Palette,
    pixels_per_mm: f64,
    touching: &mut bool,
) -> f64 {
    let contact = contact_strain(body);
    let full = contact.map_or(FULL_STRAIN, f64::abs);
    let mut peak = 0.0_f64;
    let touches = |strain: LocalStrain| contact.is_some_and(|contact| strain.axial <= contact);
    for i in 0..=SCALE_PROBES {
        let s = f64::from(i) / f64::from(SCALE_PROBES);
        let local = strain.at(s, flotor_hal::glam::DVec2::ZERO);
        peak = peak.max(local.magnitude() / full);
        *touching |= touches(local);
    }
    let color = |strain: LocalStrain| {
        if touches(strain) { palette.contact } else { strain_color(strain.magnitude() / full) }
    };
    append_tube(mesh, body, curve, strain, Detail::for_size(body, pixels_per_mm), color);
    let radius_m = plate_radius_m(body);
    if radius_m > 0.0 {
        let ends: [(&Curve, f64, f64); 2] = [(curve, 1.0, 1.0), (curve, 0.0, -1.0)];
        for ((curve, s, outward), color) in ends.into_iter().zip(palette.plates) {
            plate(mesh, &curve.section(s), radius_m, PLATE_THICKNESS * radius_m, outward, color);
        }
    }
    peak
}

/// Number of intervals along a body at which the strain is evaluated for the legend.
const SCALE_PROBES: i32 = 32;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::Look;
    use flotor_core::trace::{RECORD_WORDS, TickRecord};
    use flotor_sync::Words;

    fn sample(force_n: DVec3) -> Sample {
        let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
        (record.pose, record.commanded.force_n) = (Pose::HOME, force_n.to_array());
        Sample::from(&record)
    }

    fn build(builder: &mut SceneBuilder, sample: &Sample, shows_arrows: bool) -> Mesh {
        let (palette, camera) = (Palette::of(Look::Dark), Camera::experimenter(SceneBuilder::height_mm(&[])));
        let scale = ArrowScale::default().with(sample);
        builder
            .build(&mut [], Moment::of(&[*sample]), &palette, &camera, 400.0, scale, shows_arrows)
            .0
            .clone()
    }

    #[test]
    fn the_largest_force_on_a_handle_at_rest_is_in_sight() {
        let camera = Camera::experimenter(SceneBuilder::height_mm(&[]));
        for force_n in [DVec3::Z, DVec3::X, -DVec3::Z, DVec3::new(1.0, 1.0, 1.0)] {
            let mut builder = SceneBuilder::default();
            let mesh = build(&mut builder, &sample(30.0 * force_n), true);
            for vertex in &mesh.vertices[builder.bare[0]..] {
                let place = DVec3::from_array(vertex.position_mm.map(f64::from)).extend(1.0);
                let clip = camera.projection(2.0) * place;
                let [x, y] = [clip.x / clip.w, clip.y / clip.w];
                assert!(x.abs() < 0.98 && y.abs() < 0.98, "{force_n}: {x}, {y}");
            }
        }
    }

    /// A plate that rolls on its rim or slides stands on its seat; one that hangs above it is lifted.
    #[test]
    fn a_plate_off_its_seat_is_lifted() {
        use flotor_hal::extension::centerline::CenterlineInfo;
        use flotor_hal::glam::DQuat;
        let radius_m = 0.004;
        let sections = |base_m: DVec3, tilt_rad: f64| {
            let turn = DQuat::from_rotation_y(tilt_rad);
            let section = |i: u8| Pose::new(base_m + turn * DVec3::Z * (0.001 * f64::from(i)), turn);
            (0..25).map(section).collect::<Vec<_>>()
        };
        let seat_m = DVec3::new(0.0, 0.0, -0.025);
        let info = CenterlineInfo::coil(0.0003, 0.003, 12.0, radius_m);
        let body = Body::new(info, &sections(seat_m, 0.0)).expect("a spring");
        let is_lifted = |base_m: DVec3, tilt_rad: f64| {
            is_lifted(&body, &Curve::through(&sections(base_m, tilt_rad)).expect("a curve"))
        };
        let on_rim = seat_m + DVec3::Z * radius_m * 0.3_f64.sin();
        assert!(!is_lifted(seat_m, 0.0) && !is_lifted(on_rim, 0.3) && !is_lifted(on_rim, -0.3));
        assert!(!is_lifted(seat_m + DVec3::X * 0.01, 0.0), "it slid");
        assert!(is_lifted(seat_m + DVec3::Z * 0.001, 0.0) && is_lifted(on_rim + DVec3::Z * 0.001, 0.3));
        let free_end = CenterlineInfo::coil(0.0003, 0.003, 12.0, 0.0);
        let tube = Body::new(free_end, &sections(seat_m, 0.0)).expect("a tube");
        let above = Curve::through(&sections(DVec3::ZERO, 0.0)).expect("a curve");
        assert!(!super::is_lifted(&tube, &above), "without a plate there is no seat");
    }

    /// A builder that has made pictures before makes the same one as a new builder.
    #[test]
    fn the_ground_is_kept_and_what_stands_on_it_is_not() {
        let mut used = SceneBuilder::default();
        for (force_n, arrows) in [(DVec3::X, true), (DVec3::Z, true), (DVec3::Z, false), (-DVec3::Z, true)] {
            let again = build(&mut used, &sample(force_n), arrows);
            let new = build(&mut SceneBuilder::default(), &sample(force_n), arrows);
            assert_eq!((again.vertices, again.indices), (new.vertices, new.indices));
        }
    }
}
