/** The element's styles, as a constructable sheet: a `<style>` element would be refused by the pages' Content-Security-Policy. */

export const STYLE = `
:host { display: block; position: relative; width: 300px; height: 150px; contain: strict; background: #202428; color-scheme: dark; }
:host([hidden]) { display: none; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; display: block; touch-action: none; outline: none; }
canvas.still { touch-action: auto; }
canvas:focus-visible { outline: 3px solid #6cf; outline-offset: -3px; }
.poster, .progress { position: absolute; inset: 0; pointer-events: none; }
.picture { display: block; width: 100%; height: 100%; background: center / contain no-repeat; }
.bar { height: 3px; background: #fff3; }
.bar > div { height: 100%; width: 100%; transform-origin: left; transform: scaleX(0); background: #6cf; }
.message { position: absolute; left: 0; right: 0; bottom: 0; padding: 0.6em 1em; background: #5b0f14; color: #fff; font: 14px/1.4 system-ui, sans-serif; }
[hidden] { display: none !important; }
`;
