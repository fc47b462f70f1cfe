// Whether the window has room for two recordings beside each other.

/** As in compare.css. */
export const WIDE = '(width >= 75em) and (height >= 43.75em)';
/** Why a second recording cannot be opened here. */
export const NO_ROOM = 'Two recordings are compared on a screen from 1200 × 700 px';

export function hasRoom() {
  return matchMedia(WIDE).matches;
}
