// Elements, colours and canvases of the report.

export function must(/** @type {string} */ id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no ${id}`);
  return found;
}

/** @param {string} tag @param {Record<string, string>} [attributes] @param {(Node | string)[]} children */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

export function icon(/** @type {string} */ name) {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('class', 'i');
  svg.setAttribute('aria-hidden', 'true');
  const use = document.createElementNS('http://www.w3.org/2000/svg', 'use');
  use.setAttribute('href', `#${name}`);
  svg.append(use);
  return svg;
}

/** The colours that the style sheet gives each token, until the theme changes. @type {Map<string, string>} */
export const colours = new Map();
const probe = document.createElement('i');
probe.hidden = true;
document.body.append(probe);

export function colour(/** @type {string} */ token) {
  let found = colours.get(token);
  if (found === undefined) {
    probe.style.color = `var(--${token})`;
    found = getComputedStyle(probe).color;
    colours.set(token, found);
  }
  return found;
}

export const INKS = { ink: 'ink', ink2: 'edge', order: 'order', you: 'you' };

/** Clears a canvas and gives it the resolution of the screen. */
export function fitted(/** @type {HTMLCanvasElement} */ canvas) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return { ctx, width, height };
}
