// Whether all parts of a car stand in sight at once, as panes; below that size the tabs are turned like pages.

/** A desktop, a tablet on its side, a tablet upright, as in watch.css. */
const FLOOR = ['(width >= 62.5em) and (height >= 37.5em)', '(width >= 43.75em) and (height >= 66.25em)'];

/** @type {MediaQueryList | null} */
let query = null;

/** @returns {MediaQueryList} */
export function floorQuery() {
  query ??= matchMedia(FLOOR.join(', '));
  return query;
}

/** Are the panes laid out side by side? */
export function isFloor() {
  return floorQuery().matches;
}

/** @type {MediaQueryList | null} */
let wall = null;

/** Are map and scan beside the instruments at every tab that is no page of its own? As `wall.css` has it; to read innerWidth would make the browser do its style and layout at once. */
export const isWall = () => (wall ??= matchMedia('(width >= 112.5em) and (height >= 53.75em)')).matches;

/** Is the list of alarms in sight, with its keys? Nothing need then ask for it in another place. */
export function areAlarmsInSight() {
  const monitor = document.getElementById('monitor');
  return isFloor() && monitor !== null && !monitor.hidden && monitor.dataset['wide'] !== 'page' && !monitor.querySelector('.compare')?.checkVisibility(); // it takes the place of all panes
}
