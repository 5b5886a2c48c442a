// The element's attributes as properties, and values read from text.

const TEXTS = ["src", "background", "alt", "poster", "loading"];
const NUMBERS = ["level", "max-triangles", "auto-level", "screen-error", "max-memory"];
const FLAGS = ["camera-controls", "auto-rotate", "wireframe", "frozen", "view-dependent"];

export const ATTRIBUTES = [...TEXTS, ...NUMBERS, ...FLAGS, "debug"];

const camel = (name) => name.replace(/-(.)/g, (_, letter) => letter.toUpperCase());

/** The properties that reflect them. */
export const PROPERTIES = ATTRIBUTES.map(camel);

/** Defines a property for each attribute. Numbers are null where the attribute is absent or not a number. */
export function reflectAttributes(prototype) {
  const define = (name, get, set) =>
    Object.defineProperty(prototype, camel(name), { get, set, enumerable: true, configurable: true });
  const setText = (name) =>
    function (value) {
      if (value == null) this.removeAttribute(name);
      else this.setAttribute(name, value);
    };
  for (const name of TEXTS) {
    define(name, function () { return this.getAttribute(name) ?? ""; }, setText(name));
  }
  for (const name of NUMBERS) {
    const get = function () {
      const value = Number.parseFloat(this.getAttribute(name) ?? "");
      return Number.isNaN(value) ? null : value;
    };
    define(name, get, setText(name));
  }
  for (const name of FLAGS) {
    define(name, function () { return this.hasAttribute(name); }, function (value) { this.toggleAttribute(name, Boolean(value)); });
  }
  define("debug", function () { return this.getAttribute("debug"); }, function (value) {
    if (value == null || value === false) this.removeAttribute("debug");
    else this.setAttribute("debug", value === true ? "" : value);
  });
}

const colors = new Map();

/** A CSS colour as red, green, blue, alpha, 0 to 1; null if it is none. */
export function parseColor(text) {
  if (!colors.has(text)) colors.set(text, CSS.supports("color", text) ? drawnColor(text) : null);
  return colors.get(text);
}

function drawnColor(text) {
  const probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  probe.fillStyle = text;
  probe.fillRect(0, 0, 1, 1);
  return [...probe.getImageData(0, 0, 1, 1).data].map((byte) => byte / 255);
}
