// The outcome of a command as text: carried out, refused, not delivered, or not known. The only place with these texts.

/**
 * @typedef {import('./protocol-types.js').Reply} Reply
 * @typedef {NonNullable<Reply['outcome']>} Outcome
 * @typedef {NonNullable<Reply['became']> | 'done_late' | 'not_delivered'} Became the last two: from its own answer, which came late
 * @typedef {NonNullable<Reply['cut']> | 'page-server'} Cut
 * @typedef {Exclude<import('./protocol-types.js').PageMessage['kind'], 'hello' | 'take' | 'have' | 'watch' | 'replay' | 'present' | 'position' | 'outcome'>} Ordered
 */

/** It ends each sentence on a command of which it is not known whether it was carried out; the server's too. */
const MAYBE = 'It may have been carried out.';

/** What the key is called, where it is not called as the command. @type {Partial<Record<Ordered, string>>} */
const NAMES = {
  connect: 'Connect', retry: 'Retry', disconnect: 'Stop monitoring', pause: 'Pause', resume: 'Resume', record: 'Record',
  acknowledge: 'Acknowledge', silence: 'Silence', shelve: 'Shelve', unshelve: 'Unshelve', set: 'Change settings', import: 'Import settings',
  ride: 'Choose the phone in the car', control: 'Change control', arm: 'Arm', disarm: 'Disarm', slow_down: 'Slow down', release: 'Release the car', veto: 'Veto',
  take_item: 'Take it', release_item: 'Unassign', offer_item: 'Hand over', answer_item: 'Answer', withdraw_item: 'Withdraw',
  offer_control: 'Hand over', read_back: 'Confirm', take_alarm: 'Take over', end_planned_stop: 'End stop', accept_control: 'Take control', end_offer: 'End the hand-over',
};

/** Whether a sentence is on a command of which it is not known. @param {string} sentence */
export function isMaybe(sentence) {
  return sentence.includes(MAYBE);
}

/** Between which parts a command was lost. Of a silent broker and a silent agent a server cannot tell which it is. @type {Record<Cut, string>} */
const BETWEEN = {
  'page-server': 'this page and the server', 'server-broker': 'server and broker', 'broker-agent': 'server and agent', 'agent-car': 'the server or agent and the car',
};

/**
 * The reason why a command was not answered, with the part of the link that is cut.
 * @param {string} reason
 * @param {Outcome} outcome
 * @param {Cut} cut
 */
export function withCut(reason, outcome, cut) {
  const direction = outcome === 'unknown' ? ' Not known yet in which direction.' : '';
  return `${reason} The link is cut between ${BETWEEN[cut]}.${direction}`;
}

/** A sentence on a command that may have been carried out. @param {string} why */
export function maybe(why) {
  return `${why} ${MAYBE}`;
}

/**
 * What was found out later of a command that was not answered.
 * @param {string} kind
 * @param {Became} became
 * @param {string} reason where it was refused or not delivered
 * @param {Cut | null} cut where it was lost, where known
 * @returns {{title: string, text: string}}
 */
export function laterWords(kind, became, reason, cut) {
  const between = cut ? `, between ${BETWEEN[cut]}` : '';
  const name = `“${NAMES[/** @type {Ordered} */ (kind)] ?? kind.replaceAll('_', ' ')}”`;
  switch (became) {
    case 'done':
      return { title: 'Carried out', text: `${name} was carried out. Only its answer was lost: the link was cut in the direction back${between}.` };
    case 'done_late':
      return { title: 'Carried out', text: `${name} was carried out; its answer came late.` };
    case 'refused':
      return { title: 'Refused', text: `${name} was refused: ${reason || 'it is not known why.'}` };
    case 'never':
      return { title: 'Not carried out', text: `${name} was lost on its way. It is not carried out any more. The link was cut in the direction to the car${between}.` };
    case 'not_delivered':
      return { title: 'Not carried out', text: `${name} was not carried out${reason ? `: ${reason}` : '.'}` };
    default:
      return { title: 'Not known', text: `It is not known whether ${name} was carried out. Look at what the car shows.` };
  }
}
