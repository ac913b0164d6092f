import { expect, it } from 'vitest';
import { goldenRoom } from '../testing.ts';
import { defaultCamera, sceneBounds } from './camera.ts';
import { length, sub } from './frame.ts';

it('the first look at the room comes through its open corner and holds all of it', () => {
  const { container } = goldenRoom();
  const { eye, target } = defaultCamera(container, 4 / 3);
  const { low, high } = sceneBounds(container);
  expect(eye[0]).toBeGreaterThan(high[0]);
  expect(eye[2]).toBeGreaterThan(high[2]);
  const radius = length(sub(high, low)) / 2;
  expect(length(sub(eye, target))).toBeCloseTo(radius / Math.sin(Math.PI / 8), 6);
  // A narrow view stands further off.
  expect(length(sub(defaultCamera(container, 0.5).eye, target))).toBeGreaterThan(radius / Math.sin(Math.PI / 8));
});
