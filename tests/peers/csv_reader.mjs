// A strict reader of RFC 4180: CRLF after each row, quotes around whole fields only, as many fields in each row.
// Usage: node csv_reader.mjs FILE… prints the number of rows of each, or its error, as JSON.
import { readFileSync } from 'node:fs';

import { parse } from 'csv-parse/sync';

const QUOTED = /"(?:[^"]|"")*"/g;

const found = process.argv.slice(2).map((file) => {
  try {
    const rows = parse(readFileSync(file), { record_delimiter: '\r\n', bom: false, raw: true });
    const wrong = rows.findIndex(({ raw }) => /[\r\n]/.test(raw.replace(QUOTED, '').replace(/\r\n?$/, '')));
    return wrong < 0 ? rows.length : `row ${wrong + 1} has the end of a line that is not CRLF`;
  } catch (error) {
    return String(error);
  }
});
process.stdout.write(JSON.stringify(found));
