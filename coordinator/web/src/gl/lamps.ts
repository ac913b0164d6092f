/**
 * Points that stand for the lamps while nothing is baked: emissive triangles, the most powerful first, each split until all points are in use. Their
 * light has no shadows and no bounces; it is there to see what the scene is, within a frame.
 */

import type { Container, Vec3 } from '../format/container.ts';
import { cross, length, scale, sub } from '../field/frame.ts';
import { trianglePositions } from '../field/geometry.ts';
import { DRAFT_LIGHTS, type SharedUniforms } from './material.ts';

export interface Lamp {
  corners: [Vec3, Vec3, Vec3];
  emission: Vec3;
  area: number;
}

const power = (lamp: Lamp): number => lamp.area * (lamp.emission[0] + lamp.emission[1] + lamp.emission[2]);

/** At most `count` lamps: those of most power, halved along their longest edge while there are points left. */
export function lamps({ scene }: Container, count: number): Lamp[] {
  const found = scene.surfaces.flatMap((surface) => {
    const { emission } = scene.materials[surface.material];
    if (Math.max(...emission) <= 0) return [];
    return Array.from({ length: surface.corners.length / 3 }, (_, t): Lamp => {
      const corners = trianglePositions(scene.positions, surface.corners, t);
      return { corners, emission, area: length(normalOf(corners)) };
    });
  });
  const chosen = found.sort((a, b) => power(b) - power(a)).slice(0, count);
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
  const middle: Vec3 = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2];
  const part = (corners: [Vec3, Vec3, Vec3]): Lamp => ({ corners, emission: lamp.emission, area: lamp.area / 2 });
  return [part([a, middle, c]), part([middle, b, c])];
}

const edgeLength = (lamp: Lamp, k: number): number => length(sub(lamp.corners[(k + 1) % 3], lamp.corners[k]));

/** Sets the draft's lamps; returns a guess of the exposure for when the job's own is not known: a white surface at mean light is mid-grey. */
export function setLamps(uniforms: SharedUniforms, container: Container, sceneRadius: number): number {
  const points = lamps(container, DRAFT_LIGHTS);
  uniforms.lfLightCount.value = points.length;
  points.forEach((lamp, i) => {
    const [a, b, c] = lamp.corners;
    uniforms.lfLightPosition.value[i].set((a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3);
    uniforms.lfLightNormal.value[i].set(...normalOf(lamp.corners)).normalize();
    uniforms.lfLightPower.value[i].set(...scale(lamp.emission, lamp.area));
  });
  const total = points.reduce((sum, lamp) => sum + power(lamp) / 3, 0);
  return total > 0 ? (0.5 * Math.PI * sceneRadius * sceneRadius) / total : 1;
}
