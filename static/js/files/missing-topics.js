// The text of which topics of the car are not in the current recording.

/**
 * Names, and how many more there are: "/a, /b and 7 more".
 * @param {string[]} names @param {number} [count] of all
 */
export function namesWords(names, count = names.length) {
  return names.join(', ') + (count > names.length ? ` and ${count - names.length} more` : '');
}

/**
 * Which of the car's topics are not recorded, and why; empty where all are.
 * @param {{left_out?: string[], left_out_count?: number, not_received?: string[], not_received_count?: number,
 *   too_large?: {topic: string, mb: number}[], too_large_count?: number, as_json?: number}} recorder
 */
export function missingWords({ left_out = [], left_out_count, not_received = [], not_received_count, too_large = [], too_large_count, as_json = 0 }) {
  const large = new Map(too_large.map(({ topic, mb }) => [topic, mb]));
  const names = left_out.filter((topic) => !large.has(topic));
  const others = left_out_count === undefined ? names.length : left_out_count - (too_large_count ?? large.size);
  const sizes = [...large].map(([topic, mb]) => `${topic} (${Math.round(mb)} MB a message)`);
  return [
    names.length ? `Not recorded: ${namesWords(names, others)}.` : '',
    large.size ? `Too large to record: ${namesWords(sizes, too_large_count)}.` : '',
    not_received.length ? `No messages from: ${namesWords(not_received, not_received_count)}.` : '',
    as_json ? `${as_json} messages stored as JSON: their type definition is unknown or does not match.` : '',
  ].filter(Boolean).join(' ');
}
