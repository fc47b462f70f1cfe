// What is pressed before the page has added its listeners is pressed again once it has: no tap is lost.

const PRESSED = 'button, a, label, input, select, summary';

/** Holds every press from now on; the result presses what was held, in its order, and holds no more. @returns {() => void} */
export function holdTaps() {
  /** @type {Element[]} */
  const held = [];
  /** @param {Event} event */
  const hold = (event) => {
    const { target } = event;
    // A dialog or notice was shown by code that listens already: a held press could be applied to a later one.
    if (!(target instanceof Element) || target.closest('dialog[open], .snack')) return;
    event.preventDefault(); // a form is not sent by itself
    event.stopImmediatePropagation();
    held.push(target.closest(PRESSED) ?? target); // what is written within is written anew
  };
  document.addEventListener('click', hold, { capture: true });
  return () => {
    document.removeEventListener('click', hold, { capture: true });
    for (const target of held) {
      const dialog = [...document.querySelectorAll('dialog[open]:not([data-docked])')].at(-1);
      if (dialog && !dialog.contains(target)) continue; // what lies under an alarm cannot be pressed
      if (target.isConnected) target.dispatchEvent(new MouseEvent('click', { bubbles: true, cancelable: true }));
    }
  };
}
