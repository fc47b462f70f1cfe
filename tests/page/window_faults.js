// @ts-nocheck evaluated in the page by test_wide.py: what is wrong at the size its window has now.
(mostEmpty) => {
  const box = (one) => one.getBoundingClientRect();
  const seen = (one) => one.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true }) && !one.closest('[inert]') && box(one).width > 0;
  const within = (a, b) => ({ left: Math.max(a.left, b.left), right: Math.min(a.right, b.right), top: Math.max(a.top, b.top), bottom: Math.min(a.bottom, b.bottom) });
  const all = (selector) => [...document.querySelectorAll(selector)].filter(seen);
  const name = (one) => one.dataset.part ?? one.dataset.panel ?? one.dataset.pane ?? one.className;
  const view = box(document.querySelector('#monitor > .view'));
  const panes = all('#monitor :is(.gbox, .drive > .block, .pane, .alarms-pane, .log-pane, .wall-pane)');
  const parts = [...all('#monitor > :is(.top, .strip, .replay-band, .under, .rail, .scrub)').map((one) => [name(one), box(one)]),
    ...panes.map((one) => [name(one), within(box(one), view)]).filter(([, at]) => at.right > at.left && at.bottom > at.top)];
  const wrong = [];
  parts.forEach(([a, one], n) => {
    for (const [b, two] of parts.slice(n + 1)) {
      const both = within(one, two);
      if (both.right - both.left > 2 && both.bottom - both.top > 2) wrong.push(`${a} over ${b}`);
    }
    if (one.left < -1 || one.right > innerWidth + 1 || one.top < -1 || one.bottom > innerHeight + 1) wrong.push(`${a} outside`);
  });
  const inner = box(document.querySelector('#monitor > .strip')).width; // within the frame of an active critical alarm
  for (const one of all('#monitor .under > :not(.unseen)')) if (box(one).width < inner - 1) wrong.push(`${one.className} of ${Math.round(box(one).width)}`);
  const isFloor = all('#monitor .alarms-pane').length > 0;
  if (isFloor) {
    for (const pane of panes) {
      const at = box(pane);
      if (at.bottom > view.bottom + 1 || at.right > view.right + 1) wrong.push(`${name(pane)} sliced`);
      if (pane.matches('.pane, .alarms-pane') && (at.width < 180 || at.height < 96)) wrong.push(`${name(pane)} of ${Math.round(at.width)} × ${Math.round(at.height)}`);
    }
  }
  const bar = all('#monitor > .top > *, #monitor > .tabs > *, #monitor > :is(.clock, .bar-speed)');
  bar.forEach((one, n) => bar.slice(n + 1).forEach((two) => {
    const both = within(box(one), box(two));
    if (!one.contains(two) && both.right - both.left > 2 && both.bottom - both.top > 2) wrong.push(`${one.className} ${one.textContent.trim()} over ${two.textContent.trim()} in the bar`);
  }));
  const cut = all('#monitor :is(.checks b, .tabs button, .rail .key, .rail .slide .tx, .ph, .near, .block .v, .block .lab, .alarms-foot .key)')
    .filter((one) => (isFloor || !one.closest('.checks')) && one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).display !== 'inline');
  wrong.push(...cut.map((one) => `${one.className} ${one.textContent.trim()} cut`));
  // The window as squares of 20 px; what has text or a picture is not empty.
  const side = 20;
  const [columns, rows] = [Math.floor(innerWidth / side), Math.floor(innerHeight / side)];
  const full = Array.from({ length: rows }, () => new Uint8Array(columns));
  const fill = (at) => {
    for (let y = Math.max(0, Math.floor(at.top / side)); y < Math.min(rows, at.bottom / side); y += 1) full[y].fill(1, Math.max(0, Math.floor(at.left / side)), Math.max(0, Math.min(columns, Math.ceil(at.right / side))));
  };
  for (const one of all('#monitor :is(svg, canvas, button, input, .mapbox)')) fill(box(one));
  const texts = document.createTreeWalker(document.querySelector('#monitor'), NodeFilter.SHOW_TEXT);
  const range = document.createRange();
  while (texts.nextNode()) {
    if (!texts.currentNode.data.trim() || !seen(texts.currentNode.parentElement)) continue;
    range.selectNodeContents(texts.currentNode);
    for (const at of range.getClientRects()) fill(at);
  }
  const heights = new Array(columns).fill(0);
  let most = { area: 0 };
  for (let y = 0; y < rows; y += 1) {
    for (let x = 0; x < columns; x += 1) heights[x] = full[y][x] ? 0 : heights[x] + 1;
    for (let x = 0; x < columns; x += 1) {
      let low = heights[x];
      for (let to = x; to < columns && low > 0; to += 1) {
        low = Math.min(low, heights[to]);
        const area = low * (to - x + 1);
        if (area > most.area) most = { area, at: [x * side, (y - low + 1) * side, (to + 1) * side, (y + 1) * side] };
      }
    }
  }
  const share = most.area / (columns * rows);
  if (share > mostEmpty) wrong.push(`${Math.round(100 * share)} % empty at ${most.at}`);
  return wrong;
};
