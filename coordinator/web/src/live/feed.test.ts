import { expect, test } from 'vitest';
import { sceneWanted } from './feed.ts';
import type { JobRecord } from './records.ts';

test('the scene is fetched once before and once behind the barrier', () => {
  const at = (state: JobRecord['state'], phase: JobRecord['phase'] = null) => ({ state, phase }) as JobRecord;
  expect(sceneWanted(at('preparing'), null)).toBeNull();
  expect(sceneWanted(at('baking', 'probe'), null)).toBe('probe');
  expect(sceneWanted(at('baking', 'probe'), 'probe')).toBeNull();
  expect(sceneWanted(at('baking', 'bake'), 'probe')).toBe('bake');
  expect(sceneWanted(at('assembling'), 'bake')).toBeNull();
  expect(sceneWanted(at('assembling'), null)).toBe('bake');
  expect(sceneWanted(at('done'), null)).toBeNull();
});
