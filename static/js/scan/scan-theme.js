// What the drawing of the scan has of the style sheet.

const COLOURS = /** @type {const} */ (['panel', 'line', 'ink', 'ink2', 'you', 'hatch', 'raise']);

/**
 * @typedef {object} Theme
 * @property {string} key another look has another
 * @property {Record<typeof COLOURS[number], string>} colour
 * @property {string} font family
 */

/** Colours and font as the style sheet has them now. @param {HTMLElement} beside where a probe may stand @returns {Theme} */
export function themeAt(beside) {
  const colour = /** @type {Theme['colour']} */ ({});
  const probe = document.createElement('i');
  beside.after(probe);
  for (const name of COLOURS) {
    probe.style.color = `var(--${name})`;
    colour[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  const font = getComputedStyle(document.documentElement).getPropertyValue('--digits').trim() || 'sans-serif';
  return { key: `${Object.values(colour)} ${font}`, colour, font };
}

/**
 * The fonts of the page's styles with their bytes, for a thread that draws. Those that cannot be fetched are left out.
 * @returns {Promise<import('./scan-painter.js').Font[]>}
 */
export async function fontsOfStyles() {
  const found = [];
  for (const sheet of document.styleSheets) {
    for (const rule of sheet.cssRules) {
      if (!(rule instanceof CSSFontFaceRule)) continue;
      const valueOf = (/** @type {string} */ name) => rule.style.getPropertyValue(name).replaceAll('"', '');
      const [, address] = /url\(([^)]+)\)/.exec(valueOf('src')) ?? [];
      if (address) found.push(fetched(valueOf('font-family'), valueOf('font-weight'), new URL(address, sheet.href ?? location.href)));
    }
  }
  return (await Promise.all(found)).flat();
}

/** @param {string} family @param {string} weight @param {URL} address */
async function fetched(family, weight, address) {
  try {
    const answer = await fetch(address);
    return answer.ok ? [{ family, weight, bytes: await answer.arrayBuffer() }] : [];
  } catch {
    return []; // not accessible: text is drawn in the system's own font
  }
}
