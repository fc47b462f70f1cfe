// How the page's modules are joined; server/web/assets/bundle.py runs this with the input and the output folder.
//
// What several parts share is put into what is loaded already when they are needed, so that a page begins with one script.

import { env } from 'node:process';

/** Into `joined.json`: the script that begins the page, and what it loads at once. */
const list = {
  name: 'list',
  generateBundle(_, bundle) {
    const script = Object.keys(bundle).find((name) => bundle[name].isEntry);
    const found = new Set([script]);
    for (const name of found) for (const one of bundle[name].imports) if (one in bundle) found.add(one);
    const [, ...needed] = found;
    this.emitFile({ type: 'asset', fileName: 'joined.json', source: JSON.stringify({ script, needed }) });
  },
};

/** The address of a script for a thread of its own, which is joined before: it holds the hash of what is in it. */
const threads = {
  name: 'threads',
  transform(code) {
    for (const [plain, hashed] of Object.entries(JSON.parse(env.CATGRAPH_THREADS))) code = code.replaceAll(`'${plain}'`, `'./${hashed}'`);
    return { code, map: null };
  },
};

/** The addresses of what is fetched later and not joined: they hold a hash, so that it may be kept and is never mixed with another build. */
const later = {
  name: 'later',
  transform(code) {
    for (const [plain, hashed] of Object.entries(JSON.parse(env.CATGRAPH_STYLES))) {
      code = code.replaceAll(`styled('${plain}')`, `styled('${hashed}')`).replaceAll(`'/static/css/${plain}.css'`, `'/static/built/${hashed}.css'`);
    }
    return { code: code.replaceAll('`/static/css/${', '`/static/built/${'), map: null };
  },
  renderChunk(code) {
    const vendor = JSON.parse(env.CATGRAPH_VENDOR);
    return { code: code.replaceAll(/'(?:\.\.\/)+vendor\/([\w.-]+)'/g, (_, name) => `'../vendor/${name}?v=${vendor[name]}'`), map: null }; // joined files stand one folder higher
  },
};

export default {
  input: env.CATGRAPH_ENTRY,
  external: /\.\.\/vendor\//,
  makeAbsoluteExternalsRelative: false,
  plugins: [threads, later, list],
  output: {
    dir: env.CATGRAPH_INTO,
    format: 'es',
    entryFileNames: '[name]-[hash].js',
    chunkFileNames: '[name]-[hash].js',
    // Two scripts of which a browser fetches both at once: over a slow link the first picture comes sooner. Only maps need
    // geodesy, and they come later.
    manualChunks: (id) => (/\/js\/core\/(?!geodesy\.js)/.test(id) ? 'core' : undefined),
  },
};
