// What is inside every <p-mesh>: its shadow tree and style.

export const TEMPLATE = document.createElement("template");
TEMPLATE.innerHTML = `<style>
:host { display: inline-block; position: relative; width: 300px; height: 300px; contain: content; }
:host([hidden]) { display: none; }
canvas, .poster, .fallback { position: absolute; inset: 0; width: 100%; height: 100%; }
canvas { touch-action: none; outline: none; }
canvas:focus-visible { outline: 2px solid Highlight; outline-offset: -2px; }
:host(:not([camera-controls])) canvas { touch-action: auto; }
.poster { object-fit: contain; }
.shown .poster, .shown .fallback { display: none; }
.debug { position: absolute; left: 0; top: 0; margin: 6px; padding: 4px 8px; font: 11px/1.45 ui-monospace, monospace;
  background: rgb(10 16 24 / 72%); color: #e8eef4; border-radius: 4px; pointer-events: none; white-space: pre; }
.debug:empty { display: none; }
.message { position: absolute; inset: auto 8px 8px; margin: 0; font: 13px/1.4 system-ui, sans-serif; color: GrayText; pointer-events: none; }
.shown .message { display: none; }
.status { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
</style>
<div class="frame">
  <div class="fallback"><slot></slot></div>
  <img class="poster" part="poster" alt="" hidden>
  <canvas part="canvas" width="1" height="1"></canvas>
  <pre class="debug" part="debug" hidden></pre>
  <p class="message" part="message"></p>
  <span class="status" role="status"></span>
</div>`;
