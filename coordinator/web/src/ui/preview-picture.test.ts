import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { PreviewPicture } from './preview-picture.ts';

type FakeImage = EventTarget & { attributes: Record<string, string>; setAttribute(name: string, value: string): void; append(): void; remove(): void };
let asked: FakeImage[];
let place: { children: FakeImage[]; hasChildNodes(): boolean; append(image: FakeImage): void };
let now: number;

beforeEach(() => {
  [asked, now] = [[], 0];
  vi.spyOn(performance, 'now').mockImplementation(() => now);
  place = {
    children: [],
    hasChildNodes: () => place.children.length > 0,
    append: (image) => void place.children.push(image),
  };
  vi.stubGlobal('document', {
    baseURI: 'http://farm/',
    createElement: () => {
      const image: FakeImage = Object.assign(new EventTarget(), {
        attributes: {} as Record<string, string>,
        setAttribute: (name: string, value: string) => void (image.attributes[name] = value),
        append: () => {},
        remove: () => void (place.children = place.children.filter((child) => child !== image)),
      });
      asked.push(image);
      return image;
    },
  });
});
afterEach(() => {
  vi.restoreAllMocks();
  vi.unstubAllGlobals();
});

const picture = () => new PreviewPicture(place as unknown as HTMLElement, 'a b', { width: 160, height: 120 });
const refuse = () => asked.at(-1)?.dispatchEvent(new Event('error'));

test('a picture is asked for once', () => {
  const it = picture();
  for (; now < 20_000; now += 2_000) it.show({ alt: '' });
  expect(asked.map(({ attributes }) => attributes.src)).toEqual(['http://farm/v1/jobs/a%20b/preview.png?w=160&h=120']);
  expect(place.children.length).toBe(1);
});

test('one that is refused leaves its place empty, and is asked for again ever more rarely', () => {
  const it = picture();
  const times: number[] = [];
  for (; now <= 32_000; now += 2_000) {
    it.show({ alt: '' });
    if (!place.hasChildNodes()) continue;
    times.push(now);
    refuse();
    expect(place.hasChildNodes()).toBe(false);
  }
  expect(times).toEqual([0, 4_000, 12_000, 28_000]);
});
