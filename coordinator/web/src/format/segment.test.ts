import { describe, expect, it } from 'vitest';
import { makeLiveField, TileSource } from '../field/light-field.ts';
import { decodeRow } from '../field/decode.ts';
import { goldenBytes, goldenRoom } from '../testing.ts';
import { parseContainer } from './container.ts';
import { parseSegments } from './segment.ts';

const body = () => goldenBytes('segments.bin');

describe('segments of a job that is being baked', () => {
  it('hold what the package holds when it is done', () => {
    const [done, live] = [goldenRoom(), makeLiveField(parseContainer(goldenBytes('room/scene.kiln')))];
    const [a, b] = [new Uint8Array(72), new Uint8Array(72)];
    let compared = 0;
    for (const tile of parseSegments(body())) {
      const [finished, surface] = [done.surfaces[tile.surface], live.surfaces[tile.surface]];
      expect(tile.tile).toBeGreaterThanOrEqual(surface.firstTile);
      const block = (surface.source as TileSource).add(tile);
      for (let y = block.y; y < block.y + block.height; y++) {
        for (let x = block.x; x < block.x + block.width; x++) {
          const [package_, segment] = [finished.source.texel(x, y), surface.source.texel(x, y)];
          expect(segment === null, `${surface.name} (${x}, ${y})`).toBe(package_ === null);
          if (!package_ || !segment) continue;
          decodeRow(package_.kept, package_.row, a);
          decodeRow(segment.kept, segment.row, b);
          expect(b).toEqual(a);
          compared++;
        }
      }
    }
    expect(compared).toBeGreaterThan(200);
  });

  it('are refused when a bit is flipped or the end is missing', () => {
    const { length } = body();
    for (let at = 0; at < length; at += 97) {
      const damaged = body();
      damaged[at] ^= 16;
      expect(() => parseSegments(damaged), `bit at ${at}`).toThrow(/segment/);
    }
    for (const keep of [1, 11, 13, 60, length - 1]) expect(() => parseSegments(body().subarray(0, keep)), `cut to ${keep}`).toThrow(/segment/);
    expect(parseSegments(body().subarray(0, 0))).toEqual([]);
  });
});
