import { describe, expect, it } from 'vitest';
import { EOTF, decodeRow } from './field/decode.ts';
import { depthOfStep } from './field/grid.ts';
import { LightFieldLoader } from './loader.ts';
import { goldenFiles, goldenRoom, goldenText } from './testing.ts';

const manifest = goldenText('room/manifest.json');
const parse = (change: (files: Map<string, Uint8Array>) => void) => {
  const files = goldenFiles();
  change(files);
  return () => new LightFieldLoader().parse(manifest, files);
};

describe('a package', () => {
  it('decodes to what the Rust decoder gives, sample for sample', () => {
    const field = goldenRoom();
    const lines = goldenText('room-decoded.csv').trim().split('\n').slice(1);
    const bytes = new Uint8Array(field.grid.nTheta * field.grid.nPhi * 3);
    let compared = 0;
    for (const line of lines) {
      const [name, tx, ty, i, j, ...rgb] = line.split(',');
      const surface = field.surfaces.find((s) => s.name === name)!;
      const { kept, row } = surface.source.texel(Number(tx), Number(ty))!;
      decodeRow(kept, row, bytes);
      const step = depthOfStep(field.grid, surface.walk).indexOf(Number(i) * field.grid.nPhi + Number(j));
      rgb.forEach((value, c) => {
        expect(EOTF[bytes[step * 3 + c]] / 2 ** field.exposureStops).toBeCloseTo(Number(value), 5);
        compared++;
      });
    }
    expect(compared).toBe(lines.length * 3);
    expect(new Set(field.surfaces.map((s) => s.walk)).size).toBe(2);
  });

  it('leaves the bytes of its files as they are', () => {
    const [files, before] = [goldenFiles(), goldenFiles()];
    new LightFieldLoader().parse(manifest, files);
    expect(files).toEqual(before);
  });

  it('has the surfaces of its plan, and gutters that hold light', () => {
    const field = goldenRoom();
    const floor = field.surfaces.find((s) => s.name === 'floor')!;
    expect([floor.plan.width, floor.plan.height, floor.geometry.triangles]).toEqual([10, 10, 2]);
    const firsts = field.surfaces.map((s) => s.firstTile);
    expect(firsts).toEqual([...firsts].sort((a, b) => a - b));
    const prism = field.surfaces.find((s) => s.name === 'prism')!;
    let held = 0;
    for (let y = 0; y < prism.plan.height; y++) for (let x = 0; x < prism.plan.width; x++) held += prism.source.texel(x, y) ? 1 : 0;
    expect(held).toBeGreaterThan(prism.plan.covered);
  });
});

describe('a damaged package', () => {
  it('names the file that is missing', () => {
    expect(parse((files) => files.delete('surfaces/floor.mti'))).toThrow('surfaces/floor.mti is missing');
  });

  it('is refused at every file, whatever bit is flipped', () => {
    for (const path of goldenFiles().keys()) {
      const { length } = goldenFiles().get(path)!;
      // The header's magic, the middle, the end.
      for (const at of [0, length >> 1, length - 1]) {
        expect(parse((files) => (files.get(path)![at] ^= 4)), `${path} at ${at}`).toThrow(/scene\.kiln|surfaces\//);
      }
    }
  });

  it('is refused at every file when cut', () => {
    for (const path of goldenFiles().keys()) {
      for (const keep of [0, 10, 33]) {
        expect(parse((files) => files.set(path, files.get(path)!.slice(0, keep))), `${path} cut to ${keep}`).toThrow(path.split('.')[0]);
      }
    }
  });

  it('that leads out of its folder is refused', () => {
    for (const stem of ['../../secret', '/etc/x', '..', 'a\\b', '']) {
      const evil = JSON.parse(manifest) as { surfaces: { file_stem: string }[] };
      evil.surfaces[0].file_stem = stem;
      expect(() => new LightFieldLoader().parse(JSON.stringify(evil), goldenFiles()), stem).toThrow(/no file name|do not belong together/);
    }
  });

  it('is refused when its manifest is another one, or none', () => {
    const loader = new LightFieldLoader();
    expect(() => loader.parse('<html>', goldenFiles())).toThrow('is the URL that of a package');
    expect(() => loader.parse('{"schema": 1}', goldenFiles())).toThrow('schema 1; this page reads schema 2');
    const other = { ...JSON.parse(manifest), surfaces: [] };
    expect(() => loader.parse(JSON.stringify(other), goldenFiles())).toThrow('do not belong together');
  });
});
