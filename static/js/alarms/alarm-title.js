// The title of an alarm. A pure function.

/**
 * Of one that returned to normal, that it did.
 * @param {Pick<import('../core/protocol-types.js').CarAlarm, 'title' | 'ended_title' | 'active'>} alarm
 */
export function titleOf({ title, ended_title, active }) {
  return active ? title : ended_title ?? `${title}: ended`;
}
