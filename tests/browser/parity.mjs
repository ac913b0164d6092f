// node parity.mjs URL GPU OUT WIDTH HEIGHT CAMERAS SCHEMES: what the page's viewer draws and looks up, as float32 RGBA files, for each
// scheme and camera.
//
// CAMERAS is a JSON list of {eye, target, fov}, SCHEMES one of [scheme, filter]. The Rust side compares the files with its own renderer;
// nothing is judged here.
import fs from 'node:fs';
import path from 'node:path';
import { check, load, open, say, script } from './browser.mjs';

await script(async ([url, gpu, out, width, height, cameras, schemes]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(url);
  const src = await page.evaluate(() => document.querySelector('kiln-viewer').src);
  for (const [scheme, filter] of JSON.parse(schemes)) {
    const stats = await load(page, { scheme, filter, src });
    check(stats.schemes[scheme] > 0 && Object.keys(stats.schemes).length === 1, `not all surfaces are ${scheme}: ${JSON.stringify(stats.schemes)}`);
    for (const [i, { eye, target, fov }] of JSON.parse(cameras).entries()) {
      for (const what of ['radiance', 'lookup']) {
        const text = await page.evaluate(
          ([what, eye, target, fov, width, height]) => {
            const viewer = document.querySelector('kiln-viewer');
            viewer.setCamera(eye, target, fov);
            const bytes = new Uint8Array(viewer.renderFloats(what, width, height).buffer);
            let text = '';
            for (let k = 0; k < bytes.length; k += 32768) text += String.fromCharCode(...bytes.subarray(k, k + 32768));
            return btoa(text);
          },
          [what, eye, target, fov, Number(width), Number(height)],
        );
        fs.writeFileSync(path.join(out, `${scheme}-${filter}-${i}.${what}`), Buffer.from(text, 'base64'));
      }
    }
    const frames = await page.evaluate(() => document.querySelector('kiln-viewer').benchmark(3));
    say('scheme', { scheme, filter, firstPictureMs: stats.firstPictureMs, frameMs: Math.min(...frames), textureBytes: stats.textureBytes });
  }
  check(faults.length === 0, faults.join('\n'));
  await browser.close();
});
