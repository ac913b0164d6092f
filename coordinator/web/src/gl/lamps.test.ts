import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import type { Light } from '../format/light.ts';
import { draftLights, setLights } from './lamps.ts';
import { sharedUniforms } from './material.ts';
import { partTable } from './parts.ts';

const LIT = { centre: [0, 0, 0] as Vec3, radius: 2 };
const light = (over: Partial<Light> = {}): Light => ({
  name: 'l', shape: { kind: 'point', position: [0, 4, 0] }, intensity: [16, 16, 16], falloff: { kind: 'inverse-square', range: null }, ...over,
});
const sun = light({ shape: { kind: 'directional', direction: [0, -1, 0] }, intensity: [3, 3, 3] });

/** A unit triangle 4 m above, of a material that emits `radiance` under a texture of mean 1/2, and the lights. */
function container(radiance: number, lights: Light[], mean: Vec3 = [0, 0, 0]): Container {
  const emissionTexture = { texture: 0 };
  const materials = [
    { colour: [0.2, 0.4, 0.8], layers: [{ texture: { texture: 0 }, mode: 'modulate', scale: 1 }], emission: [0, 0, 0], emissionTexture: null,
      transmission: { factor: 0.8, metallic: 0.5 } },
    { colour: [0, 0, 0], layers: [], emission: [radiance, radiance, radiance], emissionTexture },
  ];
  const surface = { parts: [{ material: 0, end: 1 }, { material: 1, end: 2 }], corners: Uint32Array.of(0, 1, 2, 0, 1, 2) };
  const positions = Float32Array.of(0, 4, 0, 1, 4, 0, 0, 4, 1);
  const textures = [{ mean: { colour: [0.5, 0.5, 0.5], alpha: 1 } }];
  return { scene: { positions, surfaces: [surface], materials, textures, lights, environment: { mean }, projectors: [], cameras: [] } } as unknown as Container;
}

describe('the lights of a draft', () => {
  it('are the emissive parts and the scene\'s lights, all points in use', () => {
    const { lights, lamps } = draftLights(container(10, [light(), sun]), 16, LIT);
    expect([lights.length, lamps.length]).toEqual([2, 14]);
    expect(lamps.reduce((sum, { area }) => sum + area, 0)).toBeCloseTo(0.5);
    expect(lamps[0].emission).toEqual([5, 5, 5]);
  });

  it('are the strongest where there are more than the shader takes', () => {
    const dim = light({ name: 'dim', intensity: [1, 1, 1] });
    const far = light({ name: 'far', shape: { kind: 'point', position: [0, 400, 0] }, intensity: [100, 100, 100] });
    const outOfRange = light({ name: 'out of range', falloff: { kind: 'polynomial', attenuation: [1, 0, 0], radius: 3 } });
    const { lights, lamps } = draftLights(container(0, [far, dim, outOfRange, light(), sun]), 3, LIT);
    expect(lights.map(({ name, shape }) => name + shape.kind)).toEqual(['ldirectional', 'lpoint', 'dimpoint']);
    expect(lamps).toEqual([]);
  });

  it('reach the shader, and give an exposure that makes white mid-grey', () => {
    const spot = light({
      shape: { kind: 'spot', position: [0, 4, 0], direction: [0, -1, 0], cone: { beamWidth: 0.2, cutOff: 0.7, profile: 'linear' } },
      falloff: { kind: 'polynomial', attenuation: [1, 0, 0], radius: 9 },
    });
    const all = container(0, [sun, spot], [1, 1, 1]);
    const uniforms = sharedUniforms(partTable(all.scene));
    const exposure = setLights(uniforms, all, LIT);
    expect(uniforms.lfLightCount.value).toBe(2);
    // The strongest first: 16 W/m² of the spot, which is not weakened, then 3 of the sun.
    expect(uniforms.lfLightPlace.value.slice(0, 2).map((v) => v.toArray())).toEqual([[0, 4, 0, 1], [0, 0, 0, 2]]);
    expect(uniforms.lfLightAxis.value[0].toArray()).toEqual([0, -1, 0, 1]);
    expect([uniforms.lfLightPower.value[0].w, ...uniforms.lfLightFall.value[0], ...uniforms.lfLightCone.value[0]]).toEqual([9, 1, 0, 0, 0.2, 0.7]);
    expect(exposure * ((19 + Math.PI) / Math.PI)).toBeCloseTo(0.5);
    expect(setLights(sharedUniforms(partTable(all.scene)), container(0, []), LIT)).toBe(1);
  });
});

it('the table of parts has what each reflects and emits', () => {
  const table = partTable(container(10, []).scene);
  const data = [...(table.image.data as Float32Array)];
  [0.06, 0.12, 0.24, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5, 5, 5, 0].forEach((v, i) => expect(data[i]).toBeCloseTo(v));
});
