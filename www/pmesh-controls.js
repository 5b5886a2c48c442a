// Mouse, touch, wheel and keyboard to an orbit camera. Knows the canvas and the camera, nothing of meshes.

const RADIANS_PER_PIXEL = 0.008;
const KEY_STEP = 0.15;
const MAX_PITCH = 1.5;

/** A camera: yaw and pitch in radians, zoom 1 fits the model. */
export class OrbitCamera {
  yaw = 0.5;
  pitch = 0.25;
  zoom = 1;

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-MAX_PITCH, Math.min(MAX_PITCH, this.pitch + pitch));
  }
  scale(factor) {
    this.zoom = Math.max(0.2, Math.min(40, this.zoom * factor));
  }
  reset() {
    Object.assign(this, new OrbitCamera());
  }
}

/** Listens on `surface` until `signal` aborts; `moved()` is called after each change of `camera`. `keys` has what other keys do. */
export function attachControls(surface, camera, moved, signal, keys = {}) {
  const pointers = new Map();
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  const listen = (type, listener, options = {}) => surface.addEventListener(type, listener, { signal, ...options });

  listen("pointerdown", (event) => {
    if (event.button !== 0) return;
    try {
      surface.setPointerCapture(event.pointerId);
    } catch {
      // A pointer that is gone already, or was made by a script, cannot be captured; dragging works without.
    }
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  listen("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const before = pointers.size === 2 ? spread() : 0;
    const dx = event.clientX - last.x;
    const dy = event.clientY - last.y;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) camera.turn(-dx * RADIANS_PER_PIXEL, dy * RADIANS_PER_PIXEL);
    else if (pointers.size === 2 && before > 0) camera.scale(spread() / before);
    moved();
  });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
    listen(type, (event) => pointers.delete(event.pointerId));
  }
  listen(
    "wheel",
    (event) => {
      event.preventDefault();
      // Lines and pages to pixels.
      const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
      camera.scale(Math.exp(-Math.max(-200, Math.min(200, pixels)) * 0.002));
      moved();
    },
    { passive: false },
  );
  listen("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions = {
      ArrowLeft: () => camera.turn(-KEY_STEP, 0),
      ArrowRight: () => camera.turn(KEY_STEP, 0),
      ArrowUp: () => camera.turn(0, KEY_STEP),
      ArrowDown: () => camera.turn(0, -KEY_STEP),
      "+": () => camera.scale(1.15),
      "=": () => camera.scale(1.15),
      "-": () => camera.scale(1 / 1.15),
      Home: () => camera.reset(),
      ...keys,
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
    moved();
  });
}
