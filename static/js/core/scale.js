// How large the page is beside its usual size: the style sheets are in rem, so all of it grows with the browser's font.

/** @type {number | undefined} */
let found;

/** 1 where the browser's font has 16 px. What a script draws or measures in pixels of the usual size is multiplied by it. */
export function scale() {
  found ??= parseFloat(getComputedStyle(document.documentElement).fontSize) / 16 || 1;
  return found;
}
