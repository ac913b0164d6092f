// node viewer.mjs URL GPU: the viewer by itself, on a package that kept raw radiance: modes, picks, keyboard, budget, a lost context, a
// broken shader.
import { check, load, open, say, script } from './browser.mjs';

/** What the canvas shows: its mean brightness and how many of its pixels are background. */
const look = (page) =>
  page.evaluate(async () => {
    const viewer = document.querySelector('kiln-viewer');
    const bitmap = await createImageBitmap(await viewer.toBlob());
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let [sum, background, hash] = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) {
      sum += data[i] + data[i + 1] + data[i + 2];
      if (data[i] === 0x20 && data[i + 1] === 0x24 && data[i + 2] === 0x28) background++;
      hash = (hash * 31 + data[i] * 7 + data[i + 1] * 5 + data[i + 2] * 3) | 0;
    }
    const pixels = data.length / 4;
    return { mean: sum / pixels / 3, background: background / pixels, hash };
  });

const viewer = (page, body, argument) => page.evaluate(`(${body})(document.querySelector('kiln-viewer'), ${JSON.stringify(argument ?? null)})`);

/** Waits until everything that was asked for is on the GPU. */
const settled = (page) => page.waitForFunction(() => !document.querySelector('kiln-viewer').stats.busy);

async function modes(page, src) {
  await load(page, { scheme: 'expanded', filter: 'hardware', src });
  const full = await look(page);
  check(full.background < 0.9 && full.mean > 10, `the picture is empty: ${JSON.stringify(full)}`);
  for (const mode of ['diffuse', 'error']) {
    await viewer(page, '(v, mode) => { v.mode = mode; }', mode);
    await settled(page);
    const other = await look(page);
    check(other.hash !== full.hash, `${mode} looks like the full light field`);
    if (mode === 'error') check(other.mean < full.mean, 'errors of a good codec are dark');
  }
  await viewer(page, "(v) => { v.mode = 'light-field'; v.texelGrid = true; }");
  check((await look(page)).hash !== full.hash, 'the texel grid is not drawn');
  await viewer(page, '(v) => { v.texelGrid = false; v.exposure = 2; }');
  check((await look(page)).mean > full.mean * 1.1, 'twice the exposure is not brighter');
  await viewer(page, '(v) => { v.exposure = 1; }');
  check((await look(page)).hash === full.hash, 'the view does not come back to what it was');
}

/**
 * Every pixel is decoded once, whatever lies behind it. Added up instead of replaced, the chart numbers of a pixel are those of one
 * fragment; without the depth pre-pass, which shows that this can fail, they are not.
 */
async function hiddenFragments(page) {
  const [prepass, none] = await page.evaluate(() => {
    const viewer = document.querySelector('kiln-viewer');
    viewer.resetCamera();
    const charts = () => viewer.renderFloats('radiance', 320, 240).filter((_, i) => i % 4 === 3);
    const once = charts();
    const meshes = viewer.stage.object.surfaces.flatMap((view) => view.meshes);
    for (const { meshes: [mesh] } of meshes) Object.assign(mesh.material, { blending: 5, blendEquation: 100, blendSrc: 201, blendDst: 201 });
    const overdrawn = () => charts().reduce((count, chart, i) => count + (chart === once[i] ? 0 : 1), 0);
    const withPrepass = overdrawn();
    for (const { depth } of meshes) depth.visible = false;
    const without = overdrawn();
    for (const { depth, meshes: [mesh] } of meshes) {
      depth.visible = true;
      mesh.material.blending = 1;
    }
    return [withPrepass, without];
  });
  check(prepass === 0, `${prepass} pixels are decoded more than once`);
  check(none > 100, `without the pre-pass only ${none} pixels would be decoded more than once: this view proves nothing`);
  say('hidden fragments', { prepass, none });
}

async function picks(page) {
  const sample = await page.evaluate(() => {
    const view = document.querySelector('kiln-viewer');
    const found = view.pickAt(view.clientWidth / 2, view.clientHeight / 2);
    return found && { ...found, coded: [...found.coded], radiance: [...found.radiance] };
  });
  check(sample && sample.coded.length === sample.grid.nTheta * sample.grid.nPhi * 3, `no texel in the middle: ${JSON.stringify(sample)}`);
  check(sample.view.theta >= 0 && sample.view.theta <= 90 && sample.keptSamples >= 2, JSON.stringify(sample.view));
  check(sample.radiance.some((v) => v > 0), 'the hemisphere is black');
  check((await viewer(page, '(v) => v.pickAt(1, 1)')) === null, 'something is picked where nothing is');
}

async function keyboard(page) {
  await page.locator('kiln-viewer canvas').focus();
  const orbit = () => viewer(page, '(v) => v.getCameraOrbit()');
  const first = await orbit();
  await page.keyboard.press('ArrowRight');
  check(Math.abs((await orbit()).theta - first.theta) > 1, 'the right arrow does not turn');
  await page.keyboard.press('ArrowUp');
  check((await orbit()).phi < first.phi, 'the up arrow does not lift the eye');
  await page.keyboard.press('+');
  check((await orbit()).radius < first.radius, 'plus does not come nearer');
  const target = await viewer(page, '(v) => v.getCameraTarget()');
  await page.keyboard.press('Shift+ArrowLeft');
  check(String(await viewer(page, '(v) => v.getCameraTarget()')) !== String(target), 'Shift and the left arrow do not pan');
  await page.keyboard.press('Home');
  const home = await orbit();
  check(Math.abs(home.theta - first.theta) < 1e-3 && Math.abs(home.radius - first.radius) < 1e-3, 'Home does not go back');
}

async function budget(page) {
  const all = await viewer(page, '(v) => v.stats.textureBytes');
  const mib = all / 3 / 2 ** 20;
  await viewer(page, "(v, mib) => { v.scheme = 'auto'; v.memoryBudget = mib; }", mib);
  await settled(page);
  const { schemes, textureBytes } = await viewer(page, '(v) => v.stats');
  check((schemes.streamed ?? 0) > 0 && (schemes.expanded ?? 0) > 0, `a third of the memory is not shared out: ${JSON.stringify(schemes)}`);
  check(textureBytes <= mib * 2 ** 20, `${textureBytes} bytes of textures pass the budget of ${mib} MiB`);
  say('budget', { budget: mib * 2 ** 20, textureBytes, schemes });
  await viewer(page, '(v) => { v.memoryBudget = 1 / 1024; }');
  await settled(page);
  check((await viewer(page, '(v) => v.stats.schemes.mean')) > 0, 'with next to no memory something else than the mean is shown');
  check((await look(page)).mean > 10, 'with next to no memory not even the mean is shown');
  await viewer(page, "(v) => { v.mode = 'error'; }");
  await page.locator('kiln-viewer').getByText('set memory-budget to').waitFor();
  check((await viewer(page, '(v) => v.mode')) === 'light-field', 'the mode stays at errors that cannot be drawn');
  await viewer(page, "(v) => { v.memoryBudget = 512; v.mode = 'error'; }");
  await settled(page);
  check(await page.locator('kiln-viewer').getByText('set memory-budget to').isHidden(), 'the message stays when errors are drawn');
  await viewer(page, "(v) => { v.mode = 'light-field'; }");
}

async function lostContext(page, src) {
  await load(page, { scheme: 'expanded', filter: 'hardware', src });
  const before = await look(page);
  await viewer(page, '(v) => { v.lose = v.shadowRoot.querySelector("canvas").getContext("webgl2").getExtension("WEBGL_lose_context"); v.lose.loseContext(); }');
  await page.locator('kiln-viewer').getByText('The GPU was taken away').waitFor();
  await page.waitForTimeout(100);
  await viewer(page, '(v) => v.lose.restoreContext()');
  const start = Date.now();
  for (;;) {
    const now = await look(page);
    if (now.hash === before.hash) break;
    check(Date.now() - start < 30_000, `the picture does not come back: ${JSON.stringify([before, now])}`);
    await page.waitForTimeout(100);
  }
  check(await page.locator('kiln-viewer').getByText('The GPU was taken away').isHidden(), 'the message stays when the picture is back');
}

/** A second viewer with its camera in attributes, a poster of its page's, and nobody who may move it. */
async function attributes(page, src) {
  const found = await page.evaluate(async (src) => {
    const viewer = document.createElement('kiln-viewer');
    const poster = document.createElement('p');
    poster.slot = 'poster';
    poster.textContent = 'Please wait';
    viewer.append(poster);
    for (const [name, value] of Object.entries({ 'camera-orbit': '45deg 75deg 4m', 'camera-target': '5m 1m 5m', 'field-of-view': '30deg', alt: 'A room' })) {
      viewer.setAttribute(name, value);
    }
    Object.assign(viewer.style, { position: 'fixed', inset: '0', width: '400px', height: '300px' });
    const loaded = new Promise((resolve) => viewer.addEventListener('load', resolve, { once: true }));
    viewer.src = src;
    document.body.append(viewer);
    const before = poster.checkVisibility();
    await loaded;
    const canvas = viewer.shadowRoot.querySelector('canvas');
    const out = {
      orbit: viewer.getCameraOrbit(), target: viewer.getCameraTarget(), fov: viewer.getFieldOfView(), poster: [before, poster.checkVisibility()],
      label: canvas.getAttribute('aria-label'), role: canvas.getAttribute('role'), stop: canvas.tabIndex,
    };
    // Resized, it stays where it was aimed.
    viewer.style.height = '200px';
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    out.after = viewer.getCameraOrbit();
    viewer.remove();
    return out;
  }, src);
  for (const { theta, phi, radius } of [found.orbit, found.after]) {
    check(Math.abs(theta - 45) < 1e-3 && Math.abs(phi - 75) < 1e-3 && Math.abs(radius - 4) < 1e-3, `the orbit is another: ${JSON.stringify(found)}`);
  }
  check(String(found.target) === '5,1,5' && found.fov === 30, `target or field of view are others: ${JSON.stringify(found)}`);
  check(found.poster[0] && !found.poster[1], 'a slotted poster does not come, or does not go');
  check(found.label === 'A room' && found.role === 'img' && found.stop === -1, `a still view promises more than it does: ${JSON.stringify(found)}`);
}

/** Where the worker's script cannot be had, blocks are decoded in place. */
async function withoutWorkers(url, gpu) {
  const { browser, page } = await open(gpu);
  await page.route(/expand\.worker/, (route) => route.fulfill({ status: 404, body: '' }));
  await page.goto(url);
  await page.waitForFunction(() => document.querySelector('kiln-viewer').loaded);
  check((await look(page)).mean > 10, 'without workers nothing is drawn');
  await browser.close();
}

/** A driver that does not compile a shader: what it says is shown, not swallowed. */
async function brokenShader(url, gpu) {
  const { browser, page } = await open(gpu);
  await page.addInitScript(() => {
    const compile = WebGL2RenderingContext.prototype.shaderSource;
    WebGL2RenderingContext.prototype.shaderSource = function (shader, source) {
      compile.call(this, shader, source.includes('lfSamples') ? `${source}\nthis is no GLSL` : source);
    };
  });
  await page.goto(url);
  await page.locator('kiln-viewer').getByText('does not compile a shader').waitFor();
  await browser.close();
}

await script(async ([url, gpu]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(url);
  const src = await page.evaluate(() => document.querySelector('kiln-viewer').src);
  await modes(page, src);
  await hiddenFragments(page);
  await picks(page);
  await keyboard(page);
  await budget(page);
  check(faults.length === 0, faults.join('\n'));
  await attributes(page, src);
  check(faults.length === 0, faults.join('\n'));
  await lostContext(page, src);
  await browser.close();
  await withoutWorkers(url, gpu);
  await brokenShader(url, gpu);
});
