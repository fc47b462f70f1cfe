// @ts-nocheck evaluated in the page by test_overlaps.py: what lies over what can be pressed, or over a safety text, in this window.
() => {
  const box = (one) => one.getBoundingClientRect();
  const isSeen = (one) => one.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true, opacityProperty: true }) && !one.closest('[inert], .unseen') && box(one).width > 1 && box(one).height > 1;
  const all = (selector, root = document) => [...root.querySelectorAll(selector)].filter(isSeen);
  const within = (a, b) => ({ left: Math.max(a.left, b.left), right: Math.min(a.right, b.right), top: Math.max(a.top, b.top), bottom: Math.min(a.bottom, b.bottom) });
  const area = ({ left, right, top, bottom }) => (right - left > 1 && bottom - top > 1 ? Math.round((right - left) * (bottom - top)) : 0);
  /** What of an element is not cut by what it lies in. */
  const shown = (one) => {
    let at = within(box(one), { left: 0, top: 0, right: innerWidth, bottom: innerHeight });
    for (let up = one.parentElement; up && up !== document.body; up = up.parentElement) {
      if (up.matches('dialog:modal')) return within(at, box(up));
      const { display, overflowX, overflowY } = getComputedStyle(up);
      if (display === 'contents') continue; // it has no box
      if (overflowX !== 'visible') at = { ...at, left: Math.max(at.left, box(up).left), right: Math.min(at.right, box(up).right) };
      if (overflowY !== 'visible') at = { ...at, top: Math.max(at.top, box(up).top), bottom: Math.min(at.bottom, box(up).bottom) };
    }
    return at;
  };
  const name = (one) => (one.id || one.dataset.f || one.dataset.tab || one.getAttribute('aria-label') || one.textContent.trim().slice(0, 24) || one.className).trim();
  const KEYS = 'button, a[href], input, select, textarea';
  const SAFETY = '.gauge .speed, .strip > [data-f="strip-text"], .slide .tx, .rail-note, .snack .tx > *, .sheet h2, .sheet .bd p, .sheet-head > *, .versus .v, .alarms .t, .order, .plate p, .head-speed, .bar-speed';
  const LAYERS = '.snack, dialog[open], #monitor > :is(.top, .tabs, .titlebar, .strip, .under, .ledge, .rail, .scrub), .view > .screen, .pager';
  const layerOf = (one) => one.closest(LAYERS) ?? one.closest('.board');
  const items = all(`:is(${KEYS}), ${SAFETY}`).map((one) => ({ one, layer: layerOf(one), at: shown(one) })).filter(({ layer, at }) => layer && area(at));
  /** What can be scrolled from under the bar that lies over its end. */
  const rolls = (one, over) => {
    for (let up = one.parentElement; up && !up.matches('#monitor'); up = up.parentElement) {
      if (up.scrollHeight > up.clientHeight + 1 && /auto|scroll/.test(getComputedStyle(up).overflowY)) return parseFloat(getComputedStyle(up).paddingBottom) >= box(up).bottom - box(over).top - 2;
    }
    return false;
  };
  /** Layers that are meant to lie over the values: a sheet, a screen, an alarm, which carry or leave free the speed. */
  const isMeant = (over, { one, layer }) => {
    if (over === layer || over.contains(one) || layer.contains(over)) return true;
    const isSpeed = one.matches('.gauge .speed');
    if (over.matches('.rail') && layer.matches('.ledge')) return one.contains(document.elementFromPoint((box(one).left + box(one).right) / 2, (box(one).top + box(one).bottom) / 2)); // it stands between its keys
    if (over.matches('.sheet.crit')) return layer.matches('#monitor > :is(.rail, .ledge, .scrub)') || (layer.matches('.pager, .screen') && !isSpeed) || one.matches(KEYS) && !layer.matches('.snack, .sheet.crit, .strip');
    if (over.matches('dialog[open]:not([data-docked])')) return over.matches('#sheet-countdown') || (layer.matches('.pager, .screen') && (!isSpeed || over.querySelector('.sheet-head')?.checkVisibility() === true));
    if (over.matches('.screen')) return layer.matches('.pager') && (!isSpeed || document.querySelector('#monitor :is(.head-speed, .bar-speed)')?.checkVisibility() === true);
    return false;
  };
  const overs = all('.snack, dialog[open]:not([data-docked]), .view > .screen, #monitor > :is(.rail, .ledge, .strip, .titlebar, .under)');
  const wrong = [];
  for (const over of overs) {
    const at = shown(over);
    for (const item of items) {
      const px = area(within(at, item.at));
      if (!px || isMeant(over, item) || over.closest('.slot') && item.layer.matches('.pager')) continue;
      if (item.layer.matches('.snack, dialog[open]') && over.matches('#monitor > *')) continue; // the other way round it is found too
      const isFloating = over.matches('.ledge') && getComputedStyle(over).backgroundColor === 'rgba(0, 0, 0, 0)'; // no bar under which a list ends
      if (item.layer.matches('.screen, .pager') && rolls(item.one, over) && !(isFloating && item.one.matches(KEYS))) continue;
      wrong.push(`${name(over)} over ${name(item.one)} of ${name(item.layer)}: ${px} px`);
    }
    const box_ = box(over);
    if (over.matches('.snack, dialog') && (box_.left < -1 || box_.right > innerWidth + 1 || box_.top < -1 || box_.bottom > innerHeight + 1)) wrong.push(`${name(over)} outside`);
  }
  // beside a notice distance and age of the nearest object are whole before anything is scrolled, and the gauge is hardly smaller than the view allows;
  // a phone on its side, or a view lower than their two lines, has room for the speed alone
  const near = document.querySelector('#monitor[data-front="home"] [data-part="nearest"]');
  if (near && matchMedia('(height > 32.5em), (width >= 43.75em)').matches && all('.snack')[0] && !all('dialog[open], .view > .screen')[0]) {
    const gauge = document.querySelector('.gauge');
    const view = parseFloat(getComputedStyle(gauge).getPropertyValue('--view'));
    for (const one of view < 48 ? [] : all('[data-f="distance"], [data-ink="stale"].age', near)) {
      const { width, height } = box(one);
      if (area(shown(one)) < (one.matches('.age') ? 0.8 : 0.98) * width * height) wrong.push(`${area(shown(one))} of ${Math.round(width * height)} px of the nearest object's ${one.dataset.f} are in sight`);
    }
    const most = Math.min(innerWidth - 32, 460, Math.max(90, (view - 12) * 1.52));
    if (innerWidth < 700 && box(gauge).width < 0.9 * most) wrong.push(`the gauge is ${Math.round(box(gauge).width)} of ${Math.round(most)} px wide`);
  }
  if (innerWidth < 1000) for (const key of all('.checks li > button')) if (box(key).height < 43) wrong.push(`${name(key)} is ${box(key).height} px high`);
  return wrong;
}
