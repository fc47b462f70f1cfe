// What of the car is not in the recording that is being made, in words.

/**
 * Which of the car's topics are not recorded, and why; empty where all are.
 * @param {{left_out?: string[], not_received?: string[], too_large?: {topic: string, mb: number}[], as_json?: number}} recorder
 */
export function missingWords({ left_out = [], not_received = [], too_large = [], as_json = 0 }) {
  const large = new Map(too_large.map(({ topic, mb }) => [topic, mb]));
  const names = left_out.filter((topic) => !large.has(topic));
  return [
    names.length ? `Not recorded: ${names.join(', ')}.` : '',
    large.size ? `Too large to record: ${[...large].map(([topic, mb]) => `${topic} (${Math.round(mb)} MB a message)`).join(', ')}.` : '',
    not_received.length ? `No message comes from: ${not_received.join(', ')}.` : '',
    as_json ? `${as_json} messages kept as JSON: not of their type, or its definition is not known.` : '',
  ].filter(Boolean).join(' ');
}
