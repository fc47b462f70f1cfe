// Sharing a recording: the file itself where the phone takes it, else a link, else the link to copy by hand.

import { sizeWords } from './files-layout.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

const MOST_BYTES = 100_000_000; // held in the phone's memory while it is handed over

/**
 * @param {object} how
 * @param {Recording} how.row
 * @param {string} how.name
 * @param {string} how.address of the file
 * @param {(sentence: string) => void} how.say
 * @param {(label: string, act: () => void) => void} how.offer a key: phones share only at a press
 * @param {() => void} how.link shows the link to be copied
 * @param {() => void} how.done
 */
export async function share({ row, name, address, say, offer, link, done }) {
  const fileName = `${row.id}.${row.format}`;
  const type = 'application/octet-stream';
  if (!navigator.share) {
    const isCopied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
    say(`This browser cannot share. ${isCopied ? 'The link is copied:' : 'Copy this link:'} it works for anyone who can reach this server.`);
    link();
    return;
  }
  const trial = new File([new Uint8Array(1)], fileName, { type });
  if (!navigator.canShare?.({ files: [trial] }) || row.size_bytes > MOST_BYTES) {
    const why = row.size_bytes > MOST_BYTES ? `${sizeWords(row.size_bytes)} is too large for this device to share` : 'This device cannot share such files';
    say(`${why}: a link is shared instead. It works for anyone who can reach this server.`);
    offer('Share the link', () => hand({ title: name, url: address }, say, done));
    return;
  }
  say(`Fetching ${sizeWords(row.size_bytes)} from the server.`);
  try {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(String(answer.status));
    const file = new File([await answer.blob()], fileName, { type });
    say('Ready to share.');
    offer('Share the file', () => hand({ title: name, files: [file] }, say, done));
  } catch {
    say('It could not be loaded from the server. Try again.');
  }
}

/**
 * @param {ShareData} what
 * @param {(sentence: string) => void} say
 * @param {() => void} done
 */
async function hand(what, say, done) {
  try {
    await navigator.share(what);
    done();
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') return; // the operator thought better of it
    say('The phone refused the file. Download it instead.');
  }
}
