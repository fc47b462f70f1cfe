// Where recordings, exports, mail, and what belongs to marks are: at this server, or at a web node at the agent of a car, whose name stands in their addresses.

const KEPT = /^\/api\/(marks\/|(recordings|trash|exports|mail|logbook)(?=[/?.]|$))/;

/** The car whose agent keeps what this page shows; empty: this server keeps it. */
export function keptVehicle() {
  const { kept, vehicle } = globalThis.document?.documentElement.dataset ?? {};
  return kept === 'agents' ? vehicle ?? '' : '';
}

/**
 * An address of this server as it is to be requested now. The page changes to other cars: what outlasts such a change stores this address.
 * @param {string} path
 */
export function keptAt(path) {
  const vehicle = keptVehicle();
  return vehicle && KEPT.test(path) ? `/agents/${encodeURIComponent(vehicle)}${path}` : path;
}
