// What the pages of one browser share: one of them delivers at a time, and a voice that is spoken in one is not ended by another.
// A browser that has no locks, as for an address without HTTPS, does as if there were one page.

const NAME = 'catgraph-marks';

function locks() {
  return globalThis.navigator?.locks;
}

/** Act while no other page does the same. @param {string} what @param {() => Promise<void>} act @returns {Promise<void>} */
export async function alone(what, act) {
  let isBegun = false;
  const begun = () => {
    isBegun = true;
    return act();
  };
  try {
    await (locks()?.request(`${NAME} ${what}`, begun) ?? begun());
  } catch (error) {
    if (isBegun) throw error;
    await act(); // locks are refused here
  }
}

export class Spoken {
  /** Those of this page, with what ends them. @type {Map<string, () => void>} */
  #own = new Map();

  /** A voice is spoken in this page. @param {string} id of its mark */
  begin(id) {
    if (this.#own.has(id)) return;
    const ended = new Promise((resolve) => { this.#own.set(id, () => resolve(undefined)); });
    locks()?.request(voiceOf(id), () => ended).catch(() => {});
  }

  /** @param {string} id */
  end(id) {
    this.#own.get(id)?.();
    this.#own.delete(id);
  }

  /** Whether each is spoken in some page now; null: that cannot be known. @returns {Promise<((id: string) => boolean) | null>} */
  async all() {
    const { held } = (await locks()?.query().catch(() => null)) ?? {};
    if (!held) return null;
    const names = new Set(held.map(({ name }) => name));
    return (id) => this.#own.has(id) || names.has(voiceOf(id));
  }
}

/** @param {string} id */
function voiceOf(id) {
  return `${NAME} voice ${id}`;
}
