/**
 * Lights for the draft, while nothing is baked: emissive triangles as points, split until all points are in use, and the scene's own
 * lights. Of more than the shader takes, the strongest are chosen, by the irradiance that they would give at the middle of the scene.
 * Nothing has shadows or bounces; it is there to see what the scene is, within a frame.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import type { Falloff, Light } from '../format/light.ts';
import { meanEmission } from '../field/draft.ts';
import { cross, length, scale, sub } from '../field/frame.ts';
import { trianglePositions } from '../field/geometry.ts';
import { DRAFT_LIGHTS, type SharedUniforms } from './material.ts';

export interface Lamp {
  corners: [Vec3, Vec3, Vec3];
  emission: Vec3;
  area: number;
}

/** What is lit: irradiances are judged at its centre, of what is nearer than half its radius as if it were that far. */
export interface Lit {
  centre: Vec3;
  radius: number;
}

const NOWHERE: Vec3 = [0, 0, 0];
/** What `lf_draft.glsl` takes for it. */
const INVERSE_SQUARE: Vec3 = [-1, 0, 0];

const sum = ([r, g, b]: Vec3): number => r + g + b;
const power = (lamp: Lamp): number => lamp.area * sum(lamp.emission);
const middle = ([a, b, c]: [Vec3, Vec3, Vec3]): Vec3 => [(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3];

/** Lights and lamps, at most `count`: the strongest of both, and lamps halved along their longest edge while there are points left. */
export function draftLights(container: Container, count: number, lit: Lit): { lights: Light[]; lamps: Lamp[] } {
  const ranked = [...container.scene.lights, ...emitters(container)].map((it) => ({
    it, strength: 'corners' in it ? lampIrradiance(it, lit) : sum(lightIrradiance(it, lit)),
  }));
  const chosen = ranked.filter(({ strength }) => strength > 0).sort((a, b) => b.strength - a.strength).slice(0, count).map(({ it }) => it);
  const lights = chosen.filter((it) => 'shape' in it);
  return { lights, lamps: split(chosen.filter((it) => 'corners' in it), count - lights.length) };
}

function emitters({ scene }: Container): Lamp[] {
  return scene.surfaces.flatMap((surface) => {
    let from = 0;
    return surface.parts.flatMap(({ material, end }) => {
      const [first, count] = [from, end - from];
      from = end;
      const emission = meanEmission(scene, scene.materials[material]);
      if (Math.max(...emission) <= 0) return [];
      return Array.from({ length: count }, (_, t): Lamp => {
        const corners = trianglePositions(scene.positions, surface.corners, first + t);
        return { corners, emission, area: length(normalOf(corners)) };
      });
    });
  });
}

/** Halves the most powerful lamp until there are `count`. */
function split(chosen: Lamp[], count: number): Lamp[] {
  while (chosen.length > 0 && chosen.length < count) {
    const most = chosen.reduce((best, lamp, i) => (power(lamp) > power(chosen[best]) ? i : best), 0);
    chosen.splice(most, 1, ...halve(chosen[most]));
  }
  return chosen;
}

/** Half the cross product: its length is the area. */
const normalOf = ([a, b, c]: [Vec3, Vec3, Vec3]): Vec3 => scale(cross(sub(b, a), sub(c, a)), 0.5);

function halve(lamp: Lamp): [Lamp, Lamp] {
  const edge = [0, 1, 2].reduce((best, k) => (edgeLength(lamp, k) > edgeLength(lamp, best) ? k : best), 0);
  const [a, b, c] = [0, 1, 2].map((k) => lamp.corners[(edge + k) % 3]);
  const between: Vec3 = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2];
  const part = (corners: [Vec3, Vec3, Vec3]): Lamp => ({ corners, emission: lamp.emission, area: lamp.area / 2 });
  return [part([a, between, c]), part([between, b, c])];
}

const edgeLength = (lamp: Lamp, k: number): number => length(sub(lamp.corners[(k + 1) % 3], lamp.corners[k]));

const distanceTo = (from: Vec3, { centre, radius }: Lit): number => Math.max(length(sub(from, centre)), radius / 2);

const lampIrradiance = (lamp: Lamp, lit: Lit): number => power(lamp) / distanceTo(middle(lamp.corners), lit) ** 2;

/** As if it pointed at the centre, W/m². */
export function lightIrradiance({ shape, intensity, falloff }: Light, lit: Lit): Vec3 {
  return shape.kind === 'directional' ? intensity : scale(intensity, weakened(falloff, distanceTo(shape.position, lit)));
}

function weakened(falloff: Falloff, d: number): number {
  if (falloff.kind === 'polynomial') {
    const [a, b, c] = falloff.attenuation;
    return d <= falloff.radius ? 1 / Math.max(a + d * (b + d * c), 1) : 0;
  }
  return Math.min(1, Math.max(0, falloff.range === null ? 1 : 1 - (d / falloff.range) ** 4)) / (d * d);
}

/**
 * Sets the draft's lights; returns a guess of the exposure for when the job's own is not known: a white surface at mean light is mid-grey.
 */
export function setLights(uniforms: SharedUniforms, container: Container, lit: Lit): number {
  const { lights, lamps } = draftLights(container, DRAFT_LIGHTS, lit);
  const ambient = container.scene.environment?.mean ?? NOWHERE;
  uniforms.lfLightCount.value = lights.length + lamps.length;
  uniforms.lfAmbient.value.set(...ambient);
  lights.forEach((light, i) => setLight(uniforms, i, light));
  lamps.forEach((lamp, k) => setLamp(uniforms, lights.length + k, lamp));
  const direct = lights.reduce((all, light) => all + sum(lightIrradiance(light, lit)), 0) + lamps.reduce((all, lamp) => all + power(lamp), 0) / lit.radius ** 2;
  const irradiance = direct / 3 + (Math.PI * sum(ambient)) / 3;
  return irradiance > 0 ? (0.5 * Math.PI) / irradiance : 1;
}

function setLamp(uniforms: SharedUniforms, i: number, { corners, emission, area }: Lamp): void {
  const normal = normalOf(corners);
  uniforms.lfLightPlace.value[i].set(...middle(corners), 0);
  uniforms.lfLightAxis.value[i].set(...scale(normal, 1 / (length(normal) || 1)), 0);
  uniforms.lfLightPower.value[i].set(...scale(emission, area), 0);
  uniforms.lfLightFall.value[i].set(...INVERSE_SQUARE);
}

function setLight(uniforms: SharedUniforms, i: number, { shape, intensity, falloff }: Light): void {
  const cone = shape.kind === 'spot' ? shape.cone : null;
  const [place, axis] = [shape.kind === 'directional' ? NOWHERE : shape.position, shape.kind === 'point' ? NOWHERE : shape.direction];
  const fade = cone ? (cone.profile === 'linear' ? 1 : 2) : 0;
  uniforms.lfLightPlace.value[i].set(...place, shape.kind === 'directional' ? 2 : 1);
  uniforms.lfLightAxis.value[i].set(...axis, fade);
  uniforms.lfLightPower.value[i].set(...intensity, falloff.kind === 'polynomial' ? falloff.radius : (falloff.range ?? 0));
  uniforms.lfLightFall.value[i].set(...(falloff.kind === 'polynomial' ? falloff.attenuation : INVERSE_SQUARE));
  uniforms.lfLightCone.value[i].set(cone?.beamWidth ?? 0, cone?.cutOff ?? 0);
}
