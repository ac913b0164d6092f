//! Lights (KHR_lights_punctual) and cameras, each in a node of its own that looks along -Z.

use super::{Writer, number, numbers, scaled};
use glam::{DMat3, DQuat, DVec3};
use kiln_proto::{
    scene::{Camera, Falloff, Lens, Light, LightShape, SpotProfile},
    units::Rgb,
};
use serde_json::{Map, Value, json};
use std::f32::consts::{FRAC_PI_2, PI};

/// The inner angle of a cone must be less than the outer one (KHR_lights_punctual): this share of it is near enough.
const INNER: f32 = 0.99;
/// The least angle that a cone is given, radians.
const NARROWEST: f32 = 1e-3;
/// What a perspective camera shows begins at this share of the scene's diagonal, which glTF wants and a bake does not know.
const NEAR: f32 = 1e-4;

impl Writer<'_> {
    /// The lights, each with a node.
    pub(super) fn lights(&mut self) -> Vec<Value> {
        let scene = self.scene;
        let mut list = vec![];
        for light in &scene.lights {
            self.note_light(light);
            let mut node = placed(&light.name, eye_of(light), direction_of(light), light.projection.up);
            node["extensions"] = json!({"KHR_lights_punctual": {"light": list.len()}});
            self.nodes.push(node);
            self.extensions.insert("KHR_lights_punctual");
            list.push(self.lamp(light));
        }
        list
    }

    fn lamp(&mut self, light: &Light) -> Value {
        let (color, intensity) = colored(light.intensity);
        let mut lamp = json!({"name": light.name, "color": numbers(&color), "intensity": number(intensity)});
        match light.shape {
            LightShape::Point { .. } => lamp["type"] = json!("point"),
            LightShape::Directional { .. } => lamp["type"] = json!("directional"),
            LightShape::Spot { cut_off, beam_width, profile, .. } => {
                if profile == SpotProfile::Linear {
                    self.notes.count("spot lights that fade linearly with the angle fade with its cosine in glTF", &light.name);
                }
                if cut_off > FRAC_PI_2 {
                    self.notes.count("spot lights wider than a half space were narrowed to one, the widest that glTF has", &light.name);
                }
                if beam_width > cut_off * INNER {
                    self.notes.count("spot lights without a soft edge, which glTF forbids, were given a narrow one", &light.name);
                }
                let outer = cut_off.clamp(NARROWEST, FRAC_PI_2);
                lamp["type"] = json!("spot");
                lamp["spot"] = json!({"innerConeAngle": number(beam_width.min(outer * INNER)), "outerConeAngle": number(outer)});
            }
        }
        let range = match light.falloff {
            _ if matches!(light.shape, LightShape::Directional { .. }) => None,
            Falloff::InverseSquare { range } => range,
            Falloff::Polynomial { radius, .. } => {
                self.notes.count("lights whose falloff is X3D's fall off by the inverse square within their radius in glTF", &light.name);
                Some(radius).filter(|r| *r > 0.0 && r.is_finite())
            }
        };
        if let Some(range) = range {
            lamp["range"] = number(range);
        }
        lamp
    }

    fn note_light(&mut self, light: &Light) {
        if !light.ambient.is_black() {
            self.notes.count("ambient terms of lights, which glTF does not have, were left out", &light.name);
        }
        if light.texture.is_some() {
            self.notes.count("textures that colour a light, which glTF does not have, were left out", &light.name);
        }
        if light.shadow_map.is_some() {
            self.notes.count("shadow maps of lights, which glTF has no place for, were left out", &light.name);
        }
    }

    /// The cameras, each with a node.
    pub(super) fn cameras(&mut self) -> Vec<Value> {
        let scene = self.scene;
        let (low, high) = scene.bounds();
        let size = (glam::Vec3::from_array(high) - glam::Vec3::from_array(low)).length().max(f32::MIN_POSITIVE);
        let mut list = vec![];
        for camera in &scene.cameras {
            let mut node = placed(&camera.name, Some(camera.eye), camera.forward, camera.up);
            node["camera"] = json!(list.len());
            self.nodes.push(node);
            list.push(self.camera(camera, size, low, high));
        }
        list
    }

    fn camera(&mut self, camera: &Camera, size: f32, low: [f32; 3], high: [f32; 3]) -> Value {
        let mut json = Map::new();
        json.insert("name".into(), json!(camera.name));
        match camera.lens {
            Lens::Perspective { fov, of_smaller } => {
                if of_smaller {
                    self.notes
                        .count("cameras whose field of view is that of the smaller side have it along the vertical in glTF", &camera.name);
                }
                json.insert("type".into(), json!("perspective"));
                let yfov = fov.clamp(NARROWEST, PI - NARROWEST);
                json.insert("perspective".into(), json!({"yfov": number(yfov), "znear": number((size * NEAR).max(f32::MIN_POSITIVE))}));
            }
            Lens::Orthographic { half_height } => {
                let center = (glam::Vec3::from_array(low) + glam::Vec3::from_array(high)) * 0.5;
                let far = (center - glam::Vec3::from_array(camera.eye)).length() + size;
                let half = half_height.max(f32::MIN_POSITIVE);
                json.insert("type".into(), json!("orthographic"));
                let lens = json!({"xmag": number(half), "ymag": number(half), "znear": 0, "zfar": number(far)});
                json.insert("orthographic".into(), lens);
            }
        }
        Value::Object(json)
    }
}

fn eye_of(light: &Light) -> Option<[f32; 3]> {
    match light.shape {
        LightShape::Point { position } | LightShape::Spot { position, .. } => Some(position),
        LightShape::Directional { .. } => None,
    }
}

fn direction_of(light: &Light) -> [f32; 3] {
    match light.shape {
        LightShape::Point { .. } => [0.0, 0.0, -1.0],
        LightShape::Spot { direction, .. } | LightShape::Directional { direction } => direction,
    }
}

/// A colour of at most one and a factor, whose product is the intensity.
fn colored(intensity: Rgb) -> ([f32; 3], f32) {
    let largest = intensity.max_channel();
    if largest <= 0.0 {
        return ([1.0; 3], 0.0);
    }
    if intensity == Rgb::splat(largest) {
        return ([1.0; 3], largest);
    }
    let scale = scaled(largest);
    ((intensity * (1.0 / scale)).to_array(), scale)
}

/// A node at `eye` that looks along `forward`.
fn placed(name: &str, eye: Option<[f32; 3]>, forward: [f32; 3], up: [f32; 3]) -> Value {
    let vector = |v: [f32; 3]| glam::Vec3::from_array(v).as_dvec3();
    let back = (-vector(forward)).try_normalize().unwrap_or(DVec3::Z);
    let sides = [vector(up), DVec3::Y, DVec3::X].into_iter().find_map(|up| up.cross(back).try_normalize());
    let side = sides.unwrap_or(DVec3::X);
    let rotation = DQuat::from_mat3(&DMat3::from_cols(side, back.cross(side), back)).normalize();
    let mut node = json!({"name": name});
    if let Some(eye) = eye.filter(|e| *e != [0.0; 3]) {
        node["translation"] = numbers(&eye);
    }
    if rotation != DQuat::IDENTITY {
        node["rotation"] = numbers(&rotation.as_quat().to_array());
    }
    node
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Where a light shines.
    pub(in super::super) fn direction(light: &Light) -> DVec3 {
        glam::Vec3::from_array(direction_of(light)).as_dvec3()
    }

    #[test]
    fn a_node_turns_minus_z_to_its_direction_and_y_near_up() {
        for (forward, up) in [([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]), ([0.0, -1.0, 0.0], [0.0; 3]), ([0.6, 0.0, -0.8], [0.0, 1.0, 0.0])] {
            let node = placed("n", None, forward, up);
            let q: Vec<f64> = node["rotation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            let turned = DQuat::from_xyzw(q[0], q[1], q[2], q[3]).mul_vec3(DVec3::NEG_Z);
            assert!((turned - glam::Vec3::from_array(forward).as_dvec3()).length() < 1e-6, "{forward:?}: {turned}");
        }
        assert_eq!(placed("n", Some([0.0; 3]), [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]), json!({"name": "n"}));
    }

    #[test]
    fn colours_and_factors_multiply_back_exactly() {
        for intensity in [Rgb::new(3.0, 0.1, 0.7), Rgb::new(0.2, 0.1, 0.0), Rgb::splat(5.1), Rgb::BLACK] {
            let (color, factor) = colored(intensity);
            assert_eq!(Rgb::from(color) * factor, intensity);
            assert!(color.iter().all(|c| (0.0..=1.0).contains(c)));
        }
    }
}
