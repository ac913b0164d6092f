import { describe, expect, it } from 'vitest';
import { arrayBytes, arrayLayout, streamCapacity, streamLayout } from './layout.ts';

/** What WebGL 2 guarantees. */
const LEAST = { maxTextureSize: 2048, maxArrayLayers: 256 };

describe('samples in an array texture', () => {
  it('take a layer a direction where there are enough layers', () => {
    expect(arrayLayout(200, 100, 256, LEAST)).toEqual({ cellsX: 1, cellsY: 1, layers: 256, width: 200, height: 100 });
  });

  it('share layers where there are not, within every limit and without a direction left out', () => {
    for (const [width, height, directions] of [[200, 100, 400], [1000, 1500, 400], [2048, 3, 4096], [30, 2048, 1000], [1, 1, 4096]]) {
      const layout = arrayLayout(width, height, directions, LEAST)!;
      expect(layout, `${width}x${height}x${directions}`).not.toBeNull();
      expect(layout.cellsX * layout.cellsY * layout.layers).toBeGreaterThanOrEqual(directions);
      expect(Math.max(layout.width, layout.height)).toBeLessThanOrEqual(2048);
      expect(layout.layers).toBeLessThanOrEqual(256);
      expect(arrayBytes(layout, 4)).toBeLessThan(2.5 * width * height * directions * 4);
    }
  });

  it('do not fit where they do not', () => {
    expect(arrayLayout(2049, 1, 4, LEAST)).toBeNull();
    expect(arrayLayout(2048, 2048, 400, LEAST)).toBeNull();
  });
});

describe('streams', () => {
  it('are unrolled into rows, then layers of a power of two', () => {
    expect(streamLayout(0, LEAST)).toEqual({ rows: 1, layers: 1, logRows: 30 });
    expect(streamLayout(2048 * 2048, LEAST)).toEqual({ rows: 2048, layers: 1, logRows: 30 });
    expect(streamLayout(2048 * 2048 + 1, LEAST)).toEqual({ rows: 2048, layers: 2, logRows: 11 });
    expect(streamCapacity(streamLayout(123_456_789, LEAST))).toBeGreaterThanOrEqual(123_456_789);
  });

  it('that no texture holds are refused with the reason', () => {
    expect(() => streamLayout(2 ** 31, LEAST)).toThrow('more than this GPU');
  });
});
