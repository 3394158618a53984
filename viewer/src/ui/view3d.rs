//! 3D view and its handling: orbit, zoom, incline, reset.

use crate::canvas::Canvas;
use crate::palette::{Look, Palette};
use crate::scene::{ArrowScale, Moment, SceneBuilder, SceneFacts};
use crate::shape::Shape;
use crate::ui::key::pressed_alone;
use egui::{Color32, Key, PointerButton, Rect, Role, Sense, TextureId, Ui, Vec2, WidgetInfo, pos2};
use flotor_drawing::camera::{Camera, Extent};
use flotor_drawing::raster::View;
use flotor_hal::Pose;

/// Rotation per point of a drag, rad.
const ORBIT_RAD_PER_POINT: f64 = 0.008;
const INCLINE_RAD_PER_POINT: f64 = 0.006;
/// Rotation per press of a key, rad.
const ORBIT_RAD_PER_KEY: f64 = 0.12;
const INCLINE_RAD_PER_KEY: f64 = 0.08;
/// Zoom factor per press of a key, and per point of the wheel.
const ZOOM_PER_KEY: f64 = 1.12;
const ZOOM_PER_POINT: f64 = 1.003;

/// Content of the view.
pub struct Subject<'a> {
    /// Bodies of the models.
    pub shapes: &'a mut [Shape],
    /// Version of the bodies, incremented on every change other than a change of pose.
    pub version: u64,
    /// Samples at the displayed time.
    pub moment: Moment<'a>,
    /// Scale of the arrows.
    pub scale: ArrowScale,
}

/// 3D view: camera, buffers, and the last frame.
pub struct View3d {
    /// Camera of the view.
    pub camera: Camera,
    /// Extent of the bodies at the last reset: the camera does not move when a body grows.
    extent: Extent,
    /// Aspect ratio of the view, width over height.
    aspect: f64,
    /// True to draw arrows of force and torque.
    pub shows_arrows: bool,
    canvas: Canvas,
    builder: SceneBuilder,
    drawn: Option<(Look3d, TextureId, SceneFacts)>,
}

/// All inputs of a frame, compared to reuse the last frame.
#[derive(Clone, Debug, PartialEq)]
struct Look3d {
    handles: Vec<(Pose, [f32; 6])>,
    compared: Vec<Option<Pose>>,
    version: u64,
    camera: Camera,
    shows_arrows: bool,
    size: [usize; 2],
    look: Look,
    scale: ArrowScale,
}

impl View3d {
    /// Creates the default view of bodies of this extent.
    #[must_use]
    pub fn new(canvas: Canvas, extent: Extent) -> Self {
        const ASPECT: f64 = 2.0;
        Self {
            camera: Camera::fitting(extent, ASPECT),
            extent,
            aspect: ASPECT,
            shows_arrows: true,
            canvas,
            builder: SceneBuilder::default(),
            drawn: None,
        }
    }

    /// Returns to the default view of bodies of this extent.
    pub fn reset(&mut self, extent: Extent) {
        self.extent = extent;
        self.camera = self.first();
    }

    /// Returns whether the camera has moved from the default view.
    #[must_use]
    pub fn is_turned(&self) -> bool {
        self.camera != self.first()
    }

    /// Returns the default camera for the current aspect ratio.
    fn first(&self) -> Camera {
        Camera::fitting(self.extent, self.aspect)
    }

    /// Updates the aspect ratio, and a camera that is in the default view.
    fn fit(&mut self, area: Rect) {
        let is_turned = self.is_turned();
        self.aspect = f64::from(area.width() / area.height().max(1.0));
        if !is_turned {
            self.camera = self.first();
        }
    }

    /// Returns the total number of vertices built; constant while the view is unchanged.
    #[must_use]
    pub fn corners_made(&self) -> u64 {
        self.builder.corners_made()
    }

    /// Shows the scene in a rectangle, handles the mouse, and returns the properties of the scene.
    pub fn show(&mut self, ui: &mut Ui, area: Rect, look: Look, subject: Subject<'_>) -> SceneFacts {
        let extent = SceneBuilder::extent(subject.shapes, subject.moment.samples.len());
        self.fit(area);
        let response = ui.interact(area, ui.scope_id().with("3d view"), Sense::click_and_drag());
        if response.dragged_by(PointerButton::Primary) {
            let moved = response.drag_delta();
            self.camera
                .orbit(-f64::from(moved.x) * ORBIT_RAD_PER_POINT, f64::from(moved.y) * INCLINE_RAD_PER_POINT);
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.camera.zoom(ZOOM_PER_POINT.powf(f64::from(scroll)) * f64::from(pinch), extent.height_mm);
        }
        if response.double_clicked() {
            self.reset(extent);
        }
        let (texture, facts) = self.picture(ui, area.size(), look, subject);
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture, area, whole, Color32::WHITE);
        response.widget_info(|| {
            WidgetInfo::labeled(Role::Image, true, "3D view; drag turns it, the wheel zooms")
        });
        facts
    }

    /// Handles the keys that turn and zoom: W A S D, plus, minus, and R for the default view.
    pub fn keys(&mut self, ui: &Ui, extent: Extent) {
        ui.input(|input| {
            let pressed = |key: Key| f64::from(u8::from(pressed_alone(input, key)));
            let turn = pressed(Key::D) - pressed(Key::A);
            let incline = pressed(Key::W) - pressed(Key::S);
            let nearer = pressed(Key::Plus) + pressed(Key::Equals) - pressed(Key::Minus);
            if turn != 0.0 || incline != 0.0 {
                self.camera.orbit(turn * ORBIT_RAD_PER_KEY, incline * INCLINE_RAD_PER_KEY);
            }
            if nearer != 0.0 {
                self.camera.zoom(ZOOM_PER_KEY.powf(nearer), extent.height_mm);
            }
            if pressed_alone(input, Key::R) {
                self.reset(extent);
            }
        });
    }

    fn picture(&mut self, ui: &Ui, size: Vec2, look: Look, subject: Subject<'_>) -> (TextureId, SceneFacts) {
        let Subject { shapes, version, moment, scale } = subject;
        let (camera, shows_arrows) = (self.camera, self.shows_arrows);
        let size = pixels(size * ui.ctx().pixels_per_point());
        let wanted = Look3d {
            handles: moment.samples.iter().map(|sample| (sample.pose, sample.commanded)).collect(),
            compared: moment.compared.to_vec(),
            version,
            camera,
            shows_arrows,
            size,
            look,
            scale,
        };
        match &self.drawn {
            Some((drawn, texture, facts)) if *drawn == wanted => (*texture, *facts),
            _ => {
                let palette = Palette::of(look);
                let height_px = size[1] as f64;
                let (mesh, facts) =
                    self.builder.build(shapes, moment, &palette, &camera, height_px, scale, shows_arrows);
                let view = View { camera: &camera, backdrop: palette.backdrop, size };
                let texture = self.canvas.draw(ui.ctx(), mesh, &view);
                self.drawn = Some((wanted, texture, facts));
                (texture, facts)
            }
        }
    }
}

/// Rounds a size to whole pixels, at least one.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
pub fn pixels(size: Vec2) -> [usize; 2] {
    [size.x, size.y].map(|length| length.round().max(1.0) as usize)
}
