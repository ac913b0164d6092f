import { expect, test } from 'vitest';
import { type Place, meantKey } from './shortcuts.ts';

const press = (key: string, place: Place, over = {}) => meantKey({ key, ctrlKey: false, metaKey: false, altKey: false, ...over }, place);

test('letters are keys only inside the view and the inspector, and not where people type', () => {
  const keys = ['g', '1', '?'];
  expect(keys.map((key) => press(key, 'inside'))).toEqual(keys);
  expect(keys.flatMap((key) => [press(key, 'outside'), press(key, 'field')])).toEqual(Array(6).fill(null));
});

test('Escape closes from anywhere', () => {
  expect((['inside', 'outside', 'field'] as const).map((place) => press('Escape', place))).toEqual(['Escape', 'Escape', 'Escape']);
});

test('what is pressed together with Ctrl, Alt or Meta is the browser\'s', () => {
  expect(['ctrlKey', 'metaKey', 'altKey'].map((modifier) => press('c', 'inside', { [modifier]: true }))).toEqual([null, null, null]);
});
