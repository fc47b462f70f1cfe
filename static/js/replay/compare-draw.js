// What is drawn upon the charts of two recordings beside their lines: alarms, and what a side lacks.

/**
 * Alarms of A in the upper half, of B in the lower; the first pane has their shapes.
 * @param {{ctx: CanvasRenderingContext2D, bbox: {top: number, height: number}, valToPos: (value: number, scale: string, isCanvas: boolean) => number}} plot a chart of uPlot
 * @param {import('./compare-panes.js').Scene['marks']} marks
 * @param {Record<'crit' | 'edge' | 'panel' | 'amber', string>} palette
 * @param {boolean} isFirst
 */
export function drawMarks(plot, marks, palette, isFirst) {
  const { ctx: g, bbox } = plot;
  const ratio = devicePixelRatio || 1;
  for (const { at_s, side, priority } of marks) {
    const isCritical = priority === 'critical';
    const [x, top] = [plot.valToPos(at_s, 'x', true), bbox.top + (side === 'a' ? 0 : bbox.height / 2)];
    g.strokeStyle = isCritical ? palette.crit : palette.edge;
    g.lineWidth = 1.5 * ratio;
    g.setLineDash([3 * ratio, 4 * ratio]);
    g.beginPath();
    g.moveTo(x, top);
    g.lineTo(x, top + bbox.height / 2);
    g.stroke();
    if (!isFirst) continue;
    g.setLineDash([]);
    g.fillStyle = isCritical ? palette.crit : palette.amber;
    g.strokeStyle = palette.panel;
    const r = 7 * ratio;
    g.beginPath();
    for (const [i, [dx = 0, dy = 0]] of (isCritical ? [[0, -1], [1, 0], [0, 1], [-1, 0]] : [[0, -1], [1.1, 0.9], [-1.1, 0.9]]).entries()) g[i ? 'lineTo' : 'moveTo'](x + dx * r, top + r + dy * r);
    g.closePath();
    g.fill();
    g.stroke();
  }
}

/**
 * @param {CanvasRenderingContext2D} g
 * @param {[number, number, number, number]} box
 * @param {string} colour
 * @param {1 | -1} slope
 * @param {number} ratio
 */
export function hatch(g, [left, top, width, height], colour, slope, ratio) {
  g.save();
  g.beginPath();
  g.rect(left, top, width, height);
  g.clip();
  g.setLineDash([]);
  g.strokeStyle = colour;
  g.lineWidth = 2 * ratio;
  g.beginPath();
  for (let x = left - height; x < left + width + height; x += 9 * ratio) {
    g.moveTo(x, top + (slope > 0 ? height : 0));
    g.lineTo(x + height, top + (slope > 0 ? 0 : height));
  }
  g.stroke();
  g.restore();
}
