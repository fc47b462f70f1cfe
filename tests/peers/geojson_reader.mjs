// The check of RFC 7946. Usage: node geojson_reader.mjs FILE prints its issues and the number of features, as JSON.
import { readFileSync } from 'node:fs';

import { check, getIssues } from '@placemarkio/check-geojson';

const text = readFileSync(process.argv[2], 'utf8');
const issues = getIssues(text);
process.stdout.write(JSON.stringify({ issues, features: issues.length ? 0 : check(text).features.length }));
