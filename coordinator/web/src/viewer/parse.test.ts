import { expect, it } from 'vitest';
import { parseAngle, parseLength, parseOrbit, parseVector } from './parse.ts';

it('camera attributes are read in model-viewer notation', () => {
  expect(parseOrbit('45deg 75deg 4m')).toEqual({ theta: 45, phi: 75, radius: 4 });
  expect(parseOrbit('-1.5rad 75 400cm')).toEqual({ theta: expect.closeTo(-85.9437, 3), phi: 75, radius: 4 });
  expect(parseVector('0m 1m -250mm')).toEqual([0, 1, -0.25]);
  expect(parseAngle('30deg')).toBe(30);
  expect(parseLength('1e-2m')).toBe(0.01);
});

it('what is no camera is ignored, not guessed', () => {
  for (const bad of ['', '45deg', '1 2 3 4', 'a b c', '1deg 2deg -3m', '1deg 2deg 0m', 'NaN NaN NaN']) expect(parseOrbit(bad)).toBeNull();
  for (const bad of ['', '1 2', '1px 2m 3m', '1..2 3 4']) expect(parseVector(bad)).toBeNull();
});
