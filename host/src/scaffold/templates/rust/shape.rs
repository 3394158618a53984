//! Appearance in the viewer: the floor, and the ball in the hand.

use super::YourName;
use flotor_hal::{DQuat, DVec3, Form, Input, Part, Pose, Primitive, Shape, ShapeModel};

impl ShapeModel for YourName {
    fn shape(&mut self, input: &Input) -> &Shape {
        let [_, height_mm, _] = self.values;
        let floor = Pose::new(DVec3::Z * height_mm * 1e-3, DQuat::IDENTITY);
        self.shape.primitives = vec![
            Primitive::new(Form::Plane, Part::Body, floor, [0.02, 0.02, 0.0]),
            Primitive::sphere(Part::Tool, input.pose, 0.001),
        ];
        &self.shape
    }
}
