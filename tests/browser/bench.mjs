// node bench.mjs URL GPU: what the ways to draw a package cost, one JSON line each: time to the first complete picture, frame times,
// texture memory.
import { check, load, open, script } from './browser.mjs';

const [WIDTH, HEIGHT] = [640, 480];
const FRAMES = 10;

await script(async ([url, gpu]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(url);
  const src = await page.evaluate(() => document.querySelector('kiln-viewer').src);
  await page.evaluate(
    ([width, height]) => {
      const viewer = document.querySelector('kiln-viewer');
      Object.assign(viewer.style, { position: 'fixed', left: 0, top: 0, width: `${width}px`, height: `${height}px` });
    },
    [WIDTH, HEIGHT],
  );
  await page.waitForFunction(() => document.querySelector('kiln-viewer').loaded);
  const raw = await page.evaluate(() => document.querySelector('kiln-viewer').model.hasRaw);
  const ways = [['raw', 'hardware'], ['raw', 'exact'], ['expanded', 'hardware'], ['expanded', 'exact'], ['streamed', 'exact']];
  for (const [scheme, filter] of ways.filter(([scheme]) => scheme !== 'raw' || raw)) {
    const stats = await load(page, { scheme, filter, src });
    const times = await page.evaluate((count) => {
      const viewer = document.querySelector('kiln-viewer');
      viewer.benchmark(2);
      return viewer.benchmark(count).sort((a, b) => a - b);
    }, FRAMES);
    const { firstPictureMs, textureBytes } = stats;
    console.log(JSON.stringify({
      bench: 'page', gpu, scheme, filter, width: WIDTH, height: HEIGHT, first_picture_ms: Math.round(firstPictureMs),
      frame_ms: { min: times[0], median: times[FRAMES / 2], max: times[FRAMES - 1] }, texture_bytes: textureBytes,
    }));
  }
  check(faults.length === 0, faults.join('\n'));
  await browser.close();
});
