import { expect, test } from 'vitest';
import { neighbour, sectorAt, sectorBounds, sectorDirection, sectorIndex, toDisc } from './polar.ts';

const grid = { nTheta: 5, nPhi: 8 };

test('directions lie where a compass would put them', () => {
  const near = (theta: number, phi: number, x: number, y: number) => {
    const point = toDisc(theta, phi);
    expect(point[0]).toBeCloseTo(x);
    expect(point[1]).toBeCloseTo(y);
  };
  near(0, 77, 0, 0);
  near(90, 0, 1, 0);
  near(45, 90, 0, 0.5);
  near(120, 180, -1, 0);
});

test('each sample direction lies in its own sector', () => {
  for (let i = 0; i < grid.nTheta; i++) {
    for (let j = 0; j < grid.nPhi; j++) {
      const { theta, phi } = sectorDirection({ i, j }, grid);
      expect(sectorAt(...toDisc(theta, phi), grid)).toEqual({ i, j });
    }
  }
});

test('outside the disc is no sector', () => {
  expect(sectorAt(1, 0, grid)).toBeNull();
  expect(sectorAt(0.8, 0.8, grid)).toBeNull();
});

test('sectors cover the disc without gaps', () => {
  let area = 0;
  for (let i = 0; i < grid.nTheta; i++) {
    for (let j = 0; j < grid.nPhi; j++) {
      const { inner, outer, from, to } = sectorBounds({ i, j }, grid);
      area += ((to - from) / 2) * (outer * outer - inner * inner);
    }
  }
  expect(area).toBeCloseTo(Math.PI);
});

test('depth runs ring by ring', () => {
  expect(sectorIndex({ i: 2, j: 3 }, grid)).toBe(19);
});

test('arrow keys go around, and stop at centre and rim', () => {
  expect(neighbour({ i: 0, j: 7 }, 'ArrowLeft', grid)).toEqual({ i: 0, j: 0 });
  expect(neighbour({ i: 0, j: 0 }, 'ArrowRight', grid)).toEqual({ i: 0, j: 7 });
  expect(neighbour({ i: 0, j: 0 }, 'ArrowDown', grid)).toEqual({ i: 0, j: 0 });
  expect(neighbour({ i: 4, j: 0 }, 'ArrowUp', grid)).toEqual({ i: 4, j: 0 });
  expect(neighbour({ i: 4, j: 0 }, 'x', grid)).toBeNull();
});
