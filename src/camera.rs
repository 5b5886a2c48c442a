//! An orbit camera around a bounding box: angles and zoom in, matrices and pixel sizes out. No GPU, no DOM.

use glam::camera::rh::{proj::directx::perspective, view::look_at_mat4};
use glam::{Mat4, Vec3};

/// Vertical field of view, radians, from afar. Narrow, so that models look as they are.
pub const FIELD_OF_VIEW: f32 = 0.6;

/// Radius of what fills the picture at zoom 1, over that of the sphere around the box, whose corners are seldom filled.
const FILL: f32 = 0.88;

/// Least distance of the eye from the middle, over the radius of the sphere around the box: it stays outside the model. What is nearer than that is
/// made larger by a narrower field of view.
const CLOSEST: f32 = 1.2;

/// Where the eye is, relative to a model that fills the view at zoom 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Turn about the vertical axis, radians; 0 looks along -z.
    pub yaw: f32,
    /// Height above the horizon, radians, less than a right angle either way.
    pub pitch: f32,
    /// 1 fits the model; at 2 it is twice as large.
    pub zoom: f32,
    /// Width over height.
    pub aspect: f32,
}

/// What a draw call needs of the camera.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// From model units to clip space.
    pub clip_from_world: Mat4,
    /// From model units to the eye's space, which looks along -z.
    pub eye_from_world: Mat4,
    /// Tangent of half the vertical field of view.
    pub tangent: f32,
    /// Position of the eye, model units.
    pub eye: Vec3,
    /// Model units that a pixel spans at the point of the model nearest to the eye, for a picture 1 pixel high.
    pub units_per_height: f32,
}

impl Orbit {
    /// The view of a box from here. An empty box is seen as a unit cube; NaN angles as 0.
    pub fn view(&self, (low, high): ([f32; 3], [f32; 3])) -> View {
        let sane = |x: f32, or: f32| if x.is_finite() { x } else { or };
        let (yaw, pitch) = (sane(self.yaw, 0.0), sane(self.pitch, 0.0).clamp(-1.55, 1.55));
        let (zoom, aspect) = (sane(self.zoom, 1.0).clamp(0.05, 1000.0), sane(self.aspect, 1.0).clamp(0.01, 100.0));
        let (low, high) = (Vec3::from(low), Vec3::from(high));
        let center = (low + high) / 2.0;
        let radius = ((high - low).length() / 2.0).max(1e-20);
        // A sphere that most of what is in the box lies in fits the narrower of both angles.
        let half = (FIELD_OF_VIEW / 2.0).tan() * aspect.min(1.0);
        let fit = FILL * radius / half.atan().sin();
        let distance = (fit / zoom).max(CLOSEST * radius);
        let tangent = (FIELD_OF_VIEW / 2.0).tan() * fit / zoom / distance;
        let (sy, cy) = yaw.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        let eye = center + distance * Vec3::new(sy * cp, sp, cy * cp);
        let near = (distance - radius * 1.01).max(distance * 0.01).max(radius * 1e-4);
        let projection = perspective(2.0 * tangent.atan(), aspect, near, distance + radius * 1.01);
        let world = look_at_mat4(eye, center, Vec3::Y);
        let nearest = (distance - radius).max(near);
        let units_per_height = 2.0 * nearest * tangent;
        View { clip_from_world: projection * world, eye_from_world: world, tangent, eye, units_per_height }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: ([f32; 3], [f32; 3]) = ([-1.0, 0.0, 2.0], [3.0, 2.0, 3.0]);

    #[test]
    fn at_zoom_1_the_box_fills_the_picture_and_leaves_it_by_its_corners_only() {
        for i in 0..200 {
            let orbit = Orbit {
                yaw: i as f32 * 0.7,
                pitch: (i as f32 * 0.37).sin() * 1.6,
                zoom: 1.0,
                aspect: 0.3 + (i % 7) as f32 * 0.4,
            };
            let view = orbit.view(BOX);
            for corner in 0..8 {
                let pick = |k: usize| if corner >> k & 1 == 0 { BOX.0[k] } else { BOX.1[k] };
                let p = view.clip_from_world.project_point3(Vec3::new(pick(0), pick(1), pick(2)));
                assert!(
                    p.x.abs() <= 1.0 / FILL + 0.1 && p.y.abs() <= 1.0 / FILL + 0.1 && (0.0..=1.0).contains(&p.z),
                    "{orbit:?} {p}"
                );
            }
            let center = view.clip_from_world.project_point3((Vec3::from(BOX.0) + Vec3::from(BOX.1)) / 2.0);
            assert!(center.truncate().length() < 1e-4);
        }
    }

    #[test]
    fn the_eye_stays_outside_and_the_middle_is_as_large_as_asked_for() {
        let radius = Vec3::new(4.0, 2.0, 1.0).length() / 2.0;
        let center = (Vec3::from(BOX.0) + Vec3::from(BOX.1)) / 2.0;
        let size = |zoom| {
            let view = Orbit { yaw: 0.4, pitch: 0.3, zoom, aspect: 1.3 }.view(BOX);
            assert!(view.eye.distance(center) > 1.19 * radius);
            view.clip_from_world.project_point3(center + Vec3::new(0.0, 1e-3, 0.0)).y
        };
        for zoom in [1.5, 2.0, 3.0, 8.0, 40.0] {
            assert!((size(zoom) / size(1.0) / zoom - 1.0).abs() < 0.01, "{zoom}");
        }
    }

    #[test]
    fn nothing_is_nan_whatever_comes() {
        let orbit = Orbit { yaw: f32::NAN, pitch: f32::INFINITY, zoom: 0.0, aspect: f32::NAN };
        let view = orbit.view(([0.0; 3], [0.0; 3]));
        assert!(view.clip_from_world.is_finite() && view.eye.is_finite());
    }
}
