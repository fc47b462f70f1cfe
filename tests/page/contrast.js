// @ts-nocheck evaluated in the page by test_contrast.py: each text in sight with its contrast against what is painted under it; the worst first.
() => {
  const rgb = (text) => {
    if (!/^rgba?\(/.test(text)) throw new Error(`not a colour in rgb: ${text}`);
    return text.match(/[\d.]+/g).map(Number);
  };
  /** A colour that lets `under` through. */
  const over = ([r, g, b, share = 1], under) => [r, g, b].map((c, n) => c * share + under[n] * (1 - share));
  const opacity = (one) => {
    let share = 1;
    for (let at = one; at; at = at.parentElement) share *= Number(getComputedStyle(at).opacity);
    return share;
  };
  const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, n) => sum + c * [0.2126, 0.7152, 0.0722][n], 0);
  const ratio = (a, b) => {
    const [low, high] = [light(a), light(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const ground = (one, style) => {
    if (one.closest('.gauge[data-over] :is(.speed, .note)')) return rgb(getComputedStyle(document.querySelector('.gauge .box')).fill);
    if (style.paintOrder.startsWith('stroke') && style.stroke !== 'none') return rgb(style.stroke); // an edge of its own, over a map
    for (let at = one; at; at = at.parentElement) {
      const found = rgb(getComputedStyle(at).backgroundColor);
      if ((found[3] ?? 1) > 0) return found;
    }
    return rgb(getComputedStyle(document.body).backgroundColor);
  };
  /** A key that takes no press is dimmed, and so are all that a dialog holds back. */
  const isOff = (one) => {
    if (one.closest(':disabled, [aria-disabled="true"]')) return true;
    for (let at = one; at; at = at.parentElement) if (Number(getComputedStyle(at).opacity) < 1 && at.closest('[data-held] #monitor')) return true;
    return false;
  };
  const isSeen = (one) => one.checkVisibility({ visibilityProperty: true, opacityProperty: true, contentVisibilityAuto: true }) && !one.closest('.veil:not([data-on]), .undrawn, .unseen, .panel[inert], [data-folded]');
  const found = [];
  const note = (one, text, style) => {
    const ink = rgb(one instanceof SVGElement ? style.fill : style.color);
    const part = one.closest('.gauge') ? 'gauge' : one.closest('.rail, .ledge') ? 'rail' : '';
    const under = ground(one, style);
    const [r, g, b, share = 1] = ink;
    found.push({ ratio: ratio(over([r, g, b, share * opacity(one)], under), under), text: text.trim(), ink: one.dataset.ink ?? '', part });
  };
  for (const root of document.querySelectorAll('#monitor, dialog[open], .snacks')) {
    const walk = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
    while (walk.nextNode()) {
      const one = walk.currentNode.parentElement;
      const text = walk.currentNode.data;
      if (/[\p{L}\p{N}]/u.test(text) && isSeen(one) && !isOff(one)) note(one, text, getComputedStyle(one));
    }
    for (const one of root.querySelectorAll('input:not([type=range], [type=checkbox]), textarea, select')) {
      const text = one.value || one.placeholder;
      if (text && isSeen(one) && !isOff(one)) note(one, text, getComputedStyle(one, one.value ? null : '::placeholder'));
    }
  }
  return found.sort((a, b) => a.ratio - b.ratio);
};
