// Panes of one time line, one below the other: what the drive's chart and the comparison of two recordings share.

import { colours } from './spark.js';

/** Height of the clock axis below the last pane [px]. */
export const AXIS_PX = 26;
/** A lower pane has room for the ends of its scale only [px]. */
export const LOW_PX = 84;
/** A still lower one has room for one of them [px]. */
const FLAT_PX = 40;
/** Times between two ticks of the clock [s]. */
export const INCRS_S = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10_800, 21_600, 43_200, 86_400];

/**
 * @typedef {object} StackedPane
 * @property {HTMLElement} element
 * @property {HTMLElement} host where uPlot draws
 * @property {import('../../vendor/uPlot.esm.js')} plot
 * @property {() => void} begin once it has its place
 * @property {() => void} resize
 */

/** @template {StackedPane} P */
export class PaneStack {
  /** @type {P[]} */
  panes = [];

  /** @param {HTMLElement} root */
  constructor(root) {
    this.root = root;
    this.palette = colours(root);
  }

  /** The drawing area of the first pane: all have the same left and right edge. */
  get box() {
    return this.panes[0]?.plot?.over.getBoundingClientRect() ?? new DOMRect(0, 0, 1, 1);
  }

  /**
   * @template T
   * @param {T[]} specs a pane each
   * @param {(spec: T, isLast: boolean) => P} paneOf
   */
  stack(specs, paneOf) {
    this.clear();
    this.palette = colours(this.root);
    this.panes = specs.map((spec, i) => paneOf(spec, i === specs.length - 1));
    this.root.replaceChildren(...this.panes.map(({ element }) => element));
    for (const pane of this.panes) pane.begin();
  }

  clear() {
    for (const { plot } of this.panes) plot.destroy();
    this.panes = [];
    this.root.replaceChildren();
  }

  resize() {
    for (const pane of this.panes) pane.resize();
  }
}

/** Is there room for one tick only? @param {number} height of the plot, without its clock [px] */
const isFlat = (height) => height < FLAT_PX;

/** Above and below what is drawn; a flat plot gives less away [px]. @param {number} height of the plot, without its clock [px] */
export const marginOf = (height) => (isFlat(height) ? 7 : 9);

/** Of its ticks those that have room. @param {number[]} ticks @param {number} height of the plot, without its clock [px] */
export function roomFor(ticks, height) {
  return isFlat(height) ? ticks.slice(-1) : ticks;
}

/** The room for a plot [px]. @param {HTMLElement} host */
export function plotSize(host) {
  return { width: Math.max(60, host.clientWidth), height: Math.max(24, host.clientHeight) };
}

/** What all axes of a plot share. @param {ReturnType<typeof colours>} palette */
export function axisOf(palette) {
  const face = `13px ${getComputedStyle(document.documentElement).getPropertyValue('--digits').trim()}`;
  return { stroke: palette.ink2, font: face, grid: { stroke: palette.line, width: 1, dash: [2, 6] }, ticks: { show: false }, gap: 6 };
}

/** Of a plot that shows values and no cursor or key of its own. */
export const BARE = {
  legend: { show: false },
  cursor: { show: false },
  select: { show: false, left: 0, top: 0, width: 0, height: 0 },
};
