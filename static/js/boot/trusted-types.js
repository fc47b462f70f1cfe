// The one policy by which a text may become markup or a script's address (Trusted Types): by equality with a few texts of
// our own. Everything else is refused by the browser, wherever it comes from. Imported first, before anything can need it.

/** Leaflet tries once whether the browser knows SVG. */
const MARKUP = ['<svg/>'];
/** The thread that draws the scan. */
export const PAINTER = new URL('../scan/scan-painter.js', import.meta.url).href;
const SCRIPTS = ['/worker.js', PAINTER];

/** @typedef {{createPolicy(name: string, rules: Record<string, (text: string) => string | null>): unknown}} Factory */

const factory = /** @type {{trustedTypes?: Factory}} */ (globalThis).trustedTypes;
factory?.createPolicy('default', {
  createHTML: (text) => (MARKUP.includes(text) ? text : null),
  createScriptURL: (text) => (SCRIPTS.includes(text) ? text : null),
});
