// Where the car is: latitude, longitude, altitude, heading; fuel where it is published.

import { field, setAttribute, setText, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { distanceWords, fixed, heading } from '../core/format.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const at = (/** @type {string} */ name) => field(root, name);
  const fields = {
    latitude: at('latitude'), longitude: at('longitude'), altitude: at('altitude'), altitudeUnit: at('altitude-unit'),
    heading: at('heading'), headingUnit: at('heading-unit'), fix: at('fix'),
    driven: at('driven'), drivenUnit: at('driven-unit'), apart: at('phone-apart'), apartUnit: at('phone-apart-unit'),
    fuelLine: at('fuel-line'), fuel: at('fuel'), fuelUnit: at('fuel-unit'),
  };

  function draw() {
    const { ink } = store.ink('position');
    const fix = store.signal('position')?.value;
    write(fields.latitude, ink, degrees(fix?.lat_deg));
    write(fields.longitude, ink, degrees(fix?.lon_deg));
    write(fields.altitude, ink, fixed(fix?.alt_m), fields.altitudeUnit, typeof fix?.alt_m === 'number' ? 'm' : '');
    // A receiver without a fix may go on sending numbers: they are not a position.
    const isLost = typeof fix?.status === 'number' && fix.status < 0;
    setText(fields.fix, isLost ? 'no fix' : '');
    setAttribute(fields.fix, 'class', isLost ? 'tag warn' : '');

    const turn = store.ink('heading');
    const heading_deg = store.signal('heading')?.value?.heading_deg;
    const course = typeof heading_deg === 'number' ? heading(heading_deg) : null;
    write(fields.heading, turn.ink, course ? course.degrees : '–', fields.headingUnit, course?.point ?? '');

    const { session, phone } = store.frame ?? {};
    const [driven, drivenUnit] = session?.track_m == null ? ['–', ''] : distanceWords(session.track_m);
    write(fields.driven, ink, driven, fields.drivenUnit, drivenUnit);
    // As on the map: a comparison that is older than 5 s is of another moment.
    const isNow = (phone?.compared_age_s ?? Infinity) + store.lag_s <= 5;
    const [apart, apartUnit] = !isNow || !phone?.used || phone.apart_m == null ? ['–', ''] : distanceWords(phone.apart_m);
    write(fields.apart, ink, apart, fields.apartUnit, apartUnit);

    const tank = store.ink('fuel');
    const fuel = store.signal('fuel')?.value;
    show(fields.fuelLine, tank.ink !== 'not_published');
    write(fields.fuel, tank.ink, fixed(fuel?.value ?? null), fields.fuelUnit, fuel?.unit ?? '');
  }

  if (store.frame) draw(); // before the first frame it is not shown
  return store.on('draw', () => store.painter.inTurn(draw));
}

/** Six decimals are 0.1 m. @param {unknown} value */
function degrees(value) {
  return typeof value === 'number' ? `${fixed(value, 6)}°` : '–';
}
