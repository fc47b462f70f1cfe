// Breaks one function of a browser and mends it again: by what it kept from the beginning, whatever is broken meanwhile.
(() => {
  const { defineProperty, getOwnPropertyDescriptor } = Object;
  const { apply } = Reflect;
  const broken = () => { throw new Error('broken for a test'); };
  const never = () => 0;
  const idle = () => undefined;
  const kinds = { broken, never, idle, mute: idle };
  let undo = null;
  const rootOf = { window, document, performance, JSON, Date, Object, Math };

  window.catgraphBreak = (owner, name, kind) => {
    const target = owner.endsWith('.prototype') ? window[owner.slice(0, -10)].prototype : (rootOf[owner] ?? window[owner]);
    const key = name === '@@iterator' ? Symbol.iterator : name;
    const was = getOwnPropertyDescriptor(target, key);
    if (!was) throw new Error(`there is no ${owner}.${name}`);
    const now = was.get || was.set ? { ...was, get: kind === 'set' || kind === 'mute' ? was.get : broken, set: was.set && (kinds[kind] ?? broken) } : { ...was, value: kinds[kind] };
    undo = () => { defineProperty(target, key, was); };
    defineProperty(target, key, now);
    return 'broken';
  };
  window.catgraphMend = () => { apply(undo, undefined, []); return 'mended'; };
})();
