// What a phone keeps of the work: forgotten once somebody removed it. How the page looks on it is its owner's, and stays.

/** Addresses of cars and of people, which car was shown, which of its questions were put off, where the map lay, when the server last answered. */
export const OF_THE_WORK = ['addresses', 'answered', 'car', 'later', 'mail-to', 'map', 'marks'];

/** @param {{removeItem: (key: string) => void} | null} storage */
export function forgetWork(storage) {
  globalThis.indexedDB?.deleteDatabase('catgraph-marks');
  for (const name of OF_THE_WORK) {
    try {
      storage?.removeItem(`catgraph.${name}`);
    } catch {
      return; // nothing is kept where nothing may be kept
    }
  }
}
