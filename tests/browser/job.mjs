// node job.mjs STORY URL GPU JOB: the page of a job, one story at a time. Where the script says a line, the test acts: starts a worker,
// deletes the job, kills the coordinator.
import { checkAccessibility } from './axe.mjs';
import { check, open, say, script } from './browser.mjs';

const alert = (page, words) => page.getByRole('alert').filter({ hasText: words }).waitFor();
const model = (page) => page.evaluate(() => document.querySelector('kiln-viewer').model);

/** Counts the tiles that the page hands to its viewer, and in how many bodies. */
const countTiles = (page) =>
  page.evaluate(() => {
    const viewer = document.querySelector('kiln-viewer');
    const add = viewer.addSegments.bind(viewer);
    window.arrived = [];
    viewer.addSegments = (body) => {
      const tiles = add(body);
      window.arrived.push(tiles);
      return tiles;
    };
  });

const pixels = (page) =>
  page.evaluate(async () => {
    const viewer = document.querySelector('kiln-viewer');
    const bitmap = await createImageBitmap(await viewer.toBlob());
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    return [...context.getImageData(0, 0, bitmap.width, bitmap.height).data];
  });

const different = (a, b) => a.filter((v, i) => Math.abs(v - b[i]) > 2).length / a.length;

const stories = {
  /** Watched from before the first tile to the package. */
  async live(page) {
    await page.getByText('no worker is connected').first().waitFor();
    await countTiles(page);
    await page.waitForFunction(() => document.querySelector('kiln-viewer').model?.live);
    const draft = await pixels(page);
    say('watching');
    await page.waitForFunction(() => window.arrived.flat().length > 3);
    const eye = [11, 6, 12];
    await page.evaluate((eye) => document.querySelector('kiln-viewer').setCamera(eye, [5, 2, 5], 50), eye);
    await page.waitForFunction(() => document.querySelector('kiln-viewer').model?.live === false, null, { timeout: 100_000 });
    await page.waitForFunction(() => document.querySelector('kiln-viewer').loaded);
    const camera = await page.evaluate(() => document.querySelector('kiln-viewer').getCamera());
    check(Math.abs(camera.eye[0] - eye[0]) < 1e-3 && camera.fieldOfView === 50, `the camera jumped: ${JSON.stringify(camera)}`);
    await page.evaluate(() => document.querySelector('kiln-viewer').resetCamera());
    check(different(draft, await pixels(page)) > 0.02, 'the baked room looks like its draft');
    const arrived = await page.evaluate(() => window.arrived);
    const tiles = arrived.flat();
    const all = (await model(page)).surfaces.reduce((sum, { tileCount }) => sum + tileCount, 0);
    check(new Set(tiles).size === tiles.length, `tiles came twice: ${JSON.stringify(arrived)}`);
    check(arrived.length > 1 && tiles.length > all / 4, `the tiles did not come as they were baked: ${tiles.length} of ${all} in ${arrived.length} bodies`);
    say('arrived', { bodies: arrived.length, tiles: tiles.length, all });
    await page.getByText('Package as .zip').waitFor();
    // The table names every surface and how it is drawn.
    for (const { name } of (await model(page)).surfaces) await page.getByRole('rowheader', { name, exact: true }).waitFor();
    say('axe', { minor: await checkAccessibility(page, 'the page of a job') });
  },

  async failed(page) {
    await page.waitForFunction(() => document.querySelector('kiln-viewer').model?.live);
    say('watching');
    // With the coordinator's own reason.
    await alert(page, /The job failed\. .*segment of tile \d+/);
    await checkAccessibility(page, 'the page of a failed job');
    // Who comes later finds no empty view to wait at.
    await page.reload();
    await page.getByText('There is nothing to show').waitFor();
    check(!(await page.locator('kiln-viewer').isVisible()) && !(await page.getByRole('heading', { name: 'Inspector' }).isVisible()), 'there is a view of nothing');
  },

  async deleted(page) {
    await page.getByText('no worker is connected').first().waitFor();
    say('watching');
    await alert(page, 'was deleted while you watched it');
  },

  async unknown(page) {
    await alert(page, 'There is no job of this id');
  },

  /** The coordinator is killed, and comes back under the same address. */
  async away(page) {
    await page.getByText('no worker is connected').first().waitFor();
    say('watching');
    await alert(page, 'does not answer since');
    say('missed');
    await page.getByRole('alert').filter({ hasText: 'does not answer' }).waitFor({ state: 'hidden' });
    await page.waitForFunction(() => document.querySelector('kiln-viewer').model?.live === false, null, { timeout: 100_000 });
  },

  /** A browser without WebGL 2 says so, and shows the coordinator's picture. */
  async without_webgl(page) {
    await page.locator('kiln-viewer').getByText('WebGL 2').waitFor();
    await page.waitForFunction(() => {
      const image = document.querySelector('img.picture');
      return image && !image.hidden && image.complete && image.naturalWidth > 0;
    });
    await page.getByText('Package as .zip').waitFor();
    await checkAccessibility(page, 'the page of a job without WebGL');
  },

  /** Everything with the keyboard: the way to the view, modes, inspector, help. */
  async keyboard(page) {
    await page.waitForFunction(() => document.querySelector('kiln-viewer').loaded);
    await page.keyboard.press('Tab');
    check(await page.getByRole('link', { name: 'Skip to the content' }).evaluate((e) => e === document.activeElement), 'the first stop is not the skip link');
    await page.keyboard.press('Enter');
    await page.keyboard.press('2');
    check((await page.evaluate(() => document.querySelector('kiln-viewer').mode)) === 'light-field', 'a letter acts outside of the view and the inspector');
    for (let stops = 0; ; stops++) {
      check(stops < 12, 'the view is not reached by Tab');
      await page.keyboard.press('Tab');
      if (await page.evaluate(() => document.activeElement?.tagName === 'KILN-VIEWER')) break;
    }
    const hash = () => page.evaluate(() => location.hash);
    await page.keyboard.press('ArrowLeft');
    const before = await page.evaluate(() => document.querySelector('kiln-viewer').getCamera());
    // The address follows a moment later.
    await page.waitForFunction((x) => Math.abs(Number(/eye=([^,&]+)/.exec(location.hash)?.[1]) - x) < 1e-2, before.eye[0]);
    const link = await hash();
    await page.keyboard.press('Home');
    await page.waitForFunction((link) => location.hash !== link, link);
    await page.evaluate((link) => (location.hash = link), link);
    await page.waitForFunction((eye) => document.querySelector('kiln-viewer').getCamera().eye.every((v, i) => Math.abs(v - eye[i]) < 1e-2), before.eye);
    await page.keyboard.press('2');
    check((await page.evaluate(() => document.querySelector('kiln-viewer').mode)) === 'diffuse', '2 is not diffuse only');
    await page.keyboard.press('1');
    await page.keyboard.press('g');
    check(await page.evaluate(() => document.querySelector('kiln-viewer').texelGrid), 'g is not the texel grid');
    await page.keyboard.press('g');
    await page.keyboard.press('Enter');
    await page.getByText(/texel/i).first().waitFor();
    await page.getByText(/theta|θ|inclination/i).first().waitFor();
    await page.keyboard.press('i');
    await page.getByText(/texture memory/i).first().waitFor();
    await page.keyboard.press('?');
    await page.getByRole('dialog').waitFor();
    await checkAccessibility(page, 'the help');
    await page.keyboard.press('Escape');
    await page.getByRole('dialog').waitFor({ state: 'hidden' });
    await checkAccessibility(page, 'the inspector');
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Screenshot' }).press('Enter');
    check((await (await download).suggestedFilename()).endsWith('.png'), 'the screenshot is no PNG');
  },
};

await script(async ([story, url, gpu, job]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(`${url}/jobs/${job}`);
  await stories[story](page);
  // What a story provokes (answers that are failed loads, a context that cannot be had) is on the console; anything else is a fault of the
  // page.
  const own = faults.filter((fault) => !/Failed to load resource|net::ERR_/.test(fault) && !(gpu === 'none' && /WebGL/.test(fault)));
  check(own.length === 0, own.join('\n'));
  await browser.close();
});
