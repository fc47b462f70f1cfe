// One check, or the alarm that it raises: what it found and since when, its last minute against its limit, its thresholds, its alarms in this drive.

import { tilesOf } from './alarm-layout.js';
import { keysOf, silentWords, stateWords } from './alarms-layout.js';
import { drawMinute } from './check-chart.js';
import { CheckFeed } from './check-feed.js';
import { TAGS, episodeWords, figuresOf, placeOf, thresholdWords, totalWords } from './check-layout.js';
import { hasAged, whyUnchecked } from './checks.js';
import { openShelve } from './shelve.js';
import { dialogWords, lowered } from './standing.js';
import { html, icon, listen, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { fixed, timeOfDay } from '../core/format.js';
import { write } from '../core/ink.js';
import { openScreen } from '../core/open-screen.js';
import { ICONS, priorityOf } from '../core/priority.js';
import { speedUnit, speedWords } from '../core/units.js';
import { showInTrends } from '../home/drive-choice.js';
import { colours } from '../home/spark.js';
import { styled } from '../core/style-sheet.js';
import { settingsOf } from '../settings/settings-model.js';
import { SettingsRow } from '../settings/settings-row.js';

const LABELS = { silence: 'Silence', acknowledge: 'Acknowledge', shelve: 'Shelve', unshelve: 'Unshelve', take_alarm: 'Take over' };

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {{close?: () => void, of?: string}} where of: id of the check; close: it stands alone and can be closed
 */
export function mount(root, store, { close, of = '' }) {
  const view = new CheckView(root, store, of);
  show(view.parts.close, close !== undefined);
  view.draw();
  const { before, after, trends, change } = view.parts;
  const anew = () => view.recolour();
  const stops = [
    store.on('draw', () => view.draw()),
    listen(view.parts.close, 'click', () => close?.()),
    listen(before, 'click', () => view.turn('before')),
    listen(after, 'click', () => view.turn('after')),
    listen(change, 'click', () => view.change()),
    listen(trends, 'click', () => view.feed.answer?.signal && showInTrends(view.feed.answer.signal)),
    listen(window, 'catgraph-theme', anew),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', anew),
  ];
  return () => {
    stops.forEach((stop) => stop());
    view.stop();
    root.replaceChildren();
  };
}

class CheckView {
  #keys = '';
  #history = '';
  #siblings = '';
  /** @type {SettingsRow[]} */
  #rows = [];
  #isChanging = false;

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store @param {string} id */
  constructor(root, store, id) {
    this.store = store;
    this.parts = build(root);
    this.feed = new CheckFeed(store, id, () => this.draw());
    this.palette = this.#palette();
  }

  get alarm() {
    return this.store.frame?.alarms.find(({ id }) => id === this.feed.id) ?? null;
  }

  #palette() {
    const { body, chartNote } = this.parts;
    return { ...colours(body), ink2: getComputedStyle(chartNote).color };
  }

  recolour() {
    this.palette = this.#palette();
    this.draw();
  }

  draw() {
    const { store, feed, parts, alarm } = this;
    const { frame } = store;
    if (!frame) return;
    feed.look();
    const { answer } = feed;
    const isFault = alarm?.verdict === 'fault' || answer?.verdict === 'fault'; // stands until it is checked again
    const why = feed.isOld ? 'no answer' : whyUnchecked(store) ?? (!isFault && hasAged(store) ? 'stale' : null);
    const isAlways = why === 'paused' && answer?.verdict === 'fault'; // what the server finds although it is paused
    const isKnown = why === null || isAlways;
    const verdict = !isKnown ? 'unknown' : alarm?.verdict === 'fault' ? 'fault' : answer?.verdict ?? 'unknown';
    const label = answer?.label ?? alarm?.title ?? feed.id;
    setText(parts.title, label);
    setText(parts.tag, TAGS[verdict]);
    const priority = answer?.priority ?? alarm?.priority ?? 'warning';
    setAttribute(parts.view, 'data-verdict', verdict);
    setAttribute(parts.view, 'data-priority', priority);
    setIcon(parts.mark, verdict === 'fault' ? ICONS[priority] : verdict);
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    write(parts.speed, store.ink('speed').ink, typeof speed_mps === 'number' ? speedWords(speed_mps)[0] ?? '–' : '–', parts.unit, typeof speed_mps === 'number' ? speedUnit() : '');
    setSentence(parts.sentence, sentenceOf(verdict, why, isKnown, alarm?.verdict === 'fault' ? alarm.text : answer?.text, feed.problem));
    setSentence(parts.needs, verdict === 'unknown' && answer ? answer.checked_when : '');
    this.#drawAlarm(isKnown);
    figuresOf(answer, alarm, isKnown).forEach(({ label: name, value, unit, isLimit }, i) => {
      const at = parts.figures[i];
      if (!at) return;
      setText(at.label, name);
      setText(at.value, value);
      setText(at.unit, unit);
      setAttribute(at.value, 'class', isLimit ? 'n v mine' : 'n v');
    });
    this.#drawChart(isKnown);
    this.#drawThresholds();
    this.#drawHistory();
    this.#drawSiblings();
    this.#drawFoot();
  }

  /** @param {boolean} isKnown */
  #drawAlarm(isKnown) {
    const { store, alarm, parts } = this;
    const { title = '', suppressed_by: causes = [] } = (isKnown && !alarm && this.feed.answer) || {}; // not listed while another explains it
    show(parts.alarm, alarm !== null || causes.length > 0);
    const mayAct = !store.isViewer && !store.replaying && !store.isSilent;
    const keys = alarm && mayAct ? keysOf(alarm) : [];
    if (alarm && mayAct && alarm.state === 'UNACKED' && alarm.actions.includes('shelve')) keys.unshift('shelve');
    const key = `${alarm?.id} ${alarm?.occurrence} ${keys.join()}`;
    if (key !== this.#keys) {
      parts.keys.replaceChildren(...keys.map((name) => this.#key(name)));
      this.#keys = key;
    }
    if (causes.length) {
      setText(parts.alarmTitle, title);
      setSentence(parts.state, 'suppressed');
      setSentence(parts.story, `Cause: ${causes.join(', ')}. It is announced if it is still active when that ends.`);
    }
    if (!alarm) return;
    setText(parts.alarmTitle, alarm.title);
    setSentence(parts.state, [stateWords(alarm), silentWords(alarm)].filter(Boolean).join(', '));
    setSentence(parts.story, isKnown ? dialogWords(alarm) : `Began ${timeOfDay(alarm.raised_ms)}. ${alarm.advice}`);
  }

  /** @param {import('./alarms-layout.js').Key} name */
  #key(name) {
    const key = html('button', { type: 'button', class: name === 'acknowledge' ? 'key solid' : 'key', 'data-do': name }, LABELS[name]);
    key.addEventListener('click', () => void this.#answer(name));
    return key;
  }

  /** @param {import('./alarms-layout.js').Key} name */
  async #answer(name) {
    const { alarm, store, parts } = this;
    if (!alarm) return;
    const say = (/** @type {string} */ sentence) => setSentence(parts.message, sentence);
    say('');
    if (name === 'shelve') return openShelve(store, alarm, say);
    const answer = await store.ask(name, { alarm: alarm.id, ...(name === 'unshelve' ? {} : { occurrence: alarm.occurrence }) });
    if (!answer.ok) say(answer.reason ?? 'Refused.');
  }

  /** @param {boolean} isKnown */
  #drawChart(isKnown) {
    const { answer, got_ms } = this.feed;
    const { chart, chartNote, canvas } = this.parts;
    const minute = answer?.minute ?? null;
    const isMeasured = minute !== null && minute.values.some((value) => value !== null);
    show(chart, answer !== null);
    show(canvas, isMeasured);
    const unit = answer?.measured?.unit ?? this.alarm?.measured?.unit ?? this.feed.unit;
    setSentence(chartNote, !answer ? '' : !isMeasured ? 'nothing was measured' : isKnown ? unit : `until ${new Date(got_ms).toTimeString().slice(0, 8)}`);
    if (minute === null || !isMeasured) return;
    drawMinute(/** @type {HTMLCanvasElement} */ (canvas), minute, unit, momentOf(this.store) ?? Date.now(), this.palette);
    const known = minute.values.filter((value) => value !== null);
    setAttribute(canvas, 'aria-label', `Last 60 s: lowest ${fixed(Math.min(...known))}, highest ${fixed(Math.max(...known))} ${unit}`);
  }

  /** The rows of Settings, in place. */
  #drawThresholds() {
    const { feed, parts, store } = this;
    const model = settingsOf(store);
    if (feed.answer?.settings.length && !model.body) model.look();
    const names = (feed.answer?.settings ?? []).filter((name) => model.body?.schema[name]);
    show(parts.thresholds, names.length > 0);
    if (!names.length || !model.body) return;
    model.look();
    if (!this.#rows.length) {
      void styled('limits');
      this.#rows = names.flatMap((name) => (model.body?.schema[name] ? [new SettingsRow(model, name, model.body.schema[name])] : []));
      parts.rows.replaceChildren(...this.#rows.map(({ element }) => element));
    }
    setText(parts.thresholdTitle, this.#isChanging ? 'Thresholds' : model.body.schema[names[0] ?? '']?.title ?? ''); // each row has its own name
    setSentence(parts.thresholdWords, feed.answer ? thresholdWords(feed.answer) : '');
    show(parts.change, !store.isViewer && !store.replaying);
    setAttribute(parts.change, 'aria-expanded', String(this.#isChanging));
    setText(parts.change, this.#isChanging ? 'Done' : 'Change');
    show(parts.rows, this.#isChanging);
    for (const row of this.#rows) row.draw();
  }

  change() {
    this.#isChanging = !this.#isChanging;
    this.#drawThresholds();
    if (!this.#isChanging) return;
    this.parts.rows.querySelector('input')?.focus();
    const section = this.parts.rows.closest('.check-thresholds');
    if (section?.parentElement?.scrollTop) section.scrollIntoView({ block: 'start' }); // no piece of the chart above it
  }

  #drawHistory() {
    const { feed, parts, store } = this;
    const now_ms = momentOf(store) ?? 0;
    setSentence(parts.total, feed.episodes === null ? (feed.historyProblem || '…') : totalWords(feed.episodes, now_ms));
    const rows = (feed.episodes ?? []).slice(0, 20).map((episode) => episodeWords(episode, now_ms));
    const key = JSON.stringify(rows);
    if (key === this.#history) return;
    this.#history = key;
    const mark = ICONS[feed.answer?.priority ?? 'warning'];
    parts.history.replaceChildren(...rows.map(({ at, text, lasted }) => {
      const detail = html('span', { class: 'm' });
      setSentence(detail, text);
      return html('li', {}, html('span', { class: 'n' }, at), icon(mark, 's'), detail, html('span', { class: 'n' }, lasted));
    }));
  }

  /** The other checks of its tile. */
  #drawSiblings() {
    const { feed, parts } = this;
    const checks = feed.answer?.checks ?? [];
    show(parts.siblings, checks.length > 1);
    const key = JSON.stringify([feed.id, checks.map(({ id, verdict }) => [id, verdict])]);
    if (key === this.#siblings || checks.length < 2) return;
    this.#siblings = key;
    setText(parts.siblingsTitle, `${feed.answer?.tile}: ${checks.length} checks`);
    parts.others.replaceChildren(...checks.map(({ id, label, verdict, priority }) => {
      const row = html('button', { type: 'button', 'aria-current': id === feed.id ? 'true' : null }, icon(verdict === 'fault' ? (priority ? ICONS[priorityOf(priority)] : 'warn') : verdict, verdict === 'unknown' ? 's dashed' : 's'),
        html('span', {}, label), html('span', { class: 'm' }, TAGS[verdict]));
      row.addEventListener('click', () => openScreen('check', id));
      return html('li', {}, row);
    }));
  }

  #drawFoot() {
    const { parts, feed, store } = this;
    const { at, before, after, of } = placeOf(tilesOf(store.frame?.checks ?? []), feed.id);
    setSentence(parts.place, at < 0 ? '' : `${at + 1} of ${of}`);
    setAttribute(parts.before, 'aria-disabled', before === null);
    setAttribute(parts.after, 'aria-disabled', after === null);
    setAttribute(parts.trends, 'disabled', !feed.answer?.signal);
  }

  /** @param {'before' | 'after'} which */
  turn(which) {
    const tile = placeOf(tilesOf(this.store.frame?.checks ?? []), this.feed.id)[which];
    if (tile) openScreen('check', `tile:${tile.label}`);
  }

  stop() {
    for (const row of this.#rows) row.stop();
    this.feed.stop();
  }
}

/** The moment that is shown: now by the server's clock, or that of the recording. @param {import('../core/store.js').Store} store */
function momentOf({ frame }) {
  return frame?.replay ? frame.replay.at_ms : frame?.server.time_ms;
}

/**
 * The answer of the check, or why it has none.
 * @param {import('../core/protocol-types.js').Verdict} verdict @param {string | null} why @param {boolean} isKnown
 * @param {string | undefined} text @param {string} problem
 */
function sentenceOf(verdict, why, isKnown, text, problem) {
  if (problem) return problem;
  if (text === undefined) return '';
  const full = /[.!?]$/.test(text) ? text : `${text}.`;
  if (!isKnown) return `Not checked: ${why}. It was: ${lowered(full, [])}`;
  return verdict === 'unknown' ? `Not checked: ${lowered(full, [])}` : full;
}

/** Builds the parts of the view in `root`. @param {HTMLElement} root */
function build(root) {
  const mark = icon('ok');
  const [title, tag] = [html('h2', { tabindex: -1, 'data-f': 'check-title' }), html('span', { class: 'verdict', 'data-f': 'check-tag' })];
  const [speed, unit] = [html('span', { class: 'n v' }), html('span', { class: 'u' })];
  const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close the check', 'data-f': 'close' }, icon('close'));
  const [sentence, needs] = [html('p', { class: 'say', 'data-f': 'check-sentence' }), html('p', { class: 'sub', 'data-f': 'check-needs' })];
  const [alarmTitle, state, story] = [html('b'), html('span', { class: 'm' }), html('p')];
  const [keys, message] = [html('div', { class: 'ac' }), html('p', { class: 'bad', role: 'alert' })];
  const alarm = html('section', { class: 'block check-alarm', 'aria-label': 'Its alarm', 'data-f': 'check-alarm' }, html('p', {}, alarmTitle, ' ', state), story, keys, message);
  const figures = Array.from({ length: 3 }, () => ({ label: html('span', { class: 'lab' }), value: html('span', { class: 'n v' }), unit: html('span', { class: 'u' }) }));
  const three = html('section', { class: 'three', 'data-f': 'check-figures', 'aria-label': 'Numbers' }, ...figures.map(({ label, value, unit: of }) => html('div', {}, label, html('br'), value, of)));
  const [chartNote, canvas] = [html('span', { class: 'age', 'data-f': 'check-chart-message' }), html('canvas', { class: 'minute', role: 'img', 'aria-label': 'Last 60 s' })];
  const chart = html('section', { class: 'block', 'aria-label': 'Its last 60 seconds' }, html('div', { class: 'head' }, html('span', {}, 'Last ', html('span', { class: 'n' }, '60'), ' s'), chartNote), canvas);
  const [thresholdTitle, thresholdWords] = [html('b'), html('span', { class: 'm' })];
  const change = html('button', { type: 'button', class: 'key', 'aria-expanded': 'false', 'data-f': 'check-change' }, 'Change');
  const rows = html('div', { class: 'check-rows', hidden: true });
  const thresholds = html('section', { class: 'check-thresholds', 'aria-label': 'Thresholds' }, html('div', { class: 'row' }, html('span', {}, thresholdTitle, html('br'), thresholdWords), change), rows);
  const [total, history] = [html('span', { class: 'age', 'data-f': 'check-total' }), html('ul', { class: 'episodes', 'data-f': 'check-history' })];
  const past = html('section', { class: 'block', 'aria-label': 'Its alarms in this drive' }, html('div', { class: 'head' }, html('span', {}, 'This drive'), total), history);
  const [siblingsTitle, others] = [html('span'), html('ul', { class: 'others' })];
  const siblings = html('section', { class: 'block', 'aria-label': 'Checks of this tile' }, html('div', { class: 'head' }, siblingsTitle), others);
  const body = html('div', { class: 'check-body', tabindex: 0, role: 'region', 'aria-label': 'The check' }, html('div', { class: 'block check-message' }, sentence, needs), three, alarm, chart, thresholds, past, siblings);
  const turn = (/** @type {string} */ name, /** @type {string} */ label) => html('button', { type: 'button', class: 'key', 'aria-label': label, 'data-f': name }, icon(name === 'check-before' ? 'back' : 'next'));
  const [before, after, place] = [turn('check-before', 'Check before'), turn('check-after', 'Next check'), html('span', { 'data-f': 'check-place' })];
  const trends = html('button', { type: 'button', class: 'key', 'data-f': 'check-trends' }, 'Show in trends');
  const view = html('div', { class: 'alarm-list check-view' },
    html('div', { class: 'alarms-head' }, mark, title, tag, html('span', { class: 'alarms-speed', 'aria-label': 'Speed' }, speed, unit), close),
    body, html('div', { class: 'alarms-foot' }, trends, html('div', { class: 'turn' }, before, place, after)));
  root.replaceChildren(view);
  return { view, mark, title, tag, speed, unit, close, sentence, needs, alarm, alarmTitle, state, story, keys, message, figures, chart, chartNote, canvas, thresholds,
    thresholdTitle, thresholdWords, change, rows, past, total, history, siblings, siblingsTitle, others, body, before, after, place, trends };
}
