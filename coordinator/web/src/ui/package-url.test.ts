import { expect, test } from 'vitest';
import { packageUrl } from './package-url.ts';

const BASE = 'https://a.example/rooms/viewer.html';

test('the package beside the page is the usual one', () => {
  expect(packageUrl('', BASE)).toBe('https://a.example/rooms/package/manifest.json');
});

test('another of the same site may be named', () => {
  expect(packageUrl('?src=/x/manifest.json', BASE)).toBe('https://a.example/x/manifest.json');
  expect(packageUrl('?src=https%3A%2F%2Fa.example%2Fy.json', BASE)).toBe('https://a.example/y.json');
});

test('another site, and what is no address of a site, is refused', () => {
  for (const src of ['https://b.example/m.json', '//b.example/m.json', 'http://a.example/m.json', 'javascript:alert(1)', 'data:text/json,{}', 'https://', 'blob:https://a.example/1']) {
    expect(packageUrl(`?src=${encodeURIComponent(src)}`, BASE), src).toBeNull();
  }
});
