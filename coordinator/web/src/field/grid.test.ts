import { describe, expect, it } from 'vitest';
import { cosineWeights, depthOfStep, directionOf, parseGrid, stepOfDepth } from './grid.ts';
import { frameOfTriangle, thesisFrame } from './frame.ts';

describe('the spherical grid', () => {
  it('has the reference directions', () => {
    const [x, y, z] = directionOf({ nTheta: 20, nPhi: 20 }, 10);
    expect([x, y, z]).toEqual([expect.closeTo(-0.0392598, 6), expect.closeTo(0, 7), expect.closeTo(0.999229, 6)]);
  });

  it('is walked both ways, each the inverse of the other', () => {
    const grid = parseGrid('5x8');
    for (const walk of ['phi', 'theta'] as const) {
      const [steps, depths] = [stepOfDepth(grid, walk), depthOfStep(grid, walk)];
      expect([...steps].map((s) => depths[s])).toEqual([...steps.keys()]);
    }
    expect(depthOfStep(grid, 'theta')[1]).toBe(8);
  });

  it('weighs the hemisphere by cosine and solid angle', () => {
    const weights = cosineWeights(parseGrid('20x20'));
    expect(weights.reduce((a, b) => a + b)).toBeCloseTo(1, 12);
  });

  it('refuses what is none', () => {
    for (const bad of ['', '20', '0x20', '20x19', '65x20', '20x20x20']) expect(() => parseGrid(bad)).toThrow('azimuths even');
  });
});

describe('a frame', () => {
  it('follows the texture, mirrored charts too', () => {
    const corners: [[number, number, number], [number, number, number], [number, number, number]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
    expect(frameOfTriangle(corners, [[0, 0], [1, 0], [0, 1]], 'texture')!.tangent).toEqual([1, 0, 0]);
    const flipped = frameOfTriangle(corners, [[1, 0], [0, 0], [1, 1]], 'texture')!;
    expect(flipped.tangent.map((v) => v + 0)).toEqual([-1, 0, 0]);
    expect(frameOfTriangle([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0], [0, 0], [0, 0]], 'texture')).toBeNull();
  });

  it('of the thesis carries +Y to the normal', () => {
    expect(thesisFrame([0, 1, 0]).tangent).toEqual([1, -0, -0]);
    expect(thesisFrame([0, -1, 0]).tangent).toEqual([1, 0, 0]);
  });
});
