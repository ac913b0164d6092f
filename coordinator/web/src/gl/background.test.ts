import { type DataTexture, DataUtils } from 'three';
import { describe, expect, it } from 'vitest';
import { Background } from './background.ts';
import { sharedUniforms } from './material.ts';
import { environmentProgram } from './shaders.ts';

/** What the shader looks up of an environment of two texels, in a view of this exposure. */
function lookedUp(texels: number[], stops: number): number[] {
  const shared = sharedUniforms({} as DataTexture);
  shared.lfDraftExposure.value = 2 ** stops;
  const environment = { name: 'sky.hdr', width: 2, height: 1, texels: Float32Array.from(texels), rotation: 0, mean: [0, 0, 0] as [number, number, number] };
  const { uniforms } = new Background(environment, shared).material;
  const { data } = (uniforms.lfEnvironment.value as DataTexture).image;
  return Array.from(data as unknown as Uint16Array, (half) => DataUtils.fromHalfFloat(half));
}

describe('the environment behind a scene', () => {
  it('is exposed before it becomes half floats, however bright or dim it is', () => {
    for (const stops of [-40, -20, 0, 20, 40]) {
      const shown = [0.01, 0.2, 1, 0.5, 3, 40];
      const found = lookedUp(shown.map((v) => v * 2 ** -stops), stops);
      [0.01, 0.2, 1, 1, 0.5, 3, 40, 1].forEach((v, i) => expect(Math.abs(found[i] / v - 1), `${stops} stops, value ${v}`).toBeLessThan(2 ** -10));
    }
  });

  it('is not exposed again by the shader, which has only the viewer\'s factor', () => {
    expect(environmentProgram.fragment).not.toContain('lfDraftExposure');
  });

  it('is cut where it is too bright for half floats as exposed', () => {
    expect(lookedUp([1e13, 1e6, 0, 0, 0, 0], -10)).toEqual([65504, 976.5, 0, 1, 0, 0, 0, 1]);
  });
});
