//! Scenes whose author had another axis point up: they are turned once, when they are read, so that +Y is up in every canonical scene.
//!
//! glTF and X3D say that +Y is up, OBJ says nothing, and authors keep to neither. An axis kept beside the scene would have to be minded by
//! the view of the page, by pictures and by the environment, which stands upright about +Y; and none of them would fail where it was
//! forgotten.

use glam::{DMat3, Vec3};
use kiln_proto::{
    options::UpAxis,
    scene::{LightShape, Scene},
};

/// Turns everything in a scene so that `up` becomes +Y. Exact: coordinates change places and signs. Not the environment: one that the
/// options name is upright as it is, and one of the file has been turned by [`matrix`] when its map was made.
pub(super) fn turn(scene: &mut Scene, up: UpAxis) {
    if up == UpAxis::Y {
        return;
    }
    let turn = |v: &mut [f32; 3]| *v = turned(*v, up);
    scene.positions.iter_mut().chain(&mut scene.normals).for_each(turn);
    for tangent in &mut scene.tangents {
        let [x, y, z] = turned([tangent[0], tangent[1], tangent[2]], up);
        *tangent = [x, y, z, tangent[3]];
    }
    for light in &mut scene.lights {
        match &mut light.shape {
            LightShape::Point { position } => turn(position),
            LightShape::Spot { position, direction, .. } => [position, direction].into_iter().for_each(turn),
            LightShape::Directional { direction } => turn(direction),
        }
        [&mut light.projection.up, &mut light.projection.location].into_iter().for_each(turn);
    }
    for row in scene.projectors.iter_mut().flat_map(|p| &mut p.matrix) {
        // A row times a turned position is the turned row times that position.
        let [x, y, z] = turned([row[0], row[1], row[2]], up);
        *row = [x, y, z, row[3]];
    }
    for camera in &mut scene.cameras {
        [&mut camera.eye, &mut camera.forward, &mut camera.up].into_iter().for_each(turn);
    }
}

/// The same turn as a matrix.
pub(super) fn matrix(up: UpAxis) -> DMat3 {
    let column = |axis| Vec3::from(turned(axis, up)).as_dvec3();
    DMat3::from_cols(column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0]))
}

/// The rotation that carries an axis to +Y: about Z from X, about X from Z.
fn turned([x, y, z]: [f32; 3], up: UpAxis) -> [f32; 3] {
    // 0 - v has no sign at zero.
    match up {
        UpAxis::X => [0.0 - y, x, z],
        UpAxis::Y => [x, y, z],
        UpAxis::Z => [x, z, 0.0 - y],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::{
        scene::{Camera, Lens, Light, Projector},
        units::Rgb,
    };

    const AXES: [(UpAxis, [f32; 3]); 3] = [(UpAxis::X, [1.0, 0.0, 0.0]), (UpAxis::Y, [0.0, 1.0, 0.0]), (UpAxis::Z, [0.0, 0.0, 1.0])];

    #[test]
    fn the_axis_points_up_and_nothing_is_mirrored() {
        for (up, axis) in AXES {
            assert_eq!(turned(axis, up), [0.0, 1.0, 0.0]);
            let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|v| Vec3::from(turned(v, up)));
            assert_eq!(a.cross(b), c, "{up}");
        }
    }

    #[test]
    fn lights_projectors_and_cameras_turn_with_the_scene() {
        let (p, d) = ([1.0, 2.0, 3.0], [0.0, 0.6, -0.8]);
        let spot =
            LightShape::Spot { position: p, direction: d, cut_off: 1.0, beam_width: 0.5, profile: kiln_proto::scene::SpotProfile::Linear };
        let mut spot = Light::new("spot", spot, Rgb::WHITE);
        (spot.projection.up, spot.projection.location) = ([1.0, 0.0, 0.0], p);
        let sun = Light::new("sun", LightShape::Directional { direction: d }, Rgb::WHITE);
        let bulb = Light::new("bulb", LightShape::Point { position: p }, Rgb::WHITE);
        let matrix = [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0], [0.5, 0.25, -1.0, 2.0]];
        let lens = Lens::Orthographic { half_height: 1.0 };
        let before = Scene {
            positions: vec![p],
            normals: vec![d],
            tangents: vec![[0.0, 0.8, 0.6, -1.0]],
            lights: vec![spot, sun, bulb],
            projectors: vec![Projector { name: "p".into(), light: None, matrix }],
            cameras: vec![Camera { name: "c".into(), eye: p, forward: d, up: [1.0, 0.0, 0.0], lens }],
            ..Scene::empty()
        };
        for (up, _) in AXES {
            let mut scene = before.clone();
            turn(&mut scene, up);
            let [tp, td, tx] = [p, d, [1.0, 0.0, 0.0]].map(|v| turned(v, up));
            assert_eq!((scene.positions[0], scene.normals[0]), (tp, td));
            let [x, y, z] = turned([0.0, 0.8, 0.6], up);
            assert_eq!(scene.tangents, [[x, y, z, -1.0]]);
            assert_eq!((super::matrix(up) * Vec3::from(p).as_dvec3()).as_vec3().to_array(), tp);
            assert!(matches!(scene.lights[0].shape, LightShape::Spot { position, direction, .. } if (position, direction) == (tp, td)));
            assert_eq!((scene.lights[0].projection.up, scene.lights[0].projection.location), (tx, tp));
            assert_eq!(scene.lights[1].shape, LightShape::Directional { direction: td });
            assert_eq!(scene.lights[2].shape, LightShape::Point { position: tp });
            let (c, row) = (&scene.cameras[0], scene.projectors[0].matrix[3]);
            assert_eq!((c.eye, c.forward, c.up), (tp, td, tx));
            // What a projector finds at a point stays what it was.
            let dot = |row: [f32; 4], v: [f32; 3]| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3];
            assert_eq!(dot(row, tp), dot(matrix[3], p));
        }
    }
}
