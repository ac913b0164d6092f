// node cover.mjs URL GPU: the package of page_cover.rs: what shows through, both sides, parts, drafts and the author's cameras.
// KILN_PICTURES names a folder for pictures to look at.
import fs from 'node:fs';
import path from 'node:path';
import { check, load, open, script } from './browser.mjs';

const [WIDTH, HEIGHT] = [400, 300];
/** Pixels a metre where z is 0, seen from 12 m away through 45 degrees. */
const SCALE = HEIGHT / (2 * 12 * Math.tan(Math.PI / 8));
const WALL = [0.6, 0.1, 0.1];

/** Linear radiance under points of the plane z = 0 as [r, g, b, chart], seen from `eye` on the z axis. */
function radiances(page, eye, points) {
  return page.evaluate(
    ([eye, points, width, height, scale]) => {
      const viewer = document.querySelector('kiln-viewer');
      viewer.setCamera([0, 0, eye], [0, 0, 0], 45);
      const floats = viewer.renderFloats('radiance', width, height);
      return points.map(([x, y]) => {
        const at = (Math.floor(height / 2 + y * scale) * width + Math.floor(width / 2 + x * scale * Math.sign(eye))) * 4;
        return [...floats.subarray(at, at + 4)];
      });
    },
    [eye, points, WIDTH, HEIGHT, SCALE],
  );
}

const near = (found, expected, within) => expected.every((v, c) => Math.abs(found[c] - v) <= within);
const expect = (found, expected, what, within = 0.012) => check(near(found, expected, within), `${what}: ${found} instead of ${expected}`);
const coded = (l) => 255 * (l <= 0.0031308 ? l * 12.92 : 1.055 * l ** (1 / 2.4) - 0.055);
const over = (own, opacity, behind) => own.map((v, c) => v * opacity + behind[c] * (1 - opacity));

async function picture(page, name) {
  const folder = process.env.KILN_PICTURES;
  if (!folder) return;
  const url = await page.evaluate(() => document.querySelector('kiln-viewer').toDataURL());
  fs.writeFileSync(path.join(folder, `${name}.png`), Buffer.from(url.split(',')[1], 'base64'));
}

async function showsThrough(page, scheme) {
  const [solid, hole, glass, pane, leaf, panes] = await radiances(page, 12, [[-4.4, -0.4], [-3.6, -0.4], [-2, 0.2], [0, 0], [2, 0.2], [0, 2.9]]);
  expect(solid, [0.1, 0.6, 0.1], `${scheme}: the fence`);
  expect(hole, WALL, `${scheme}: a hole of the fence`);
  expect(glass, over([0.1, 0.1, 0.6], 0.25, WALL), `${scheme}: the glass`);
  // Four per cent are reflected at normal incidence.
  expect(pane, WALL.map((v) => 0.1 + 0.8 * 0.96 * v), `${scheme}: the thin pane`);
  expect(leaf, [0.5, 0.5, 0], `${scheme}: the leaf`);
  expect(panes, over([0.8, 0, 0], 0.5, over([0, 0.8, 0], 0.5, WALL)), `${scheme}: the panes`);
  check(hole[3] === glass[3] && glass[3] === pane[3] && solid[3] !== hole[3], `${scheme}: the chart behind is not the wall's: ${[solid, hole, glass, pane].map((p) => p[3])}`);
  const [, leafBack] = await radiances(page, -12, [[0, 0], [2, 0.2]]);
  expect(leafBack, [0, 0.5, 0.5], `${scheme}: the leaf from behind`);
}

/** On the screen light adds up as light: not as the bytes of the display. */
async function onScreen(page) {
  const [glass, wall] = await page.evaluate(async (scale) => {
    const viewer = document.querySelector('kiln-viewer');
    viewer.setCamera([0, 0, 12], [0, 0, 0], 45);
    const bitmap = await createImageBitmap(await viewer.toBlob());
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const own = (scale * bitmap.height) / 300;
    return [[-2, -0.2], [-3, 1.5]].map(([x, y]) => [...context.getImageData(bitmap.width / 2 + x * own, bitmap.height / 2 + y * own, 1, 1).data].slice(0, 3));
  }, SCALE);
  expect(glass, over([0.1, 0.1, 0.6], 0.25, WALL).map(coded), 'the glass on the screen', 3);
  expect(wall, WALL.map(coded), 'the wall on the screen', 3);
}

async function picks(page) {
  const pick = (eye, x, y) =>
    page.evaluate(
      ([eye, x, y, scale]) => {
        const viewer = document.querySelector('kiln-viewer');
        viewer.setCamera([0, 0, eye], [0, 0, 0], 45);
        const own = (scale * viewer.clientHeight) / 300;
        const found = viewer.pickAt(viewer.clientWidth / 2 + x * own * Math.sign(eye), viewer.clientHeight / 2 - y * own);
        return found && `${found.surface}/${found.part}`;
      },
      [eye, x, y, SCALE],
    );
  const found = [];
  for (const at of [[12, -4.4, -0.4], [12, -3.6, -0.4], [12, -2, 0.2], [12, 2, 0.2], [-12, 2, 0.2], [12, 4.3, -0.3], [12, 3.7, 0.3]]) found.push(await pick(...at));
  const expected = ['fence/fence', 'wall/wall', 'glass/glass', 'leaf/leaf', 'leaf~back/leaf', 'atlas/lower right', 'atlas/upper left'];
  check(String(found) === String(expected), `picked ${found} instead of ${expected}`);
  const model = await page.evaluate(() => document.querySelector('kiln-viewer').model.surfaces.map(({ name, backOf, parts }) => [name, backOf, parts.length]));
  check(JSON.stringify(model[5]) === '["leaf~back",4,1]' && model[6][2] === 2, `the model is ${JSON.stringify(model)}`);
}

/**
 * The texels of the environment, seen from above the scene: looked up as docs/light-transport.md says, behind everything, and nothing to
 * pick.
 */
async function environment(page, picture) {
  const toward = (i, j) => {
    const [around, up] = [((i + 0.5) / 8 - 0.5) * 2 * Math.PI - 0.3, ((j + 0.5) / 4 - 0.5) * Math.PI];
    return [Math.cos(around) * Math.cos(up), Math.sin(up), Math.sin(around) * Math.cos(up)];
  };
  const look = (d) =>
    page.evaluate(
      async ([d, width, height]) => {
        const viewer = document.querySelector('kiln-viewer');
        viewer.setCamera([0, 200, 0], d.map((v, axis) => (axis === 1 ? 200 : 0) + 10 * v), 45);
        const floats = viewer.renderFloats('radiance', width, height);
        const lookup = viewer.renderFloats('lookup', width, height);
        const bitmap = await createImageBitmap(await viewer.toBlob());
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
        context.drawImage(bitmap, 0, 0);
        const shown = [...context.getImageData(bitmap.width / 2, bitmap.height / 2, 1, 1).data];
        const at = (Math.floor(height / 2) * width + Math.floor(width / 2)) * 4;
        const picked = viewer.pickAt(viewer.clientWidth / 2, viewer.clientHeight / 2);
        return { radiance: [...floats.subarray(at, at + 4)], lookup: [...lookup.subarray(at, at + 4)], shown: shown.slice(0, 3), picked };
      },
      [d, WIDTH, HEIGHT],
    );
  const box = page.getByRole('checkbox', { name: 'Environment' });
  check(await box.isChecked(), 'the environment is hidden to begin with');
  for (const [i, j] of [[0, 1], [3, 2], [4, 2], [6, 1], [1, 3], [5, 0], [7, 2]]) {
    const { radiance, lookup, shown, picked } = await look(toward(i, j));
    const expected = [(i + 1) / 16, (j + 1) / 8, ((i * j) % 5) / 10];
    // The middle lies between four pixels, a quarter of a degree beside what is looked at.
    expect(radiance, [...expected, 0], `texel ${i}, ${j} of the environment`, 0.006);
    expect(shown, expected.map(coded), `texel ${i}, ${j} of the environment on the screen`, 3);
    check(picked === null && lookup.every((v) => v === 0), `there is something to pick in the environment: ${JSON.stringify(picked)}, ${lookup}`);
  }
  await picture('environment');
  await box.uncheck();
  const { radiance, shown } = await look(toward(4, 2));
  check(radiance.every((v) => v === 0) && String(shown) === '32,36,40', `a hidden environment shows ${radiance}, ${shown}`);
  await page.locator('kiln-viewer canvas').focus();
  await page.keyboard.press('e');
  check(await box.isChecked(), 'the key does not show the environment again');
  const model = await page.evaluate(() => document.querySelector('kiln-viewer').model.environment);
  check(model === 'sky.hdr', `the model's environment is ${model}`);
}

async function cameras(page, url, gpu) {
  const eye = () => page.evaluate(() => document.querySelector('kiln-viewer').getCamera().eye.map((v) => Math.round(v * 1e3) / 1e3));
  const choice = page.getByRole('combobox', { name: 'Camera' });
  await choice.selectOption('from behind');
  check(String(await eye()) === '0,0,-12', `the camera stands at ${await eye()}`);
  await page.waitForFunction(() => location.hash === '#camera=from+behind');
  // A link to it leads there, also for those who have not seen the page before.
  const other = await open(gpu);
  await other.page.goto(new URL('#camera=front', url).href);
  await other.page.waitForFunction(() => document.querySelector('kiln-viewer').loaded);
  const there = await other.page.evaluate(() => document.querySelector('kiln-viewer').getCamera().eye.map(Math.round));
  check(String(there) === '0,0,12', `a link leads to ${there}`);
  await other.browser.close();
  await page.locator('kiln-viewer canvas').focus();
  await page.keyboard.press('ArrowRight');
  await page.waitForFunction(() => location.hash.startsWith('#eye='));
  check((await choice.locator('option:checked').textContent()) === 'Where you moved it', 'the choice names a camera that the view has left');
  await choice.selectOption('from behind');
  check(String(await eye()) === '0,0,-12', 'a camera cannot be chosen again');
  await choice.selectOption('First view');
  check(String(await eye()) !== '0,0,-12', 'the first view is not the one that the viewer chooses');
}

/** Before anything is baked, the bulb lights the wall behind it more than its edge, and glass is glass. */
async function draft(page) {
  await page.evaluate(async () => {
    const viewer = document.querySelector('kiln-viewer');
    const bytes = await (await fetch('package/scene.kiln')).arrayBuffer();
    const loaded = new Promise((resolve) => viewer.addEventListener('load', resolve, { once: true }));
    viewer.showLive(bytes);
    await loaded;
    viewer.setCamera([0, 0, 12], [0, 0, 0], 45);
  });
  const bright = await page.evaluate(async () => {
    const bitmap = await createImageBitmap(await document.querySelector('kiln-viewer').toBlob());
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const mean = (x, y) => {
      const { data } = context.getImageData(bitmap.width * x, bitmap.height * y, 40, 40);
      return data.reduce((sum, v, i) => sum + (i % 4 < 3 ? v : 0), 0) / (data.length * 0.75);
    };
    return [mean(0.5, 0.62), mean(0.1, 0.9)];
  });
  check(bright[0] > bright[1] * 1.5 && bright[1] > 3, `the draft is lit evenly, or not at all: ${bright}`);
}

await script(async ([url, gpu]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(url);
  const src = await page.evaluate(() => document.querySelector('kiln-viewer').src);
  for (const [scheme, filter] of [['expanded', 'hardware'], ['expanded', 'exact'], ['streamed', 'exact'], ['raw', 'hardware']]) {
    await load(page, { scheme, filter, src });
    await showsThrough(page, scheme);
  }
  await page.evaluate(() => document.querySelector('kiln-viewer').setCamera([3, 2, 9], [0, 0.5, 0], 45));
  await picture(page, `cover-${gpu}`);
  await onScreen(page);
  await picks(page);
  await environment(page, (name) => picture(page, `${name}-${gpu}`));
  await cameras(page, url, gpu);
  await draft(page);
  await picture(page, `cover-draft-${gpu}`);
  check(faults.length === 0, faults.join('\n'));
  await browser.close();
});
