import { describe, expect, it } from 'vitest';
import type { SceneCamera } from '../format/light.ts';
import { cameraNames, viewOf } from './cameras.ts';

const BOUNDS: { low: [number, number, number]; high: [number, number, number] } = { low: [-1, -1, -1], high: [1, 1, 1] };
const camera = (over: Partial<SceneCamera>): SceneCamera => ({
  name: 'c', eye: [0, 0.5, 5], forward: [0, 0, -1], up: [0, 1, 0], lens: { kind: 'perspective', fov: Math.PI / 3, ofSmaller: false }, ...over,
});

it('cameras have distinct names, whatever their author called them', () => {
  expect(cameraNames(['Door', '', 'Door', 'Door (2)', 'Door'].map((name) => camera({ name })))).toEqual(['Door', 'Camera 2', 'Door (2)', 'Door (2) (2)', 'Door (3)']);
});

describe('the view of an author\'s camera', () => {
  it('stands where the camera stands and turns about what lies ahead, beside the middle of the scene', () => {
    const view = viewOf(camera({}), BOUNDS, 2);
    expect(view.eye).toEqual([0, 0.5, 5]);
    expect(view.target).toEqual([0, 0.5, 0]);
    expect(view.fieldOfView).toBeCloseTo(60);
  });

  it('has a target ahead of it also where the scene lies behind', () => {
    const { target } = viewOf(camera({ forward: [0, 0, 1] }), BOUNDS, 1);
    expect(target[2]).toBeGreaterThan(5);
  });

  it('of X3D holds its field of view along the smaller side', () => {
    const lens = { kind: 'perspective', fov: Math.PI / 2, ofSmaller: true } as const;
    expect(viewOf(camera({ lens }), BOUNDS, 2).fieldOfView).toBeCloseTo(90);
    // Half as wide as high: tan of half the vertical angle is 2.
    expect(viewOf(camera({ lens }), BOUNDS, 0.5).fieldOfView).toBeCloseTo((Math.atan(2) * 360) / Math.PI);
  });

  it('that is orthographic shows the same height at its target, from far away', () => {
    const { eye, target, fieldOfView } = viewOf(camera({ lens: { kind: 'orthographic', halfHeight: 2 } }), BOUNDS, 1);
    const distance = eye[2] - target[2];
    expect(distance * Math.tan((fieldOfView * Math.PI) / 360)).toBeCloseTo(2);
    expect(distance).toBeGreaterThan(50);
  });
});
