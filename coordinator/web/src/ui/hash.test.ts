import { expect, test } from 'vitest';
import { formatHash, formatNamed, parseHash, parseNamed } from './hash.ts';

test('a camera comes back as it was written', () => {
  const camera = { eye: [1.5, -2, 3.1234567], target: [0, -0.00001, 1e-9], fieldOfView: 45 } as const;
  const hash = formatHash({ ...camera, eye: [...camera.eye], target: [...camera.target] });
  expect(hash).toBe('#eye=1.5,-2,3.1235&target=0,0,0&fov=45');
  expect(parseHash(hash)).toEqual({ eye: [1.5, -2, 3.1235], target: [0, 0, 0], fieldOfView: 45 });
});

test('a camera of the author comes back by its name, whatever is in it', () => {
  for (const name of ['Door', 'Küche & Bad #2', 'a=b+c', '100 %']) expect(parseNamed(formatNamed(name)), name).toBe(name);
  expect([parseNamed('#eye=1,2,3&target=0,0,0'), parseNamed('#camera='), parseHash(formatNamed('Door'))]).toEqual([null, null, null]);
});

test('the field of view may be left out, and other parts are ignored', () => {
  expect(parseHash('#x=1&target=0,0,0&eye=0,0,9')).toEqual({ eye: [0, 0, 9], target: [0, 0, 0], fieldOfView: 45 });
});

test('what is malformed is no camera', () => {
  for (const bad of [
    '', '#', '#main', '#eye=1,2,3', '#eye=1,2&target=0,0,0', '#eye=1,2,NaN&target=0,0,0', '#eye=1,2,&target=0,0,0', '#eye=1,2,3,4&target=0,0,0',
    '#eye=1,2,Infinity&target=0,0,0', '#eye=1,2,3&target=0,0,0&fov=', '#eye=1,2,3&target=0,0,0&fov=0', '#eye=1,2,3&target=0,0,0&fov=180',
    '#eye=1,2,3&target=1,2,3', '#eye=a,b,c&target=0,0,0',
  ]) {
    expect(parseHash(bad), bad).toBeNull();
  }
});
