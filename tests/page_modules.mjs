// What the page's modules consist of, as JSON: sizes of functions and classes in lines, and what each module imports.
// Usage: node page_modules.mjs <file> ...; addresses are as given, imports relative to the same folder.
import { readFileSync } from 'node:fs';
import path from 'node:path';

import { parseAst } from '@rollup/wasm-node/parseAst';

const FUNCTIONS = ['FunctionDeclaration', 'FunctionExpression', 'ArrowFunctionExpression'];
const CLASSES = ['ClassDeclaration', 'ClassExpression'];
const IMPORTS = ['ImportDeclaration', 'ExportNamedDeclaration', 'ExportAllDeclaration', 'ImportExpression'];

function factsOf(file) {
  const text = readFileSync(file, 'utf-8');
  const facts = { function: [], class: [], imports: [] };
  const linesOf = (node) => text.slice(node.start, node.end).split('\n').length;
  const walk = (node, name) => {
    if (FUNCTIONS.includes(node.type)) facts.function.push([node.id?.name ?? name, linesOf(node)]);
    if (CLASSES.includes(node.type)) facts.class.push([node.id?.name ?? name, linesOf(node)]);
    const source = IMPORTS.includes(node.type) ? node.source?.value : undefined;
    if (source?.startsWith('.')) facts.imports.push(path.normalize(path.join(path.dirname(file), source)));
    const inside = node.id?.name ?? node.key?.name ?? name;
    for (const [key, value] of Object.entries(node)) {
      for (const child of Array.isArray(value) ? value : [value]) {
        if (key !== 'parent' && child && typeof child.type === 'string') walk(child, inside);
      }
    }
  };
  walk(parseAst(text), '');
  return facts;
}

process.stdout.write(JSON.stringify(Object.fromEntries(process.argv.slice(2).map((file) => [file, factsOf(file)]))));
