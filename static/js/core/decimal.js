// Decimal numbers as they are typed and shown, with the mark of this browser's language. Pure functions, no DOM.

/** By the language's name, as Intl has it: its first answer would delay the first values by 25 ms, on a slow phone by 100 ms. @type {Record<string, string>} */
export const KNOWN = { en: '.', 'en-US': '.', 'en-GB': '.', de: ',', 'de-DE': ',', 'de-AT': ',' };

/** The decimal mark of a language: "," in German, "." in English. @param {string} [language] of the browser */
export function markOf(language = globalThis.navigator?.language) {
  try {
    const known = KNOWN[language ?? ''];
    if (known) return known;
    return new Intl.NumberFormat(language).formatToParts(1.5).find(({ type }) => type === 'decimal')?.value === ',' ? ',' : '.';
  } catch {
    return '.'; // no language of this name
  }
}

/** Of this browser, once: every value that is drawn is written with it. */
const MARK = markOf();

/** A number in the way a program writes it, as this language writes it. @param {string} text @param {string} [mark] */
export function local(text, mark = MARK) {
  return mark === '.' ? text : text.replace('.', mark);
}

/**
 * Could its mark separate thousands? "1.100" is 1.1 to one reader and 1100 to another. In the language's own mark only what
 * ends with a needless zero is in doubt.
 * @param {string} text a typed number
 * @param {string} [mark] of the language
 */
export function isInDoubt(text, mark = MARK) {
  const found = /^[+-]?[1-9]\d{0,2}([.,])\d\d(\d)$/.exec(text);
  return found !== null && (found[1] !== mark || found[2] === '0');
}

/**
 * A typed number with comma or point; NaN: none, or one in doubt.
 * @param {string} typed
 * @param {string} [mark] of the language
 */
export function decimalOf(typed, mark = MARK) {
  const text = typed.trim();
  return text === '' || isInDoubt(text, mark) ? NaN : Number(text.replace(',', '.'));
}
